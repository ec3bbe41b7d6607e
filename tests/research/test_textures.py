"""Objects that are not quite uniform: what lies on them is mild."""

import numpy as np

from anyprobe.core.latlong import pixel_directions
from research.painted import factor_at


def test_a_texture_varies_a_little_about_one(rng):
    on_sphere = pixel_directions(32).reshape(-1, 3)
    for _ in range(8):
        factor = factor_at(on_sphere, on_sphere, rng)
        np.testing.assert_allclose(factor.mean(axis=0), 1.0, rtol=1e-4)
        assert 0.01 < np.log(factor).std() < 0.8

"""The mean training map."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs ./train[torch]")

from anyprobe.maps.radiance import read_radiance  # noqa: E402
from research.export_weights.mean_map import STRIDE, write_mean_map  # noqa: E402


def test_the_mean_map_is_the_geometric_mean_of_maps_that_are_not_neighbours(tmp_path):
    asked = []

    def batch(step):
        asked.append(step)
        level = 1.0 if step % (2 * STRIDE) else 4.0
        return SimpleNamespace(ln_radiance=torch.full((3, 3, 64, 128), level).log())

    write_mean_map(SimpleNamespace(batch=batch), tmp_path / "mean.exr", batches=4)
    assert asked == [0, STRIDE, 2 * STRIDE, 3 * STRIDE]
    np.testing.assert_allclose(read_radiance(tmp_path / "mean.exr"), 2.0, rtol=1e-3)

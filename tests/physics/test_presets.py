"""Materials by name and albedo, from Python."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.errors import InputError
from anyprobe.scatter.materials import MATERIALS, MATTE, given_material


@pytest.mark.parametrize("albedo", [0.18, [0.18], (0.18, 0.18, 0.18), np.float32(0.18)])
def test_one_number_or_three_are_an_albedo(albedo):
    found = given_material(albedo=albedo)
    np.testing.assert_allclose(found.albedo, [0.18] * 3, rtol=1e-6)
    assert found.alpha == MATERIALS[MATTE].alpha
    assert given_material() is None


@pytest.mark.parametrize(
    ("albedo", "word"), [(2.0, "got 2;"), (0.0, "got 0;"), ((0.2, 0.3), "got 0.2, 0.3"), (np.nan, "got nan")]
)
def test_other_albedo_is_one_line(albedo, word):
    with pytest.raises(InputError, match="albedo: expected one number or three") as caught:
        given_material(albedo=albedo)
    assert word in str(caught.value)

"""Materials by name and albedo, from Python."""

from __future__ import annotations

import numpy as np
import pytest
from support.refused import refused

from anyprobe.scatter.materials import MATERIALS, MATTE, MEASURED, PRESETS, as_material, total_reflectance


@pytest.mark.parametrize("albedo", [0.18, [0.18], (0.18, 0.18, 0.18), np.float32(0.18)])
def test_one_number_or_three_are_an_albedo(albedo):
    found = as_material(albedo=albedo)
    np.testing.assert_allclose(found.albedo, [0.18] * 3, rtol=1e-6)
    assert found.alpha == MATERIALS[MATTE].alpha
    assert as_material() is None


@pytest.mark.parametrize(
    ("albedo", "word"), [(2.0, "got 2;"), (0.0, "got 0;"), ((0.2, 0.3), "got 0.2, 0.3"), (np.nan, "got nan")]
)
def test_other_albedo_is_one_line(albedo, word):
    with refused("albedo") as caught:
        as_material(albedo=albedo)
    assert word in str(caught.value)


def test_measured_materials_are_surfaces_and_none_hides_one_of_our_own():
    assert not set(PRESETS) & set(MEASURED)
    assert len(MEASURED) >= 50
    for name in MEASURED:
        found = as_material(name)
        assert np.all(total_reflectance(found.albedo, found.f0) <= 1), name
    np.testing.assert_allclose(as_material("porcelain").f0, 0.04)  # ((1.5 - 1) / (1.5 + 1))^2
    assert not np.any(as_material("copper").albedo)

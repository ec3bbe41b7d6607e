"""The object's material as Python tells it: a Material, a name, an albedo; at every entry point alike."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from support.refused import refused
from support.scenes import sphere_photo

import anyprobe
from anyprobe.estimate.extract import extract_of
from anyprobe.estimate.photo import load_photo
from anyprobe.scatter.materials import MATERIALS, as_material


def through(entry: str, estimator, rgba: np.ndarray, **given):
    """The light of one photo, by one of the ways to ask for it."""
    if entry == "estimate":
        return anyprobe.estimate(rgba, **given)
    if entry == "call":
        return estimator(rgba, **given)
    photo = load_photo(rgba)
    if entry == "from_photo":
        return estimator.from_photo(photo, material=as_material(**given))
    if entry == "from_extract":
        return estimator.from_extract(extract_of(photo), as_material(**given))
    return estimator.multiview([photo], [np.eye(3)], **given)


@pytest.fixture(scope="module")
def expected(estimator) -> list[tuple[dict, anyprobe.Light]]:
    """What is told, and the light of the Material that it means."""
    means = [
        ({"material": "chrome"}, MATERIALS["chrome"]),
        ({"albedo": 0.18}, as_material(albedo=0.18)),
        ({"material": "plastic", "albedo": [0.2, 0.3, 0.4]}, as_material("plastic", (0.2, 0.3, 0.4))),
    ]
    return [(given, estimator(sphere_photo(), material=material)) for given, material in means]


@pytest.mark.ci
@pytest.mark.parametrize("entry", ["estimate", "call", "from_photo", "from_extract", "together"])
def test_name_albedo_and_material_reach_the_light(estimator, photo_rgba, expected, entry):
    for given, light in expected:
        found = through(entry, estimator, photo_rgba, **given)
        np.testing.assert_allclose(found.radiance, light.radiance, rtol=1e-5)  # fused in logarithms
        assert found.info["hints"] == light.info["hints"]


@pytest.mark.parametrize(
    "values",
    [
        {"albedo": "x"},
        {"albedo": -np.ones(3)},
        {"f0": np.full(3, np.nan)},
        {"f0": np.ones(4)},
        {"alpha": 0.0},
        {"alpha": "x"},
    ],
)
def test_numbers_that_no_surface_has_are_refused(values):
    with refused("material") as error:
        as_material(anyprobe.Material(**{"albedo": 0.5, "f0": 0.04, "alpha": 0.9} | values))
    assert "\n" not in str(error.value)


def test_lists_and_single_numbers_are_numbers_of_a_material(estimator, photo_rgba):
    written = anyprobe.Material(albedo=[0.3, 0.3, 0.3], f0=0.04, alpha=0.9)
    found = estimator(photo_rgba, material=written)
    np.testing.assert_array_equal(found.radiance, estimator(photo_rgba, material="matte").radiance)


def test_who_takes_a_material_takes_an_albedo():
    for entry in (anyprobe.estimate, anyprobe.Estimator.__call__, anyprobe.Estimator.multiview):
        assert {"material", "albedo", "roughness"} <= set(inspect.signature(entry).parameters), entry

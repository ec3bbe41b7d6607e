"""Two looks at a photo: a mirrored photo has the mirrored light, and the likelier of both is taken."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.refused import refused

from anyprobe.errors import InputError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.mirror_look import MIRRORED, likelier, mirrored_back, mirrored_crop
from anyprobe.estimate.photo import Photo, crop_object, load_photo
from anyprobe.estimate.runtime import Outputs

TABLE = Path(__file__).parents[2] / "examples" / "table.jpg"
BOX = (130, 100, 325, 385)


@pytest.fixture(scope="module")
def photo() -> Photo:
    return load_photo(TABLE, box=BOX, fov_deg=42.0, pitch_deg=20.0)


def in_mirror(photo: Photo) -> Photo:
    rgb = np.ascontiguousarray(np.round(photo.rgb[:, ::-1] * 255).astype(np.uint8))
    return load_photo(rgb, mask=np.ascontiguousarray(photo.mask[:, ::-1]), fov_deg=42.0, pitch_deg=20.0)


@pytest.mark.ci
@pytest.mark.parametrize("surroundings", ["photo", "none"])
def test_a_mirrored_photo_has_the_mirrored_light(estimator, photo, surroundings):
    both = estimator.with_settings(looks=2)
    asked = [photo, in_mirror(photo)]
    if surroundings == "none":
        asked = [replace(one, surroundings=None, ground=None) for one in asked]
    apart = []
    for model in (estimator, both):
        first, second = (model.from_photo(one) for one in asked)
        apart.append(np.abs(np.log((first.radiance + 0.1) / (second.radiance[:, ::-1] + 0.1))).mean())
    one_look, two_looks = apart
    assert two_looks < 0.02, "pixels are sampled and directions turned a little otherwise in the mirror"
    assert two_looks < one_look / 5
    assert first.origin.looks == 2


def test_a_crop_in_the_mirror_twice_is_itself(photo):
    crop = crop_object(photo)
    again = mirrored_crop(mirrored_crop(crop))
    for name in ("image", "surroundings_map", "context"):
        np.testing.assert_array_equal(getattr(again, name), getattr(crop, name))
    normals = np.random.default_rng(0).normal(size=(64, 64, 3)).astype(np.float32)
    turned = mirrored_crop(replace(crop, normals=normals)).normals
    np.testing.assert_array_equal(turned[3, 5], normals[3, -6] * MIRRORED)


def outputs(at: int, expected_at: int) -> Outputs:
    """A map with its light at one column, which expects it at another."""
    radiance, expected = np.full((2, 64, 128, 3), 0.1, np.float32)
    radiance[30, at], expected[30, expected_at] = 50.0, 20.0
    flat = np.zeros((128, 128, 3), np.float32)
    return Outputs(radiance=radiance, irradiance=flat, ldr=radiance, ln_radiance=np.log(radiance), expected=expected)


def test_the_light_that_both_expect_is_taken():
    sure, unsure = outputs(40, 40), outputs(90, 40)
    for found in (likelier(sure, unsure), likelier(unsure, sure)):
        assert found.radiance is sure.radiance
        np.testing.assert_allclose(found.expected, sure.expected)
    assert mirrored_back(outputs(40, 50)).radiance[30, 127 - 40, 0] == 50.0


@pytest.mark.ci
def test_other_numbers_of_looks_are_refused():
    for looks in (0, 3):
        with refused("looks") as error:
            Estimator(looks=looks)
        assert error.value.subject == ("looks",)
    with pytest.raises(InputError) as error:
        Estimator("paper", looks=2)(TABLE, box=BOX, surroundings="none")
    assert error.value.subject == ("looks",)

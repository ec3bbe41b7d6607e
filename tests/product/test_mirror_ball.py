"""A mirror ball is known by what it shows; balls of other materials are not taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fastapi.testclient import TestClient
from support.balls import FOV, ball_photo, lamp_map, rich_map

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.mirror_ball import least_metal
from anyprobe.estimate.photo import load_photo
from anyprobe.serve.answers import png
from anyprobe.serve.api import create_app


@pytest.mark.parametrize("kind", ["mirror", "matte", "painted"])
def test_only_a_ball_that_shows_its_place_is_one(kind):
    picture, mask = ball_photo(rich_map(), kind)
    photo = load_photo(picture, mask=mask, fov_deg=FOV)
    assert (least_metal(photo) == 0.0) == (kind == "mirror")  # by what its rim shows, whatever the network says
    square = np.zeros_like(mask)
    square[60:180, 100:220] = 1
    assert least_metal(load_photo(picture, mask=square, fov_deg=FOV)) > 1.0


@pytest.mark.parametrize("kind", ["mirror", "matte"])
def test_a_ball_in_a_dark_room_is_a_mirror_if_it_shows_the_lamp_alone(kind):
    """Nothing else is seen in it or beside it; a matte ball would be lit on one side."""
    picture, mask = ball_photo(lamp_map(), kind)
    assert (least_metal(load_photo(picture, mask=mask, fov_deg=FOV)) == 0.0) == (kind == "mirror")


def test_a_lens_that_is_not_known_is_tried():
    """60 degrees are assumed where nothing says so, and wider and narrower lenses tried; a given one is believed."""
    picture, mask = ball_photo(rich_map(), "mirror", 79.0)
    assert least_metal(load_photo(picture, mask=mask)) == 0.0
    assert least_metal(load_photo(picture, mask=mask, fov_deg=60.0)) > 0.0


def test_without_a_background_the_network_decides():
    """What is transparent shows no place, whatever colours it has."""
    picture, mask = ball_photo(rich_map(), "mirror")
    photo = load_photo(picture, mask=mask, fov_deg=FOV)
    alone = replace(photo, hidden=mask == 0)
    assert [least_metal(one) == 0.0 for one in (photo, alone)] == [True, False]
    assert 0.0 < least_metal(alone) <= 0.9


def test_it_is_unwrapped_with_a_line_unless_a_material_is_given():
    radiance = rich_map()
    picture, mask = ball_photo(radiance, "mirror")
    found = anyprobe.estimate(picture, mask=mask, fov_deg=FOV)
    assert any("unwrapped as a mirror ball" in line for line in found.warnings)
    seen = pixel_directions(64)[..., 2] > -0.3
    error = np.abs(response(found.radiance * 0.55 / 0.8) - response(radiance))[seen]
    assert np.median(error) < 0.06
    given = anyprobe.estimate(picture, mask=mask, fov_deg=FOV, material="matte")
    assert not any("mirror ball" in line for line in given.warnings)


@pytest.mark.ci
def test_a_server_unwraps_it_as_python_does(estimator):
    picture, mask = ball_photo(rich_map(), "mirror")
    files = {"photo": png(picture), "mask": png(np.round(mask * 255).astype(np.uint8))}
    with TestClient(create_app(estimator)) as client:
        answers = [
            client.post("/v1/estimate", files=files, data={"fov": str(FOV), **more}).json()
            for more in ({}, {"material": "matte"})
        ]
    codes = [[one["code"] for one in answer["notices"]] for answer in answers]
    assert ["mirror-ball" in some for some in codes] == [True, False]
    found = estimator(picture, mask=mask, fov_deg=FOV).dominant_light()
    np.testing.assert_allclose(answers[0]["dominant_light"]["direction"], found.direction, atol=1e-3)

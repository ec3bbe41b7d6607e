"""A mirror ball is known by what it shows; balls of other materials are not taken for one."""

from __future__ import annotations

import numpy as np
import pytest
from fastapi.testclient import TestClient
from support.balls import FOV, ball_photo, rich_map

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.extract import looks_like_ball
from anyprobe.estimate.photo import load_photo
from anyprobe.pictures.images import png_bytes as png
from anyprobe.serve.api import create_app


@pytest.mark.parametrize("kind", ["mirror", "matte", "painted"])
def test_only_a_ball_that_shows_its_place_is_one(kind):
    """Paint shows structure, too; the network does not take it for metal."""
    picture, mask = ball_photo(rich_map(), kind)
    assert looks_like_ball(load_photo(picture, mask=mask, fov_deg=FOV)) == (kind != "matte")
    codes = {one.code for one in anyprobe.estimate(picture, mask=mask, fov_deg=FOV).warnings}
    assert ("mirror-ball" in codes) == (kind == "mirror")
    square = np.zeros_like(mask)
    square[60:180, 100:220] = 1
    assert not looks_like_ball(load_photo(picture, mask=square, fov_deg=FOV))


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

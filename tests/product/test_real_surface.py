"""How likely a place in the photo is on the surface under the real object."""

from __future__ import annotations

import numpy as np
import pytest
from support.refused import refused

from anyprobe.estimate.ground import contact_of
from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.placement import LEAST, RealSurface
from anyprobe.render.shapes import sphere


def photo_of(under: tuple[float, float, float] | None, shadow: float = 1.0) -> Photo:
    """A ball before a floor; under: colour of a post below it. shadow: the floor's brightness there, soft."""
    height, width = 192, 256
    y, x = np.mgrid[:height, :width]
    noise = np.random.default_rng(0).normal(0, 0.01, (height, width, 1))
    picture = np.array([0.6, 0.5, 0.35]) + noise
    dark = np.exp(-(((x - 128) / 40) ** 2) - ((y - 135) / 12) ** 2)
    picture = picture * (1 - (1 - shadow) * dark[..., None])
    if under is not None:
        picture[(abs(x - 128) < 14) & (y > 100)] = under
    mask = ((x - 128) ** 2 + (y - 95) ** 2 < 38**2).astype(np.float32)
    picture[mask > 0] = (0.3, 0.5, 0.7)
    return load_photo(np.round(255 * picture.clip(0, 1)).astype(np.uint8), mask=mask)


def likelihood(photo: Photo, x: float) -> float:
    """Of the colours from the contact point to the ground 15 px to either side of column x."""
    column, row = contact_of(photo.mask)
    low, high = np.array([[min(column, x - 15), row - 8]]), np.array([[max(column, x + 15), row + 8]])
    return float(RealSurface(photo, (column, row)).inside(low, high)[0][0])


@pytest.mark.parametrize("shadow", [1.0, 0.35])
def test_a_floor_goes_on_beside_the_object_and_under_its_shadow(shadow):
    assert likelihood(photo_of(None, shadow), 210) > LEAST


def test_a_floor_ends_where_another_colour_begins_without_an_edge():
    """A blurred background has no edge to end the floor."""
    height, width = 192, 256
    y, x = np.mgrid[:height, :width]
    grass = 1 / (1 + np.exp(-(x - 190) / 6.0))[..., None]
    picture = (1 - grass) * (0.6, 0.5, 0.35) + grass * (0.25, 0.45, 0.2)
    mask = ((x - 128) ** 2 + (y - 95) ** 2 < 38**2).astype(np.float32)
    photo = load_photo(np.round(255 * picture).astype(np.uint8), mask=mask)
    assert likelihood(photo, 160) > LEAST > likelihood(photo, 230)


@pytest.mark.parametrize("post", [(0.05, 0.05, 0.06), (0.2, 0.35, 0.6)])
def test_an_object_on_a_post_does_not_stand_on_the_floor_behind_it(post):
    assert likelihood(photo_of(post), 200) < LEAST


def test_nothing_is_put_beside_an_object_on_a_post_unless_a_place_is_given():
    photo = photo_of((0.05, 0.05, 0.06))
    with refused("at"):
        Stage(photo, sphere(24))
    for stage in (Stage(photo, sphere(24), Arrangement(at=(200, 150))), Stage(photo_of(None), sphere(24))):
        assert not stage.placement.is_in_front

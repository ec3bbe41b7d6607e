"""By default what the photo shows around the object is used, unless the object is cut out."""

from __future__ import annotations

import numpy as np
import pytest
from support.room_photos import FOV_DEG, room_photo, smooth_map

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.photo import load_photo

GREEN = np.array([90, 160, 60], np.uint8)
PITCH_DEG = 25.0


def on_a_table() -> tuple[np.ndarray, np.ndarray]:
    """A photo [240, 360, 3] of a camera that looks PITCH_DEG down on a green table, a little brighter to the right; and
    its mask."""
    y, x = np.mgrid[0:240, 0:360]
    planks = 1.0 - 0.15 * (x // 24 % 2)
    photo = (GREEN * ((0.8 + 0.4 * x / 360) * planks)[..., None]).astype(np.uint8)
    mask = np.where((x - 180) ** 2 + (y - 130) ** 2 < 40**2, 255, 0).astype(np.uint8)
    photo[mask > 0] = [200, 60, 60]
    return photo, mask


@pytest.mark.parametrize("pitch_deg", [PITCH_DEG, None])
def test_below_the_horizon_the_light_takes_the_ground_s_colour(pitch_deg):
    photo, mask = on_a_table()
    light = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, pitch_deg=pitch_deg)
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    down = -pixel_directions(64) @ up_of(PITCH_DEG)
    ground = (pixel_directions(64)[..., 2] > 0.3) & (down > 0.6)  # what the camera cannot see
    found, before = light.radiance[ground].mean(axis=0), alone.radiance[ground].mean(axis=0)
    tint = np.log(found[1] / found[[0, 2]]) - np.log(before[1] / before[[0, 2]])
    assert (tint > 0.1).all()  # greener than what the object alone tells


def test_the_ground_is_given_or_estimated():
    photo, mask = on_a_table()
    given = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, pitch_deg=PITCH_DEG).ground
    assert (given.pitch_deg, given.source) == (PITCH_DEG, "given")
    found = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    assert found.ground.source == "estimated"
    assert -20 < found.ground.pitch_deg < 80
    assert found.sidecar()["ground"]["pitch_deg"] == round(found.ground.pitch_deg, 2)
    assert anyprobe.estimate(photo, mask=mask, surroundings="none").ground is None


@pytest.mark.ci
def test_transparent_corners_say_nothing_whatever_their_colours():
    photo, mask = on_a_table()
    alpha = np.full(mask.shape, 255, np.uint8)
    alpha[:, :120] = alpha[200:, 300:] = 0
    maps, details = [], []
    for color in (0, 255):
        cut = np.dstack([np.where(alpha[..., None] > 0, photo, np.uint8(color)), alpha])
        loaded = load_photo(cut, mask=mask, fov_deg=FOV_DEG)
        maps.append(anyprobe.estimate(cut, mask=mask, fov_deg=FOV_DEG).radiance)
        details.append(anyprobe.Estimator().from_photo(loaded).seen)
    np.testing.assert_array_equal(maps[0], maps[1])
    np.testing.assert_allclose(*(one[..., :3] * (one[..., 3:] > 0) for one in details), atol=0.05)
    whole = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG).radiance
    assert np.abs(np.log(maps[0].mean() / whole.mean())) < 0.3, "the light is that of what is seen"


@pytest.mark.parametrize("background", ["transparent", "white", "flaws", "backdrop"])
def test_cut_outs_are_estimated_as_they_were(background):
    photo, mask = room_photo(smooth_map())
    rng = np.random.default_rng(1)
    photo[mask == 0] = 250
    if background == "flaws":  # as of JPEG around the object
        photo[40:52] = np.clip(photo[40:52] + rng.integers(-60, 6, (12, *photo.shape[1:])), 0, 255)
    if background == "backdrop":  # paper that is lit from above
        rows = np.linspace(90, 160, len(photo))[:, None, None]
        photo[mask == 0] = np.broadcast_to(rows, photo.shape)[mask == 0] + rng.integers(
            -1, 2, (int((mask == 0).sum()), 3)
        )
    if background == "transparent":
        photo[mask == 0] = rng.integers(0, 255, (int((mask == 0).sum()), 3))
        photo, mask = np.dstack([photo, mask]), None
    auto = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    np.testing.assert_array_equal(auto.radiance, alone.radiance)
    np.testing.assert_array_equal(auto.confidence, alone.confidence)
    assert "surroundings" not in auto.info["hints"]


@pytest.mark.parametrize(("grey", "opaque", "said"), [(250, True, True), (0, True, False), (250, False, False)])
def test_a_backdrop_that_is_not_used_is_said(grey, opaque, said):
    """White may be a studio's; black and transparency are a cut-out's."""
    photo, mask = room_photo(smooth_map())
    photo[mask == 0] = grey
    given = {"mask": mask} if opaque else {}
    light = anyprobe.estimate(photo if opaque else np.dstack([photo, mask]), fov_deg=FOV_DEG, **given)
    assert any(one.code == "plain-backdrop" for one in light.warnings) == said
    assert light.ground is None


def test_a_dark_background_that_is_not_used_is_said():
    photo, mask = on_a_table()
    photo[mask == 0] = np.random.default_rng(0).integers(0, 40, ((mask == 0).sum(), 3))
    given = {"mask": mask, "fov_deg": FOV_DEG}
    light = anyprobe.estimate(photo, **given)
    assert "dark-backdrop" in [one.code for one in light.warnings]
    assert light.ground is None
    asked = anyprobe.estimate(photo, **given, surroundings="photo")
    assert asked.ground is not None
    assert "dark-backdrop" not in [one.code for one in asked.warnings]


def test_alpha_that_is_zero_everywhere_cuts_nothing_out():
    photo, mask = on_a_table()
    empty = np.dstack([photo, np.zeros_like(mask)])
    assert load_photo(empty, mask=mask, fov_deg=FOV_DEG).ground == load_photo(photo, mask=mask, fov_deg=FOV_DEG).ground

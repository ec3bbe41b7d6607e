"""By default the background is used unless the object is cut out, and the ground's colour goes on below the horizon."""

from __future__ import annotations

import numpy as np
import pytest
from support.room_photos import FOV_DEG, room_photo, smooth_map

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.estimate.below_horizon import BEGINS_DEG, FULL_DEG, WEIGHT, ground_below
from anyprobe.estimate.ground import Ground, up_of
from anyprobe.estimate.photo import crop_object, load_photo
from anyprobe.estimate.surroundings import CONTINUED

GREEN = np.array([90, 160, 60], np.uint8)
PITCH_DEG = 25.0


def on_a_table() -> tuple[np.ndarray, np.ndarray]:
    """A photo [240, 360, 3] of a camera that looks PITCH_DEG down on a green table, a little brighter to the right; and
    its mask."""
    y, x = np.mgrid[0:240, 0:360]
    photo = (GREEN * (0.8 + 0.4 * x / 360)[..., None]).astype(np.uint8)
    mask = np.where((x - 180) ** 2 + (y - 130) ** 2 < 40**2, 255, 0).astype(np.uint8)
    photo[mask > 0] = [200, 60, 60]
    return photo, mask


@pytest.mark.parametrize("pitch_deg", [PITCH_DEG, None])
def test_below_the_horizon_the_ground_has_its_colour(pitch_deg):
    photo, mask = on_a_table()
    light = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, pitch_deg=pitch_deg)
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    down = -pixel_directions(64) @ up_of(PITCH_DEG)
    behind = pixel_directions(64)[..., 2] > 0.3  # what the camera cannot see
    ground = behind & (down > 0.6)
    expected = WEIGHT * inverse_response(GREEN / 255.0)
    found, before = light.radiance[ground].mean(axis=0), alone.radiance[ground].mean(axis=0)
    tint = np.log(found[1] / found[[0, 2]]) - np.log(before[1] / before[[0, 2]])
    assert (tint > 0.2).all()  # greener than what was guessed
    assert (found > 0.95 * expected).all()
    assert light.confidence[ground].mean() == pytest.approx(CONTINUED, abs=0.12)
    assert light.sidecar()["hints"]["ground"] > 0.2
    assert np.abs(light.radiance - alone.radiance)[~behind].max() > 0.02


def test_a_ground_is_open_only_below_the_horizon_and_where_nothing_is_seen():
    seen = np.zeros((64, 128, 4), np.float32)
    seen[30:50, 50:78] = [0.4, 0.5, 0.2, 1.0]
    ground = Ground(pitch_deg=20.0, pitch_error_deg=1.0, roll_deg=6.0, contact=(0.0, 0.0), source="given")
    foot = np.array([0.0, -0.1, -1.0]) / np.hypot(0.1, 1.0)
    below = ground_below(seen, np.eye(3), ground, foot, 0.2)
    depth_deg = np.degrees(np.arcsin(-pixel_directions(64) @ ground.up))
    assert not below[depth_deg < BEGINS_DEG].any()
    assert not below[seen[..., 3] == 1].any()
    open_here = (depth_deg > FULL_DEG + 0.1) & (seen[..., 3] == 0)
    expected = np.broadcast_to([*(WEIGHT * np.array([0.4, 0.5, 0.2])), WEIGHT], below[open_here].shape)
    np.testing.assert_allclose(below[open_here], expected, rtol=1e-4)
    assert ground_below(seen, np.eye(3), ground, np.array([0.0, 1.0, 0.0]), 0.2) is None  # it would float
    assert ground_below(0.5 * seen, np.eye(3), ground, foot, 0.2) is None  # nothing sure is seen


@pytest.mark.parametrize("background", ["transparent", "white", "flaws"])
def test_cut_outs_are_estimated_as_they_were(background):
    photo, mask = room_photo(smooth_map())
    rng = np.random.default_rng(1)
    photo[mask == 0] = 250
    if background == "flaws":  # as of JPEG around the object
        photo[40:52] = np.clip(photo[40:52] + rng.integers(-60, 6, (12, *photo.shape[1:])), 0, 255)
    if background == "transparent":
        photo[mask == 0] = rng.integers(0, 255, (int((mask == 0).sum()), 3))
        photo, mask = np.dstack([photo, mask]), None
    auto = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG)
    alone = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, surroundings="none")
    np.testing.assert_array_equal(auto.radiance, alone.radiance)
    np.testing.assert_array_equal(auto.confidence, alone.confidence)
    assert "surroundings" not in auto.info["hints"]


def test_words_in_place_of_a_panorama():
    photo, mask = on_a_table()
    given = {"mask": mask, "fov_deg": FOV_DEG}
    assert load_photo(photo, **given, surroundings="auto").ground == load_photo(photo, **given).ground is not None
    assert load_photo(photo, **given, surroundings="photo").ground is None
    assert crop_object(load_photo(photo, **given, surroundings="photo")).surroundings_map is not None
    assert crop_object(load_photo(photo, **given, surroundings="none")).surroundings_map is None


def test_the_papers_chain_goes_without_what_nobody_asked_for():
    photo, mask = on_a_table()
    light = anyprobe.estimate(photo, mask=mask, fov_deg=FOV_DEG, model="paper")
    assert "surroundings" not in light.info["hints"]

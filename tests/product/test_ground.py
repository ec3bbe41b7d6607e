"""The ground: a camera's pitch and roll as a direction, what is given, and what is guessed."""

from __future__ import annotations

import numpy as np
import pytest
from support.refused import refused

from anyprobe.core.frames import rotation_x, rotation_z
from anyprobe.estimate.ground import LEAST_SLOPE_DEG, Ground, estimate_ground, up_of
from anyprobe.estimate.photo import load_photo


@pytest.fixture
def photo(photo_rgba):
    return load_photo(photo_rgba, fov_deg=60.0)


def test_up_is_the_world_s_in_a_camera_that_looks_down_and_is_turned():
    for pitch, roll in ((0.0, 0.0), (30.0, 0.0), (20.0, 10.0), (-15.0, -8.0)):
        world_from_camera = rotation_x(-np.radians(pitch)) @ rotation_z(np.radians(roll))
        np.testing.assert_allclose(up_of(pitch, roll), world_from_camera.T @ [0, 1, 0], atol=1e-12)


def test_what_is_given_is_taken(photo):
    ground = estimate_ground(photo, pitch_deg=31.0, roll_deg=-4.0)
    assert (ground.pitch_deg, ground.roll_deg, ground.source) == (31.0, -4.0, "given")
    assert ground.pitch_error_deg < estimate_ground(photo).pitch_error_deg


def test_a_guessed_camera_sees_the_ground_at_the_object_s_base(photo):
    for rows in (0, 40, -40):
        mask = np.roll(photo.mask, rows, axis=0) if rows else photo.mask
        moved = load_photo(photo.rgb, mask=(255 * mask).astype(np.uint8), fov_deg=60.0)
        ground = estimate_ground(moved)
        height, width = mask.shape
        focal = width / 2 / np.tan(np.radians(30.0))
        below = np.degrees(np.arctan2(ground.contact[1] - height / 2, focal))
        assert below + ground.pitch_deg >= LEAST_SLOPE_DEG - 1e-6
        assert ground.source == "guessed"


def test_a_pitch_that_no_camera_over_a_ground_has_is_refused(photo):
    with refused("pitch_deg"):
        estimate_ground(photo, pitch_deg=120.0)
    with refused("roll_deg"):
        estimate_ground(photo, roll_deg=90.0)


def test_a_ground_that_says_the_lens_as_older_ones_did_is_read(photo):
    ground = estimate_ground(photo, pitch_deg=20.0)
    assert Ground.of(ground.info() | {"long_fov_deg": 50.0}) == Ground.of(ground.info())

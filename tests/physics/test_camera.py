"""The pinhole camera: rays and pixels are inverse, spheres are stretched, and a photo lies where its camera looked."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.camera import ASSUMED_LONG_FOV_DEG, MOST_STRETCH, PinholeCamera, draw_on_sphere
from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import pixel_directions

CAMERA = PinholeCamera.of_fov(300, 200, 80.0)


def test_rays_and_pixels_are_inverse_and_the_longer_side_takes_in_the_angle():
    x, y = np.meshgrid([0.0, 12.5, 300.0], [0.0, 99.0, 200.0])
    rays = CAMERA.rays(x, y)
    np.testing.assert_allclose(CAMERA.pixels(3 * rays), np.stack([x, y], axis=-1), atol=1e-9)
    left, right = CAMERA.ray((0, 100)), CAMERA.ray((300, 100))
    assert np.degrees(np.arccos(left @ right)) == pytest.approx(80.0)
    assert PinholeCamera.of_fov(200, 300, 80.0).focal == CAMERA.focal
    assert CAMERA.long_fov_deg == pytest.approx(80.0)


def test_a_small_sphere_is_longer_than_wide_by_what_is_said():
    x, y = 280.0, 150.0
    axis = CAMERA.ray((x, y))
    side = np.cross(axis, [0.0, 0.0, -1.0])
    side /= np.linalg.norm(side)
    radial = np.cross(side, axis)
    rim = [
        CAMERA.pixels(axis * np.cos(1e-3) + np.sin(1e-3) * (np.cos(t) * side + np.sin(t) * radial))
        for t in np.linspace(0, np.pi, 181)
    ]
    reach = np.linalg.norm(np.array(rim) - [x, y], axis=-1)
    assert reach.max() / reach.min() == pytest.approx(CAMERA.stretch(x, y), rel=1e-3)
    assert CAMERA.stretch(150, 100) == 1.0


def test_the_assumed_lens_is_off_by_as_little_as_any_for_training_cameras():
    half = np.tan(np.radians([45, ASSUMED_LONG_FOV_DEG, 80]) / 2)
    worst, least = max(half[1] / half[0], half[2] / half[1]), np.sqrt(half[2] / half[0])
    assert worst < 1.46
    assert worst < 1.03 * least
    assert MOST_STRETCH > 1


def test_a_photo_fills_the_map_where_its_camera_looked():
    """Each direction shows its own pixel; outside there is nothing."""
    turn = rotation_y(0.4)
    y, x = np.mgrid[:200, :300] + 0.5
    rays = CAMERA.rays(x, y)
    drawn, inside = draw_on_sphere(rays.astype(np.float32), CAMERA, turn, 128)
    d = pixel_directions(128) @ turn
    assert 0.05 < inside.mean() < 0.2
    assert not drawn[~inside].any()
    away = inside & CAMERA.shows(d) & (np.abs(d[..., 0] / d[..., 2]) < 0.8) & (np.abs(d[..., 1] / d[..., 2]) < 0.5)
    np.testing.assert_allclose(drawn[away], d[away] / -d[away][:, 2:], atol=0.01)

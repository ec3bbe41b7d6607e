"""Points that look themselves up in reflectance maps, against the same points shaded one by one."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS, shade
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object, see
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.reflectance import radiance_by_maps

HEIGHT = 64
ROTATION = world_from_camera(2.1, 0.4)
METAL = (np.zeros(3), np.array([1.0, 0.8, 0.4]))
PLASTIC = (np.array([0.6, 0.3, 0.1]), np.full(3, 0.04))


def unit_sphere(fov_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """n, wo [P, 3] of a sphere that takes in an angle of fov_deg, world frame."""
    surface = see(sphere(), frame_object(sphere(), ROTATION, fov_deg=fov_deg, size=48))
    turn = ROTATION.T.astype(np.float32)
    return surface.normals @ turn, surface.wo @ turn


def sky_and_sun() -> np.ndarray:
    d = pixel_directions(HEIGHT)
    radiance = (1 + 0.6 * d[..., 1:2]) * np.array([0.7, 1.0, 1.4]) + 0.3 * d[..., :1]
    row, column = 20, 75
    radiance[row : row + 2, column : column + 2] += 2.0 / float(pixel_solid_angles(HEIGHT)[row, 0])
    return radiance.astype(np.float32)


def error(radiance, colours, alpha, fov_deg, size=32) -> float:
    """RMSE of looking up / mean of shading every point."""
    albedo, f0 = colours
    material = Material(albedo=albedo.astype(np.float32), f0=f0.astype(np.float32), alpha=alpha)
    n, wo = unit_sphere(fov_deg)
    u, pyramid = hammersley(256), build_pyramid(radiance, emitters=NUM_EMITTERS)
    exact = shade(pyramid, n, wo, alpha, u).radiance(material)
    found = radiance_by_maps(pyramid, n, wo, material, u, u if albedo.any() else None, size=size)
    return float(np.sqrt(np.mean((found - exact) ** 2)) / np.mean(exact))


@pytest.mark.ci
@pytest.mark.parametrize("colours", [METAL, PLASTIC], ids=["metal", "plastic"])
@pytest.mark.parametrize("alpha", [0.3, 0.5, 1.0])
def test_near_sphere_under_a_sun_is_another_picture(alpha, colours):
    """30 degrees across; without the albedos of the points' own views a metal errs by 1.5 to 7 %."""
    assert error(sky_and_sun(), colours, alpha, fov_deg=30.0) < 0.009


@pytest.mark.ci
@pytest.mark.parametrize("colours", [METAL, PLASTIC], ids=["metal", "plastic"])
@pytest.mark.parametrize("alpha", [0.1, 0.5, 1.0])
def test_even_light_shows_where_the_camera_stands(alpha, colours):
    """Nothing but the albedo is left, and that is known for every view."""
    assert error(np.ones((HEIGHT, 2 * HEIGHT, 3), np.float32), colours, alpha, fov_deg=45.0) < 0.01


@pytest.mark.ci
def test_far_sphere_needs_what_a_near_one_needs():
    """Seen straight on, all that is lost is what lies between the maps' pixels."""
    near, far = (error(sky_and_sun(), METAL, 0.5, fov_deg=fov, size=64) for fov in (45.0, 2.0))
    assert far < 0.005
    assert far < near / 3

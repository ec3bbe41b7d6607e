"""Pictures of meshes: a small sun sends as much light wherever it stands, and none to a face that it does not meet."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.photo import Photo
from anyprobe.light.environment import integral, reduced
from anyprobe.relight.appearance import material_from_photo
from anyprobe.render.mesh import make_mesh
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.spheres import silver, sphere_normals
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import Material

HEIGHT = 1024
RADIUS_DEG = 0.53
"""Twice the sun's in half the rows of a common map: as many pixels, of one brightness, more than there are emitters."""


@pytest.fixture(scope="module")
def suns() -> list[np.ndarray]:
    """Suns of irradiance 3 in front of a dim sky, half a degree apart: within and between what a pyramid reads."""
    d = pixel_directions(HEIGHT)
    maps = []
    for turn in np.radians([30.0, 30.41, 30.87, 31.3]):
        toward = np.array([np.sin(turn) * 0.9, 0.43, np.cos(turn) * 0.9])
        sun = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
        sun[d @ (toward / np.linalg.norm(toward)) > np.cos(np.radians(RADIUS_DEG))] = 1.0
        maps.append(0.05 + sun * np.float32(3.0) / integral(sun))
    return maps


@pytest.mark.ci
@pytest.mark.parametrize("alpha", [0.05, 0.15, 0.5])
def test_glint_of_a_drawn_sphere_is_as_strong_wherever_the_sun_stands(suns, alpha):
    """Its sum over the sphere does not depend on half a degree; at alpha 0.05 emitters are pixels, else patches."""
    unit_sphere = sphere(32)
    camera = frame_object(unit_sphere, np.eye(3), 20.0, size=48)
    material = Material(albedo=np.zeros(3), f0=np.full(3, 0.9), alpha=alpha)
    sums = [luminance(draw_mesh(unit_sphere, camera, sun, material)[..., :3]).sum() for sun in suns]
    np.testing.assert_allclose(sums, np.mean(sums), rtol=0.03)


@pytest.mark.ci
def test_silver_sphere_is_as_bright_wherever_the_sun_stands(suns):
    """And in however many rows."""
    sums = [luminance(silver(light)).sum() for sun in suns for light in (sun, reduced(sun, 64))]
    np.testing.assert_allclose(sums, np.mean(sums), rtol=0.03)


@pytest.mark.ci
def test_material_is_found_under_a_large_map(suns):
    """A photo of a sphere of paper under the sun: its albedo, told apart from the light's strength."""
    n, mask = sphere_normals(48)
    unit_sphere = sphere(64)
    paper = Material(albedo=np.array([0.6, 0.3, 0.1]), f0=np.full(3, 0.045), alpha=0.8)
    for sun in suns[:2]:
        picture = draw_mesh(unit_sphere, frame_object(unit_sphere, np.eye(3), 8.0, margin=1.0, size=48), sun, paper)
        photo = Photo(
            rgb=response(picture[..., :3]).astype(np.float32),
            mask=(mask & (picture[..., 3] == 1)).astype(np.float32),
            long_fov_deg=8.0,
            fov_source="given",
            name="sphere",
            warnings=(),
        )
        found = material_from_photo(photo, sun)
        np.testing.assert_allclose(found.albedo, paper.albedo, rtol=0.15)


@pytest.mark.ci
@pytest.mark.parametrize("alpha", [0.05, 0.5])
def test_a_crease_mirrors_only_what_its_faces_do(alpha):
    """Two faces at right angles, of which neither mirrors the light behind the camera; the mean of both would."""
    corners = np.array([[-1, -1, 0], [0, -1, 1], [1, -1, 0], [-1, 1, 0], [0, 1, 1], [1, 1, 0]], np.float64)
    ridge = make_mesh(corners, np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]]))
    light = 0.1 + 50.0 * (pixel_directions(64)[..., 2:] > 0.98) * np.ones(3)
    metal = Material(albedo=np.zeros(3), f0=np.full(3, 0.9), alpha=alpha)
    camera = frame_object(ridge, np.eye(3), 20.0, size=65)
    picture = draw_mesh(ridge, camera, light, metal)
    inside = picture[picture[..., 3] > 0.5][:, 0]
    faces = np.quantile(inside, 0.9)
    assert inside.max() < 1.5 * faces

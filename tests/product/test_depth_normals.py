"""Depth gives normals: of planes and spheres in closed form, none where nothing reliable is known."""

import numpy as np
import pytest
from support.refused import refused

from anyprobe import load_photo
from anyprobe.core.frames import normalize
from anyprobe.errors import InvalidMask
from anyprobe.estimate import depth_normals
from anyprobe.estimate.depth_normals import normals_from_depth

FOV_DEG, HEIGHT, WIDTH = 50.0, 120, 160
MASK = np.zeros((HEIGHT, WIDTH), np.float32)
MASK[20:100, 30:120] = 1.0


def rays(height=HEIGHT, width=WIDTH):
    """Through every pixel, as long as they reach depth 1."""
    focal = width / 2 / np.tan(np.radians(FOV_DEG) / 2)
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5)
    return np.stack([x / focal, y / focal, -np.ones_like(x)], axis=-1)


def plane(normal, distance=3.0, **size):
    """Depth [H, W] of a plane that the camera's axis meets at this distance."""
    return distance * normal[2] / -(rays(**size) @ normal)


def sphere(centre, radius, **size):
    """Depth, NaN beside it, and normals [H, W, 3] of a sphere."""
    d = rays(**size)
    a, b, c = (d * d).sum(axis=-1), d @ centre, centre @ centre - radius**2
    inside = b * b - a * c
    depth = (b - np.sqrt(np.where(inside > 0, inside, np.nan))) / a
    return depth, (depth[..., None] * d - centre) / radius


def angles(found, true):
    known = found.any(axis=-1)
    return known, np.degrees(np.arccos(np.clip((found[known] * true[known]).sum(axis=-1), -1, 1)))


CENTRE = np.array([0.3, -0.2, -4.0])


@pytest.mark.parametrize("normal", [(0.1, 0.0, 1.0), (0.6, 0.3, 0.7), (-0.5, 0.7, 0.5)])
def test_a_tilted_plane_has_its_normal_everywhere(normal):
    normal = normalize(np.array(normal))
    found = normals_from_depth(plane(normal).astype(np.float32), MASK, FOV_DEG).normals
    known, error = angles(found, np.broadcast_to(normal, found.shape))
    assert error.max() < 0.1
    assert known[25:95, 35:115].all()
    assert not known[MASK < 0.5].any()


@pytest.mark.parametrize("double", [1, 2])  # depth of the photo's size, and twice as fine
def test_a_sphere_has_its_normals(double):
    depth, _ = sphere(CENTRE, 1.0, height=HEIGHT * double, width=WIDTH * double)
    depth1, true = sphere(CENTRE, 1.0)
    mask = np.isfinite(depth1).astype(np.float32)
    known, error = angles(normals_from_depth(depth, mask, FOV_DEG).normals, true)
    assert (np.median(error) < 0.5, np.percentile(error, 95) < 1.0 * double) == (True, True)
    assert known.sum() > 0.8 * mask.sum()


@pytest.mark.ci
def test_large_depth_images_are_averaged():
    depth, true = sphere(CENTRE, 1.0, height=1200, width=1600)
    found = normals_from_depth(depth, np.isfinite(depth).astype(np.float32), FOV_DEG).normals
    _, error = angles(found, true)
    assert np.percentile(error, 95) < 1.0


@pytest.mark.parametrize("scale", [1e-3, 1000.0])
def test_the_unit_of_depth_changes_nothing(scale):
    depth, _ = sphere(CENTRE, 1.0)
    mask = np.isfinite(depth).astype(np.float32)
    one, other = (normals_from_depth(depth * by, mask, FOV_DEG).normals for by in (1.0, scale))
    np.testing.assert_allclose(one, other, atol=1e-3)


def test_holes_and_edges_are_not_known():
    depth = plane(normalize(np.array([0.3, 0.1, 1.0])))
    depth[50:60, 60:70] = 0.0
    depth[70:, :] *= 0.8  # another surface in front
    found = normals_from_depth(depth, MASK, FOV_DEG).normals
    assert not found[50:60, 60:70].any()
    assert not found[69:71].any()
    assert found[40, 40].any()
    assert found[90, 90].any()


def test_noise_widens_the_window(monkeypatch):
    depth, true = sphere(CENTRE, 1.0)
    depth = depth * (1 + 0.003 * np.random.default_rng(1).standard_normal(depth.shape))
    mask = np.isfinite(depth).astype(np.float32)
    known, error = angles(normals_from_depth(depth, mask, FOV_DEG).normals, true)
    monkeypatch.setattr(depth_normals, "WIDEST", 0.0)  # the narrowest window, whatever the noise
    narrow = normals_from_depth(depth, mask, FOV_DEG).normals
    assert narrow is None or np.median(error) < 0.5 * np.median(angles(narrow, true)[1])
    assert np.median(error) < 8.0
    assert known.sum() > 0.5 * mask.sum()


def photo_of(depth, **more):
    rgb = np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    return load_photo(rgb, mask=MASK, depth=depth, surroundings="none", **more)


def test_a_photo_has_the_normals_of_its_depth():
    normal = normalize(np.array([0.3, 0.1, 1.0]))
    photo = photo_of(plane(normal), fov_deg=FOV_DEG)
    np.testing.assert_allclose(photo.normals.values[60, 70], normal, atol=1e-3)
    assert photo.mask_source == "mask"
    assert not any("normals" in line for line in photo.warnings)


def test_an_assumed_lens_comes_with_a_warning():
    assert any(line.code == "assumed-lens" for line in photo_of(plane(normalize(np.array([0.3, 0.1, 1.0])))).warnings)


def test_given_normals_count_before_those_of_depth():
    given = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    given[..., 2] = 1.0
    photo = photo_of(plane(normalize(np.array([0.6, 0.1, 1.0]))), normals=given, fov_deg=FOV_DEG)
    np.testing.assert_array_equal(photo.normals.values[60, 70], [0, 0, 1])


NOISE = np.random.default_rng(2).standard_normal((HEIGHT, WIDTH))
BALL, _ = sphere(np.array([-0.1, 0.0, -4.0]), 1.4)
DOUBTS = {
    "noise": (3.0 + 0.45 * NOISE, "too coarse, noisy or incomplete"),
    "coarse steps": (np.round(plane(normalize(np.array([0.6, 0.3, 1.0])))), "too coarse, noisy or incomplete"),
    "inverse depth": (1.0 / np.nan_to_num(BALL, nan=1e9), "hollow"),
    "nothing": (np.zeros((HEIGHT, WIDTH)), "measured nowhere"),
}


@pytest.mark.parametrize("name", DOUBTS)
def test_depth_that_is_worse_than_a_guess_is_left_with_one_warning(name):
    depth, word = DOUBTS[name]
    photo = photo_of(depth, fov_deg=FOV_DEG)
    assert photo.normals is None
    assert sum(word in line for line in photo.warnings) == 1


def test_depth_of_another_view_is_refused():
    with refused("depth", kind=InvalidMask):
        photo_of(np.ones((100, 100)))

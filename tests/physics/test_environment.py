"""Whole maps: checks, sizes, rotations, integrals."""

import numpy as np
import pytest

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.light.environment import SEARCH_ROWS, integral, reduced, rotate


@pytest.fixture
def noise():
    return np.random.default_rng(0).random((32, 64, 3)).astype(np.float32)


def lobe(centre, height=32, sharpness=60.0):
    """A grey lobe exp(sharpness (cos - 1)) around a direction."""
    cosine = pixel_directions(height) @ np.asarray(centre, np.float32)
    return np.repeat(np.exp(sharpness * (cosine - 1))[..., None], 3, axis=2)


def brightest(radiance):
    height = radiance.shape[0]
    return pixel_directions(height).reshape(-1, 3)[np.argmax(radiance[..., 0])]


def test_integral_of_one_is_not_the_sphere():
    np.testing.assert_allclose(integral(np.ones((64, 128, 3), np.float32)), 4 * np.pi, rtol=1e-5)


def test_integral_counts_rows_alike():
    """The upper 60 degrees of latitude band hold 2 pi (1 - cos 30)."""
    cap = np.zeros((12, 24, 3), np.float32)
    cap[:2] = 1
    np.testing.assert_allclose(integral(cap), 2 * np.pi * (1 - np.cos(np.pi / 6)), rtol=1e-5)


@pytest.mark.parametrize("height", [16, 8, 2])
def test_shrinking_loses_light(noise, height):
    small = reduced(noise, height)
    assert small.shape == (height, 2 * height, 3)
    assert small.dtype == np.float32
    np.testing.assert_allclose(integral(small), integral(noise), rtol=1e-5)


def test_shrinking_mixes_neighbouring_blocks():
    ramp = np.repeat(np.arange(64.0)[None, :, None], 32, axis=0).repeat(3, axis=2)
    np.testing.assert_allclose(reduced(ramp, 16)[5, :, 0], np.arange(32) * 2 + 0.5)


@pytest.mark.parametrize(
    ("rotation", "moved"),
    [
        (rotation_y(np.pi / 2), (-1, 0, 0)),
        (rotation_x(np.pi / 2), (0, 1, 0)),
        (rotation_y(0.4) @ rotation_x(0.3) @ rotation_z(0.9), None),
    ],
)
def test_light_moves_against_the_rotation(rotation, moved):
    """A lobe on -Z is seen at rotation @ -Z; the transpose would send it to the other side."""
    target = rotation @ [0, 0, -1]
    if moved is not None:
        np.testing.assert_allclose(target, moved, atol=1e-12)
    assert brightest(rotate(lobe((0, 0, -1)), rotation)) @ target > np.cos(np.radians(5))


def test_quarter_turn_is_not_a_roll(noise):
    """About +Y by 90 degrees: what was ahead (centre) is on the left (u = 0.25), to the pixel."""
    np.testing.assert_allclose(rotate(noise, rotation_y(np.pi / 2)), np.roll(noise, -16, axis=1), atol=2e-5)


def test_rotation_does_not_compose():
    """rotate(R1) then rotate(R2) is rotate(R2 R1)."""
    smooth = lobe((0.6, 0.48, -0.64), 64, 4.0) + lobe((-0.8, 0.0, 0.6), 64, 6.0)
    first, second = rotation_y(0.7), rotation_x(-0.5) @ rotation_z(0.3)
    once = rotate(smooth, second @ first)
    np.testing.assert_allclose(rotate(rotate(smooth, first), second), once, atol=0.015)


def test_rotated_map_and_direction_disagree():
    """The map turned by R, read at R d, is the map read at d."""
    smooth, rotation = lobe((0.6, 0.48, -0.64), 64, 4.0), rotation_y(1.1) @ rotation_x(0.8)
    d = pixel_directions(7).reshape(-1, 3)
    turned = bilinear(rotate(smooth, rotation), direction_to_uv(d @ rotation.T))
    np.testing.assert_allclose(turned, bilinear(smooth, direction_to_uv(d)), atol=0.01)


def test_rotation_keeps_the_light():
    smooth = lobe((0.6, 0.48, -0.64), 64, 4.0)
    turned = rotate(smooth, rotation_x(1.0) @ rotation_y(0.5))
    np.testing.assert_allclose(integral(turned), integral(smooth), rtol=5e-3)


def test_torch_maps_differ(noise):
    torch = pytest.importorskip("torch", reason="torch is an extra")
    tensor, rotation = torch.asarray(noise), rotation_y(0.3) @ rotation_x(0.2)
    np.testing.assert_allclose(rotate(tensor, rotation).numpy(), rotate(noise, rotation), atol=1e-6)
    np.testing.assert_allclose(integral(tensor).numpy(), integral(noise), rtol=1e-5)


@pytest.mark.parametrize("height", [150, 257, 512])
def test_a_reduced_map_has_another_integral(height):
    """Whole or broken pixels become one; what is even stays even."""
    radiance = np.random.default_rng(1).random((height, 2 * height, 3)).astype(np.float32)
    small = reduced(radiance)
    assert small.shape == (SEARCH_ROWS, 2 * SEARCH_ROWS, 3)
    np.testing.assert_allclose(integral(small), integral(radiance), rtol=2e-4)
    np.testing.assert_allclose(reduced(np.full_like(radiance, 0.3)), 0.3, rtol=1e-5)

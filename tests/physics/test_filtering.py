"""Zonal blurs against closed forms and the direct sum."""

import numpy as np
import pytest

from anyprobe.core.frames import rotation_x
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.light.environment import rotate
from anyprobe.light.filtering import blur_cap, blur_cosine_power, irradiance_map


@pytest.fixture
def noise():
    return np.random.default_rng(0).random((8, 16, 3)).astype(np.float32)


def direct_sum(radiance, weight, normalised=True):
    """Every pixel against every pixel: sum of weight(cos) L dw, over the sum of weights or not."""
    height = radiance.shape[0]
    d = pixel_directions(height).reshape(-1, 3).astype(np.float64)
    solid_angles = np.repeat(pixel_solid_angles(height), 2 * height, axis=1).reshape(-1)
    kernel = weight(np.clip(d @ d.T, -1, 1)) * solid_angles
    if normalised:
        kernel = kernel / kernel.sum(axis=1, keepdims=True)
    return (kernel @ radiance.reshape(-1, 3)).reshape(radiance.shape)


@pytest.mark.parametrize("sharpness", [1.0, 8.0, 64.0])
def test_fourier_blur_is_not_the_direct_sum(noise, sharpness):
    expected = direct_sum(noise, lambda c: np.maximum(c, 0) ** sharpness)
    np.testing.assert_allclose(blur_cosine_power(noise, sharpness), expected, rtol=1e-4, atol=1e-6)


def test_fourier_irradiance_is_not_the_direct_sum(noise):
    expected = direct_sum(noise, lambda c: np.maximum(c, 0), normalised=False)
    np.testing.assert_allclose(irradiance_map(noise), expected, rtol=1e-4)


def test_fourier_cap_is_not_the_direct_sum(noise):
    radius = np.radians(40.0)
    expected = direct_sum(noise, lambda c: (c >= np.cos(radius)).astype(float))
    np.testing.assert_allclose(blur_cap(noise, radius), expected, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("sharpness", [0.5, 1.0, 27.0, 1331.0])
def test_blur_changes_a_constant(sharpness):
    constant = np.full((32, 64, 3), 0.7, np.float32)
    np.testing.assert_allclose(blur_cosine_power(constant, sharpness), 0.7, rtol=1e-5)
    np.testing.assert_allclose(blur_cap(constant, 0.3), 0.7, rtol=1e-5)


def test_sharpness_one_is_not_irradiance_over_pi():
    noise = np.random.default_rng(1).random((64, 128, 3)).astype(np.float32)
    np.testing.assert_allclose(blur_cosine_power(noise, 1.0), irradiance_map(noise) / np.pi, rtol=1e-3)


def test_lit_upper_half_lights_the_lower():
    """Radiance 1 above the horizon: E(n) = pi (1 + n_y) / 2, within 0.05 % of pi at 64 rows."""
    upper = np.zeros((64, 128, 3), np.float32)
    upper[:32] = 1
    expected = np.pi * (1 + pixel_directions(64)[..., 1:2]) / 2
    np.testing.assert_allclose(irradiance_map(upper), np.broadcast_to(expected, upper.shape), atol=0.0005 * np.pi)


def test_blur_turns_towards_the_wrong_side():
    """The irradiance of a small emitter is largest where the normal points at it, and 0 behind."""
    for row, column in ((20, 100), (40, 0), (3, 64)):
        emitter = np.zeros((64, 128, 3), np.float32)
        emitter[row, column] = 1
        lit = irradiance_map(emitter)[..., 0]
        cosine = pixel_directions(64) @ pixel_directions(64)[row, column]
        expected = np.maximum(cosine, 0) * pixel_solid_angles(64)[row, 0]
        np.testing.assert_allclose(lit, expected, atol=1e-4 * expected.max() + 1e-9)


def test_blur_knows_where_the_pole_is():
    """Tipping the world before or after the blur is the same, but for resampling."""
    d = pixel_directions(64)
    smooth = np.exp(5 * (d @ np.array([0.6, 0.48, -0.64], np.float32) - 1))[..., None].repeat(3, axis=2)
    tip = rotation_x(1.2)
    before, after = blur_cosine_power(rotate(smooth, tip), 12.0), rotate(blur_cosine_power(smooth, 12.0), tip)
    np.testing.assert_allclose(before, after, atol=0.006)


def test_cap_reaches_beyond_its_radius():
    emitter = np.zeros((64, 128, 3), np.float32)
    emitter[2, 5] = 1
    spread = blur_cap(emitter, np.radians(10.0))[..., 0] > 1e-6
    angle = np.degrees(np.arccos(np.clip(pixel_directions(64) @ pixel_directions(64)[2, 5], -1, 1)))
    assert spread[angle < 9.9].all()
    assert not spread[angle > 10.1].any()


def test_batch_is_mixed_up():
    maps = np.random.default_rng(3).random((2, 3, 8, 16, 3)).astype(np.float32)
    blurred = blur_cosine_power(maps, 4.0)
    assert blurred.dtype == np.float32
    np.testing.assert_allclose(blurred[1, 2], blur_cosine_power(maps[1, 2], 4.0), atol=1e-6)


def test_torch_blur_differs(noise):
    torch = pytest.importorskip("torch", reason="torch is an extra")
    tensor = torch.asarray(noise)
    for blur in (lambda m: blur_cosine_power(m, 5.0), lambda m: blur_cap(m, 0.5), irradiance_map):
        np.testing.assert_allclose(blur(tensor).numpy(), blur(noise), rtol=1e-4, atol=1e-6)


def test_irradiance_reads_at_the_normal():
    """Between pixels too: a smooth map's irradiance by quadrature at any n."""
    d = pixel_directions(64)
    smooth = (1 + d[..., [0, 1, 2]] * 0.5 + d[..., [1, 2, 0]] ** 2).astype(np.float32)
    n = np.array([[0.48, 0.6, 0.64], [-0.8, 0.0, 0.6]])
    cosine = np.maximum(np.einsum("hwc,kc->khw", d, n), 0)
    expected = np.einsum("khw,hwc,h->kc", cosine, smooth, pixel_solid_angles(64)[:, 0])
    np.testing.assert_allclose(bilinear(irradiance_map(smooth), direction_to_uv(n)), expected, rtol=2e-3)

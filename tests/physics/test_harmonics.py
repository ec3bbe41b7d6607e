"""Spherical harmonics: order, signs, normalisation, the cosine lobe."""

import tracemalloc

import numpy as np
import pytest
from support.shading_terms import irradiance

from anyprobe.core.frames import normalize, rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.light.filtering import irradiance_map
from anyprobe.light.harmonics import project, sh_basis


def evaluate(coefficients, d):
    """Radiance of order 2, sum of L_i Y_i(d): [9, 3] and [..., 3] -> [..., 3]."""
    return sh_basis(d) @ coefficients


def directions(count, seed=0):
    return normalize(np.random.default_rng(seed).normal(size=(count, 3)))


def test_uniform_light_has_a_direction():
    """Radiance 1: L_0 = 2 sqrt(pi) = 3.5449077, the rest below 1e-6, E = pi for every normal."""
    coefficients = project(np.ones((64, 128, 3), np.float32))
    assert coefficients.shape == (9, 3)
    np.testing.assert_allclose(coefficients[0], 3.5449077, rtol=1e-6)
    assert np.abs(coefficients[1:]).max() < 1e-6
    np.testing.assert_allclose(irradiance(coefficients, directions(100)), np.pi, rtol=1e-6)
    np.testing.assert_allclose(evaluate(coefficients, directions(100)), 1, rtol=1e-6)


def test_constants_by_table():
    """K and the order of the polynomials, each seen where it alone tells."""
    y = sh_basis(np.array([[0.48, 0.6, 0.64]]))[0]
    x_, y_, z_ = 0.48, 0.6, 0.64
    expected = [
        0.282095,
        0.488603 * y_,
        0.488603 * z_,
        0.488603 * x_,
        1.092548 * x_ * y_,
        1.092548 * y_ * z_,
        0.315392 * (3 * z_**2 - 1),
        1.092548 * x_ * z_,
        0.546274 * (x_**2 - y_**2),
    ]
    np.testing.assert_allclose(y, expected, rtol=2e-6)


def test_basis_is_not_orthonormal():
    d, w = pixel_directions(128).astype(np.float64), pixel_solid_angles(128).astype(np.float64)
    y = sh_basis(d)
    np.testing.assert_allclose(np.einsum("hwi,hwj,h->ij", y, y, w[:, 0]), np.eye(9), atol=2e-4)


@pytest.mark.parametrize("i", range(9))
def test_projection_swaps_or_flips_a_coefficient(i):
    """A map of Y_i has coefficient i alone: project and sh_basis agree on the frame."""
    radiance = np.repeat(sh_basis(pixel_directions(64))[..., i : i + 1], 3, axis=2)
    np.testing.assert_allclose(project(radiance), np.repeat(np.eye(9)[:, i : i + 1], 3, axis=1), atol=1e-3)


def test_evaluate_is_not_the_inverse():
    coefficients = np.random.default_rng(1).normal(size=(9, 3))
    again = project(evaluate(coefficients, pixel_directions(128).astype(np.float64)))
    np.testing.assert_allclose(again, coefficients, atol=1e-3)


def test_irradiance_is_not_the_integral():
    """For light of order 2, E(n) is the cosine integral; the zonal filter is the reference."""
    coefficients = np.random.default_rng(2).normal(size=(9, 3)) * 0.3
    coefficients[0] = 4
    light = evaluate(coefficients, pixel_directions(64).astype(np.float64)).astype(np.float32)
    n = directions(200)
    expected = bilinear(irradiance_map(light), direction_to_uv(n))
    np.testing.assert_allclose(irradiance(coefficients, n), expected, rtol=0.004)


@pytest.mark.parametrize(("axis", "i"), [(0, 3), (1, 1), (2, 2)])
def test_light_on_an_axis_is_seen_on_another(axis, i):
    """Order 1 is the vector (y, z, x) of the light, positive towards it (no Condon-Shortley sign)."""
    emitter = np.exp(30 * (pixel_directions(64)[..., axis : axis + 1] - 1)).repeat(3, axis=2)
    first = project(emitter)[1:4, 0]
    assert first[i - 1] > 0.05
    assert np.abs(np.delete(first, i - 1)).max() < 1e-3 * first[i - 1]


def test_quarter_turn_about_y_mirrors():
    """World turned by R_y(90): the map rolls a quarter to the left and L'(R d) = L(d)."""
    radiance = np.random.default_rng(3).random((16, 32, 3)).astype(np.float32)
    before, after = project(radiance), project(np.roll(radiance, -8, axis=1))
    n, turn = directions(50), rotation_y(np.pi / 2)
    np.testing.assert_allclose(evaluate(after, n @ turn.T), evaluate(before, n), atol=1e-5)
    np.testing.assert_allclose(after[3], before[2], atol=1e-5)  # z goes to x
    np.testing.assert_allclose(after[2], -before[3], atol=1e-5)  # x goes to -z


def test_strong_light_is_clamped_in_silence():
    """Opposite a strong light order 2 is negative; that is for the caller to know and window."""
    sun = np.zeros((64, 128, 3), np.float32)
    sun[10, 30] = 1e4
    opposite = -pixel_directions(64)[10, 30]
    assert (evaluate(project(sun), pixel_directions(16)).min(axis=(0, 1)) < 0).all()
    assert irradiance(project(sun), opposite).shape == (3,)


def test_large_map_is_projected_in_little_memory():
    """Less than a twentieth of the map's own, whose 9 integrals a pixel would take six times as much."""
    radiance = np.ones((1024, 2048, 3), np.float32)
    tracemalloc.start()
    coefficients = project(radiance)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < radiance.nbytes / 20
    np.testing.assert_allclose(coefficients[0], 3.5449077, rtol=1e-6)

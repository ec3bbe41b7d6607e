"""SH in every consumer's layout, by closed forms and by summing pixels."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.shading_terms import irradiance as irradiance_at
from support.two_phase import probe_directions, two_phase

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.export.exported_light import prepare
from anyprobe.export.target_frames import polynomial, unity
from anyprobe.export.targets import export
from anyprobe.light.harmonics import project
from anyprobe.light.light_sources import split_dominant_light

N = probe_directions(60)


def polynomials(n: np.ndarray) -> np.ndarray:
    """1, y, z, x, xy, yz, 3z^2 - 1, xz, x^2 - y^2: [N, 3] -> [N, 9]."""
    x, y, z = n.T
    return np.stack([x * 0 + 1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y], axis=-1)


def true_irradiance(radiance: np.ndarray, n: np.ndarray) -> np.ndarray:
    """E(n) by summing all pixels: [N, 3]."""
    height = radiance.shape[0]
    d = pixel_directions(height).astype(np.float64)
    cosine = np.maximum(np.einsum("nc,hwc->nhw", n, d), 0) * pixel_solid_angles(height)
    return np.einsum("nhw,hwc->nc", cosine, radiance)


def test_uniform_radiance():
    light = prepare(np.ones((32, 64, 3), np.float32), "even")
    np.testing.assert_allclose(light.sh_full[0], 3.5449077, rtol=1e-6)
    np.testing.assert_allclose(light.sh_full[1:], 0, atol=1e-6)
    np.testing.assert_allclose(irradiance_at(light.sh_full, N.astype(np.float32)), np.pi, rtol=1e-5)
    np.testing.assert_allclose(unity(light.sh_full)[:, 0], 1, rtol=1e-6)
    np.testing.assert_allclose(unity(light.sh_full)[:, 1:], 0, atol=1e-6)


def test_prefiltered_polynomial_is_not_irradiance_over_pi():
    sh = project(two_phase())
    wanted = irradiance_at(sh, N.astype(np.float32)) / np.pi
    np.testing.assert_allclose(polynomials(N) @ polynomial(sh), wanted, atol=1e-6)


def test_unity_is_mirrored():
    """In Unity's left-handed axes the same irradiance at the same normal."""
    sh = project(two_phase())
    there = N * (1, 1, -1)
    np.testing.assert_allclose(
        polynomials(there) @ unity(sh).T, irradiance_at(sh, N.astype(np.float32)) / np.pi, atol=1e-6
    )


def room_with_emitter(rng: np.random.Generator) -> np.ndarray:
    d = pixel_directions(64)
    radiance = 0.3 + 0.2 * d[..., 1:2] + 0.02 * rng.random((64, 128, 3), np.float32)
    emitter = d @ normalize(np.array([0.5, 0.6, 0.4], np.float32)) > np.cos(0.1)
    radiance[emitter] += (20, 16, 10)
    return radiance.astype(np.float32)


def test_full_is_not_ambient_plus_dominant_light(rng):
    radiance = room_with_emitter(rng)
    main, ambient = split_dominant_light(radiance)
    facing = main.direction[None].astype(np.float64)
    left = true_irradiance(radiance, facing) - true_irradiance(ambient, facing)
    np.testing.assert_allclose(left[0], main.irradiance, rtol=3e-3)
    whole = N[N @ facing[0] > 0.25]  # the emitter stands above these planes' horizon
    left = true_irradiance(radiance, whole) - true_irradiance(ambient, whole)
    np.testing.assert_allclose(left, (whole @ facing[0])[:, None] * main.irradiance, rtol=0.02)


def test_ambient_keeps_what_is_not_the_dominant_light(rng):
    """Nothing below zero, nothing outside the emitter touched, an even map left alone."""
    radiance = room_with_emitter(rng)
    main, ambient = split_dominant_light(radiance)
    assert ambient.min() >= 0
    assert ambient.max() < 1
    away = pixel_directions(64) @ main.direction < np.cos(0.4)
    np.testing.assert_array_equal(ambient[away], radiance[away])
    even = np.full((16, 32, 3), 0.5, np.float32)
    none, same = split_dominant_light(even)
    assert none.irradiance.tolist() == [0, 0, 0]
    np.testing.assert_array_equal(same, even)


def test_webxr_holds_an_estimate_and_all_sources(tmp_path, rng):
    radiance = room_with_emitter(rng)
    said = json.loads(export(radiance, "webxr", tmp_path)[0].read_text())
    main, ambient = split_dominant_light(radiance)
    coefficients = project(ambient).ravel()
    np.testing.assert_allclose(said["sphericalHarmonicsCoefficients"], coefficients, rtol=1e-5, atol=1e-5)
    assert said["primaryLightDirection"]["w"] == 0
    assert said["primaryLightIntensity"]["w"] == 1
    assert said["primaryLightIntensity"]["y"] == pytest.approx(main.irradiance[1], rel=1e-5)
    assert set(said["sources"][0]) == {"direction", "irradiance", "angle_deg"}


def test_sidecar_holds_both_sets(tmp_path, rng):
    radiance = room_with_emitter(rng)
    said = json.loads(next(p for p in export(radiance, "unity", tmp_path) if p.suffix == ".json").read_text())
    np.testing.assert_allclose(said["sh"]["full"], project(radiance).ravel(), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(
        said["sh"]["ambient"], project(split_dominant_light(radiance)[1]).ravel(), rtol=1e-5, atol=1e-6
    )
    given = np.reshape(said["unity"]["sh_ambient"], (3, 9))
    np.testing.assert_allclose(given, unity(project(split_dominant_light(radiance)[1])), rtol=1e-5, atol=1e-6)
    direction = said["unity"]["light_direction"]
    assert direction[2] == -said["primaryLightDirection"]["z"]

"""The brightest pixels taken out of the pyramid and added exactly: nothing lost, nothing twice."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import integral
from anyprobe.light.octahedral import build_pyramid, lookup
from anyprobe.render.integrate import NUM_LAMPS, shade
from anyprobe.scatter.brdf import Material, evaluate
from anyprobe.scatter.microfacet import ggx_distribution

HEIGHT = 64


def sunny(rng: np.random.Generator) -> np.ndarray:
    """A soft sky of mean 1 and a sun of four pixels, as bright as the sky together."""
    d = pixel_directions(HEIGHT)
    radiance = (1 + 0.5 * d[..., 1:2]) * np.array([0.8, 1.0, 1.3])
    row, column = int(rng.integers(8, 40)), int(rng.integers(0, 2 * HEIGHT - 1))
    sun = 4 * np.pi / (4 * float(pixel_solid_angles(HEIGHT)[row, 0]))
    radiance[row : row + 2, column : column + 2] += sun * np.array([1.0, 0.9, 0.7])
    return radiance.astype(np.float32)


def points(rng: np.random.Generator, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    n = normalize(rng.normal(size=(count, 3))).astype(np.float32)
    wo = normalize(n + 0.7 * normalize(rng.normal(size=(count, 3)))).astype(np.float32)
    return n, wo


def sum_over_pixels(radiance: np.ndarray, material: Material, n, wo) -> np.ndarray:
    """Eq. 3 as the plain sum over every pixel's centre."""
    wi = pixel_directions(HEIGHT).reshape(1, -1, 3)
    weights = np.repeat(pixel_solid_angles(HEIGHT), 2 * HEIGHT, axis=1).reshape(-1, 1)
    light = radiance.reshape(-1, 3) * weights
    rows = []
    for one, toward in zip(n, wo, strict=True):
        f = evaluate(material, toward[None, None], wi, one[None, None])[0]
        rows.append((f * np.clip(wi[0] @ one, 0, None)[:, None] * light).sum(axis=0))
    return np.array(rows)


def test_no_light_is_lost_or_doubled(rng):
    radiance = sunny(rng)
    pyramid = build_pyramid(radiance, lamps=NUM_LAMPS)
    d = pixel_directions(HEIGHT)
    rest = lookup(pyramid, d, np.zeros(d.shape[:2], np.float32))
    assert luminance(rest).max() < 3.0  # the sun is gone
    np.testing.assert_allclose(
        integral(rest) + pyramid.lamp_flux.sum(axis=0), integral(radiance), rtol=2e-3, atol=0
    )


def test_lamps_stand_where_the_sun_is(rng):
    radiance = sunny(rng)
    row, column = np.unravel_index(luminance(radiance).argmax(), radiance.shape[:2])
    pyramid = build_pyramid(radiance, lamps=NUM_LAMPS)
    strongest = pyramid.lamps[luminance(pyramid.lamp_flux).argmax()]
    assert strongest @ pixel_directions(HEIGHT)[row, column] > np.cos(np.radians(5.0))
    np.testing.assert_allclose(np.linalg.norm(pyramid.lamps, axis=1), 1.0, atol=1e-5)


def test_a_constant_map_has_lamps_without_light():
    pyramid = build_pyramid(np.ones((HEIGHT, 2 * HEIGHT, 3), np.float32), lamps=NUM_LAMPS)
    assert np.abs(pyramid.lamp_flux).max() == 0.0


@pytest.mark.parametrize(("alpha", "f0"), [(0.15, 0.5), (0.5, 0.5), (1.0, 0.5), (0.5, 0.0)])
def test_sixty_four_samples_render_a_sun(rng, alpha, f0):
    """Against the sum over all pixels: a few percent with lamps, far off without."""
    radiance, (n, wo) = sunny(rng), points(rng)
    albedo = np.array([0.5, 0.3, 0.2]) if f0 else np.zeros(3)  # f0 0: grazing reflection alone
    material = Material(albedo=albedo, f0=f0 * np.array([0.6, 1.0, 1.4]), alpha=alpha)
    truth = sum_over_pixels(radiance, material, n, wo)

    def error(lamps: int) -> float:
        shading = shade(build_pyramid(radiance, lamps=lamps), n, wo, alpha, hammersley(64))
        return float(np.sqrt(((shading.radiance(material) - truth) ** 2).mean()) / truth.mean())

    assert error(NUM_LAMPS) < (0.035 if f0 else 0.1)
    assert error(0) > 4 * error(NUM_LAMPS)


@pytest.mark.parametrize("alpha", [0.3, 0.7, 1.0])
def test_irradiance_is_the_mean_under_the_samples_density(rng, alpha):
    """Eq. 5 in the limit: the map's mean weighted by pdf(wi) = D (n.h) / (4 wo.h) above the horizon."""
    radiance, (n, wo) = sunny(rng), points(rng, 60)
    wi = pixel_directions(HEIGHT).reshape(1, -1, 3)
    h = normalize(wi + wo[:, None])
    n_dot_h = (n[:, None] * h).sum(axis=-1)
    density = ggx_distribution(n_dot_h, alpha) * np.clip(n_dot_h, 0, None) / (wo[:, None] * h).sum(axis=-1)
    density = density * ((n[:, None] * wi).sum(axis=-1) > 0)
    weights = density * np.repeat(pixel_solid_angles(HEIGHT), 2 * HEIGHT, axis=1).reshape(1, -1)
    truth = weights @ radiance.reshape(-1, 3) / weights.sum(axis=1, keepdims=True)
    pyramid = build_pyramid(radiance, lamps=NUM_LAMPS)
    estimate = shade(pyramid, n, wo, alpha, hammersley(1024)).irradiance
    assert np.sqrt(((estimate - truth) ** 2).mean()) / truth.mean() < 0.03

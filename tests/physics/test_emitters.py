"""The brightest pixels taken out of the pyramid and added exactly: nothing lost, nothing twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.pyramids import lookup
from support.shading_terms import brdf

from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import integral
from anyprobe.light.octahedral import WIDENING, build_pyramid
from anyprobe.paper.equations import ggx_distribution
from anyprobe.render.integrate import NUM_EMITTERS, PATCHES, emitters_specular, shade
from anyprobe.scatter.materials import Material

HEIGHT = 64


def sunny(rng: np.random.Generator) -> np.ndarray:
    """A soft sky of mean 1 and a sun of four pixels, as bright as the sky together."""
    d = pixel_directions(HEIGHT)
    radiance = (1 + 0.5 * d[..., 1:2]) * np.array([0.8, 1.0, 1.3])
    row, column = int(rng.integers(8, 40)), int(rng.integers(0, 2 * HEIGHT - 1))
    sun = 4 * np.pi / (4 * float(pixel_solid_angles(HEIGHT)[row, 0]))
    radiance[row : row + 2, column : column + 2] += sun * np.array([1.0, 0.9, 0.7])
    return radiance.astype(np.float32)


def lit_room() -> np.ndarray:
    """Walls of radiance 1 and a square emitter of 5 x 5 pixels, 14 degrees wide, as bright as the walls together."""
    radiance = np.ones((HEIGHT, 2 * HEIGHT, 3), np.float32)
    emitter = np.s_[14:19, 40:45]
    area = 5 * float(pixel_solid_angles(HEIGHT)[14:19].sum())
    radiance[emitter] += 4 * np.pi / area * np.array([1.2, 1.0, 0.7], np.float32)
    return radiance


def points(rng: np.random.Generator, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    n = normalize(rng.normal(size=(count, 3))).astype(np.float32)
    wo = normalize(n + 0.7 * normalize(rng.normal(size=(count, 3)))).astype(np.float32)
    return n, wo


def sum_over_pixels(radiance: np.ndarray, material: Material, n, wo) -> np.ndarray:
    """Eq. 3 as the plain sum over every pixel's centre that is not black."""
    height = len(radiance)
    lit = radiance.any(axis=-1)
    wi = pixel_directions(height)[lit][None]
    light = (radiance * pixel_solid_angles(height)[..., None])[lit]
    rows = []
    for one, toward in zip(n, wo, strict=True):
        f = brdf(material, toward[None, None], wi, one[None, None])[0]
        rows.append((f * np.clip(wi[0] @ one, 0, None)[:, None] * light).sum(axis=0))
    return np.array(rows)


@pytest.mark.parametrize("patches", [None, 16, 32])
def test_no_light_is_lost_or_doubled(rng, patches):
    radiance = sunny(rng) if patches is None else lit_room()
    pyramid = build_pyramid(radiance, emitters=patches or NUM_EMITTERS, patches=patches)
    d = pixel_directions(HEIGHT)
    rest = lookup(pyramid, d, np.zeros(d.shape[:2], np.float32))
    assert luminance(rest).max() < 3.0  # the sun is gone, and the whole emitter
    np.testing.assert_allclose(
        integral(rest) + pyramid.emitter_power.sum(axis=0), integral(radiance), rtol=2e-3, atol=0
    )


def test_emitters_stand_where_the_sun_is(rng):
    radiance = sunny(rng)
    row, column = np.unravel_index(luminance(radiance).argmax(), radiance.shape[:2])
    pyramid = build_pyramid(radiance, emitters=NUM_EMITTERS)
    strongest = pyramid.emitters[luminance(pyramid.emitter_power).argmax()]
    assert strongest @ pixel_directions(HEIGHT)[row, column] > np.cos(np.radians(5.0))
    np.testing.assert_allclose(np.linalg.norm(pyramid.emitters, axis=1), 1.0, atol=1e-5)


def test_a_constant_map_has_emitters_without_light():
    pyramid = build_pyramid(np.ones((HEIGHT, 2 * HEIGHT, 3), np.float32), emitters=NUM_EMITTERS)
    assert np.abs(pyramid.emitter_power).max() == 0.0


@pytest.mark.ci
@pytest.mark.parametrize(("alpha", "f0"), [(0.15, 0.5), (0.5, 0.5), (1.0, 0.5), (0.5, 0.0)])
def test_sixty_four_samples_render_a_sun(rng, alpha, f0):
    """Against the sum over all pixels: a few percent with emitters, far off without."""
    radiance, (n, wo) = sunny(rng), points(rng)
    albedo = np.array([0.5, 0.3, 0.2]) if f0 else np.zeros(3)  # f0 0: grazing reflection alone
    material = Material(albedo=albedo, f0=f0 * np.array([0.6, 1.0, 1.4]), alpha=alpha)
    truth = sum_over_pixels(radiance, material, n, wo)

    def error(emitters: int) -> float:
        shading = shade(build_pyramid(radiance, emitters=emitters), n, wo, alpha, hammersley(64))
        return float(np.sqrt(((shading.radiance(material) - truth) ** 2).mean()) / truth.mean())

    assert error(NUM_EMITTERS) < (0.035 if f0 else 0.1)
    assert error(0) > 4 * error(NUM_EMITTERS)


def test_a_patch_is_as_wide_as_what_is_bright_in_it():
    """A disc of half angle t has a mean direction of length 1 - t^2 / 4."""
    middle, half_angle = normalize(np.array([1.0, 2.0, 1.0])), np.radians(4.0)
    on = pixel_directions(256) @ middle > np.cos(half_angle)
    radiance = np.where(on, 50.0, 0.0)[..., None] * np.ones(3, np.float32)
    pyramid = build_pyramid(radiance.astype(np.float32), side=4, emitters=2, patches=4)
    [emitter] = np.flatnonzero(luminance(pyramid.emitter_power) > 0)
    assert pyramid.emitters[emitter] @ middle > np.cos(np.radians(0.3))
    assert pyramid.emitter_spread[emitter] - 1 / 4**2 == pytest.approx(WIDENING * half_angle**2 / 4, rel=0.03)


def test_a_wide_emitter_makes_a_wide_highlight(rng):
    """A disc 12 degrees wide in a black map: a lobe of alpha 0.1 does not see it as a point."""
    middle, wo = normalize(np.array([0.5, 1.0, 1.0])), normalize(np.array([0.0, 0.2, 1.0]))
    on = pixel_directions(256) @ middle > np.cos(np.radians(6.0))
    radiance = np.where(on, 50.0, 0.0)[..., None] * np.ones(3, np.float32)
    n = normalize(normalize(middle + wo) + 0.08 * rng.normal(size=(200, 3))).astype(np.float32)
    wo = np.broadcast_to(wo, n.shape).astype(np.float32)
    material = Material(albedo=np.zeros(3), f0=np.ones(3), alpha=0.1)
    truth = sum_over_pixels(radiance, material, n, wo)
    pyramid = build_pyramid(radiance.astype(np.float32), side=64, emitters=2, patches=4)

    def error(pyramid) -> float:
        found = emitters_specular(pyramid, n, wo, 0.1)[1]
        return float(np.sqrt(((found - truth) ** 2).mean()) / truth.mean())

    assert error(pyramid) < 0.06
    assert error(replace(pyramid, emitter_spread=np.zeros(2, np.float32))) > 0.15


@pytest.mark.parametrize("patches", [None, PATCHES[0][1]])
def test_torch_takes_the_same_emitters(patches):
    torch = pytest.importorskip("torch")
    here, there = (
        build_pyramid(radiance, emitters=16, patches=patches) for radiance in (lit_room(), torch.from_numpy(lit_room()))
    )
    for name in ("texels", "emitters", "emitter_power", "emitter_spread"):
        if not (patches is None and name == "emitters"):  # of equal pixels any may be taken
            np.testing.assert_allclose(getattr(there, name), getattr(here, name), atol=2e-5, rtol=1e-5)


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
    pyramid = build_pyramid(radiance, emitters=NUM_EMITTERS)
    estimate = shade(pyramid, n, wo, alpha, hammersley(1024)).irradiance
    assert np.sqrt(((estimate - truth) ** 2).mean()) / truth.mean() < 0.03

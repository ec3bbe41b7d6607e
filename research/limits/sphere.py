"""The linear limit: what a ridge regression makes of a perfect sphere of known alpha.

A sphere's normals are known and it neither shades itself nor has errors of masks, so that what is lost here is lost by
its material, the exposure and the clipping of the photo. Learned from views of training maps under the same priors of
material and camera as the pairs that it stands beside; one regression for each range of alpha, of metals and of
dielectrics. No proof: a better prior of maps than a Gaussian may go lower.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import dot, normalize, world_from_camera
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.paper.equations import ggx_distribution, schlick_weight, smith_visibility
from anyprobe.scatter.materials import Material, total_reflectance
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.camera import draw_shot, meter
from anyprobe_train.dataset.distributions import draw_material
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.recipe import WORLD
from research.world.materials import kind_given_alpha

POINTS = 20
"""Points along either side of a square; those on the sphere are seen: 316."""
VIEWS = 16
FLOOR = 1e-3
"""Radiance below counts as this in features."""
RIDGES = (3e-4, 3e-3, 3e-2)
"""Share of the mean feature variance that is added to the diagonal; chosen by maps that are left out."""
LEFT_OUT = 6
"""One map of so many chooses the ridge."""
SPARSE = 16
"""One of so many numbers of a map judges a ridge."""
COARSE = 2
"""Pixels of a map along either side of one that is estimated."""


class Views:
    """Training maps seen by cameras: radiance [N, 64, 128, 3] of mean luminance 1, number [N] of the map of each."""

    def __init__(self, maps: Sequence[np.ndarray], seed: int = 0) -> None:
        """VIEWS of each map [H, 2H, 3] from random sides of the upper hemisphere, every other mirrored."""
        rng = np.random.default_rng(seed)
        self.number = np.arange(len(maps)).repeat(VIEWS)
        self.radiance = np.empty((len(self.number), MAP_HEIGHT, 2 * MAP_HEIGHT, 3), np.float32)
        small = [reduced(radiance, MAP_HEIGHT) for radiance in maps]
        for k, number in enumerate(self.number):
            turn = world_from_camera(rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(0, 0.95)))
            seen = rotate(small[number], turn.T)
            self.radiance[k] = seen[:, ::-1] if k % 2 else seen
        self.terms = lru_cache(maxsize=8)(lambda alpha: sphere_terms(self.radiance, alpha))


@lru_cache(maxsize=1)
def sphere_points() -> np.ndarray:
    """Normals of the visible points of a distant sphere, camera frame, [316, 3]."""
    x = (np.arange(POINTS) + 0.5) / POINTS * 2 - 1
    right, up = (one.reshape(-1) for one in np.meshgrid(x, -x))
    inside = right**2 + up**2 < 1
    right, up = right[inside], up[inside]
    return np.stack([right, up, np.sqrt(1 - right**2 - up**2)], axis=-1).astype(np.float32)


@lru_cache(maxsize=8)
def transport(alpha: float) -> np.ndarray:
    """From a map's pixels to S1, Ss and Dd of the sphere's points, [3, 316, 64 * 128] (see render.integrate)."""
    n = sphere_points()[:, None]
    wi = pixel_directions(MAP_HEIGHT).reshape(1, -1, 3).astype(np.float32)
    wo = np.array([0.0, 0.0, 1.0], np.float32)
    h = normalize(wi + wo)
    n_wi = np.maximum(dot(n, wi)[..., 0], 0.0)
    n_wo = np.maximum(n[..., 2], 1e-3)
    s = schlick_weight(h[..., 2])
    coat = ggx_distribution(dot(n, h)[..., 0], alpha) * smith_visibility(n_wo, n_wi, alpha)
    solid = np.broadcast_to(pixel_solid_angles(MAP_HEIGHT), (MAP_HEIGHT, 2 * MAP_HEIGHT)).reshape(-1)
    return np.stack([coat * n_wi, coat * n_wi * s, (1 - s) * n_wi / np.pi]).astype(np.float32) * solid


def sphere_terms(radiance: np.ndarray, alpha: float) -> np.ndarray:
    """S1, Ss and Dd at the sphere's points under maps [N, 64, 128, 3]: [3, N, 316, 3]."""
    columns = np.moveaxis(radiance, -1, 1).reshape(3 * len(radiance), -1).T
    found = [(part @ columns).T.reshape(len(radiance), 3, -1) for part in transport(alpha)]
    return np.moveaxis(np.stack(found), 2, -1)


def reflected(terms: np.ndarray, material: Material) -> np.ndarray:
    """What the points show, [N, 316, 3]; the material's colours are [N, 3] or [3]."""
    one, grazing, diffuse = terms
    f0, albedo = (np.asarray(part, np.float32).reshape(-1, 1, 3) for part in (material.f0, material.albedo))
    return f0 * one + (1 - f0) * (grazing + albedo * diffuse)


Draw = Callable[[np.random.Generator, float], Material]
"""A material of an alpha."""


def world_draw(metal: bool) -> Draw:
    """Of dataset.distributions, metals or all else."""

    def draw(rng: np.random.Generator, alpha: float) -> Material:
        share = kind_given_alpha(np.array([alpha]))[0] * ((np.arange(len(distributions.KINDS)) == 0) == metal)
        return distributions.draw_one(rng, int(rng.choice(len(share), p=share / share.sum())), alpha)

    return draw


def paper_draw(metal: bool) -> Draw:
    """Of dataset.distributions."""
    return lambda rng, alpha: draw_material(rng, alpha, metal)


class SphereLimit:
    """Estimates maps from spheres of one alpha; called with pairs, gives maps [64, 128, 3] of display values."""

    def __init__(self, views: Views, alpha: float, draw: Draw, world: bool, given: bool, seed: int = 1) -> None:
        """Learn from views.

        Args:
            draw: the prior of materials. world: whether photos are taken as phones do, see dataset.distributions.
            given: whether the material is given; then what is seen is divided by what it reflects.
        """
        self.alpha, self.given = alpha, given
        rng = np.random.default_rng(seed)
        light = views.radiance
        materials = [draw(rng, alpha) for _ in light]
        colors = Material(
            albedo=np.stack([one.albedo for one in materials]), f0=np.stack([one.f0 for one in materials]), alpha=alpha
        )
        seen = reflected(views.terms(alpha), colors)
        gains = np.stack([_gain(rng, world, *each) for each in zip(seen, light, strict=True)])
        x = self._features(seen * gains[:, None], colors)
        light = light * gains[:, None, None]
        self._fit(x, _coarse(response(light)).reshape(len(light), -1), views.number)

    def _features(self, seen: np.ndarray, colors: Material) -> np.ndarray:
        """[N, 316, 3] in exposure units to [N, F]: logarithms and display values, as clipped as the photo is."""
        shown = np.clip(seen, FLOOR, 1.0)
        if self.given:
            shown = shown / total_reflectance(colors.albedo, colors.f0).reshape(-1, 1, 3)
        parts = np.log(shown), response(np.minimum(shown, 1.0)) * 2
        return np.concatenate([part.reshape(len(seen), -1) for part in parts], axis=1).astype(np.float32)

    def _fit(self, x: np.ndarray, y: np.ndarray, number: np.ndarray) -> None:
        """Ridge in its dual form: as many unknowns as views."""
        self._mean_x, self._mean_y = x.mean(axis=0), y.mean(axis=0)
        x, y = x - self._mean_x, y - self._mean_y
        gram = x @ x.T
        scale = float(np.trace(gram)) / len(x)
        held = number % LEFT_OUT == 0

        def error(ridge: float) -> float:
            system = gram[np.ix_(~held, ~held)] + ridge * scale * np.eye((~held).sum(), dtype=np.float32)
            guess = gram[np.ix_(held, ~held)] @ np.linalg.solve(system, y[~held, ::SPARSE])
            return float(((guess - y[held, ::SPARSE]) ** 2).mean())

        self.ridge = min(RIDGES, key=error)
        system = gram + self.ridge * scale * np.eye(len(x), dtype=np.float32)
        self._weights = x.T @ np.linalg.solve(system, y)

    def __call__(self, pair: Pair) -> np.ndarray:
        """The LDR map [64, 128, 3] from a sphere in the pair's place, of its colours."""
        seen = reflected(sphere_terms(pair.radiance[None], self.alpha), pair.material)
        x = self._features(seen, pair.material) - self._mean_x
        guess = (x @ self._weights + self._mean_y).reshape(MAP_HEIGHT // COARSE, -1, 3)
        return np.clip(guess, 0.0, 1.0).repeat(COARSE, axis=0).repeat(COARSE, axis=1)


def _gain(rng: np.random.Generator, world: bool, seen: np.ndarray, light: np.ndarray) -> np.ndarray:
    """[3]: exposure and white balance of a photo of the sphere."""
    shot, gain = meter(draw_shot(rng), light, float(luminance(seen).mean()), world, rng)
    return (gain * shot.white_balance).astype(np.float32)


def _coarse(maps: np.ndarray) -> np.ndarray:
    """Means over COARSE x COARSE pixels, [N, 64, 128, 3] to [N, 32, 64, 3]."""
    count, height, width, _ = maps.shape
    return maps.reshape(count, height // COARSE, COARSE, width // COARSE, COARSE, 3).mean(axis=(2, 4))


def is_world(pair: Pair) -> bool:
    """Whether a pair is of the world's priors."""
    return pair.recipe.conditions == WORLD

"""New light from old: blends of maps, added light sources, a dominant light moved elsewhere, another white.

Each step takes maps [H, 2H, 3] and gives one; light adds up, so a sum of two rooms is a light that can be.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.dataset.catalog import normalize_map
from anyprobe.dataset.sky import direction_at, soft_cap, tint
from anyprobe.light.dominant_light import dilate, find_dominant_light
from anyprobe.light.environment import integral, rotate, shrink

SEARCH_HEIGHT = 64
"""Rows of the map in which the dominant light is looked for."""

MAX_RADIUS = np.radians(35.0)
"""A light wider than this is the surround itself and stays where it is."""


def turn(radiance: np.ndarray, columns: int, mirrored: bool = False) -> np.ndarray:
    """The map turned about +Y by whole columns, to the right; first mirrored left to right if asked."""
    return np.roll(radiance[:, ::-1] if mirrored else radiance, columns, axis=1)


def blend(one: np.ndarray, other: np.ndarray, share: float) -> np.ndarray:
    """(1 - share) one + share other."""
    return (1 - share) * one + share * other


def add_lamp(
    radiance: np.ndarray, direction: np.ndarray, radius: float, power: np.ndarray, softness: float = 0.3
) -> np.ndarray:
    """The map and a soft round light source that adds power [3] to its integral over the sphere."""
    height = radiance.shape[0]
    cap = soft_cap(pixel_directions(height).astype(np.float64), direction, radius, softness)
    whole = (cap[..., 0] * pixel_solid_angles(height)).sum()
    if whole <= 0:
        raise ValueError(
            f"expected a light source wider than a pixel, got a radius of {np.degrees(radius):.2g} degrees"
        )
    return radiance + cap * (np.asarray(power) / whole)


def white_balance(radiance: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """Each channel times its gain [3]."""
    return radiance * np.asarray(gains)


def split_dominant_light(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The map without its dominant light, that light alone, and its direction [3]; their sum is the map.

    The light is what a cap around the lobe of find_dominant_light has more than the mean of a ring around
    the cap. None where no light stands out, or one wider than MAX_RADIUS does.
    """
    height = radiance.shape[0]
    found = find_dominant_light(shrink(radiance, SEARCH_HEIGHT) if height > SEARCH_HEIGHT else radiance)
    if not found.irradiance.any():
        return None
    radius = 1.3 * np.arccos(max(1 - found.solid_angle / (2 * np.pi), -1.0)) + np.radians(3.0)
    if radius > MAX_RADIUS:
        return None
    angle = np.arccos(np.clip(pixel_directions(height) @ found.direction, -1.0, 1.0))
    cap = angle < radius
    ring = (angle >= radius) & (angle < radius + np.radians(6.0)) | dilate(cap) & ~cap
    weights = np.broadcast_to(pixel_solid_angles(height), angle.shape)
    surround = np.average(radiance[ring], axis=0, weights=weights[ring])
    brighter = luminance(radiance) > luminance(surround)
    light = np.where((cap & brighter)[..., None], np.maximum(radiance - surround, 0.0), 0.0)
    return radiance - light, light, found.direction.astype(np.float64)


def move_dominant_light(radiance: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """The map with its dominant light at direction [3], upright as it was and of the same power."""
    split = split_dominant_light(radiance)
    if split is None:
        return radiance
    rest, light, old = split
    moved = rotate(light, _upright_turn(old, direction)).astype(np.float64)
    before, after = integral(light.astype(np.float64)), integral(moved)
    if (after <= 0.1 * before).any():  # fell between the pixels
        return radiance
    return rest + moved * (before / np.where(after > 0, after, 1.0))


def _upright_turn(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """A rotation [3, 3] that carries old to new and tilts about a level axis between two turns about +Y."""

    def angles(d):
        return np.arctan2(d[0], -d[2]), np.arcsin(np.clip(d[1], -1.0, 1.0))

    (a, e), (b, f) = angles(old), angles(new)
    return rotation_y(-b) @ rotation_x(f - e) @ rotation_y(a)


def draw_variant(rng: np.random.Generator, maps: list[np.ndarray]) -> np.ndarray:
    """A light that none of the maps is, made of one or two of them of the same size; mean luminance 1."""

    first, second = rng.choice(len(maps), 2, replace=len(maps) < 2)

    def turned(radiance):
        return turn(radiance, int(rng.integers(radiance.shape[1])), bool(rng.random() < 0.5))

    def anywhere():
        return direction_at(rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(-0.2, 0.98)))

    radiance = turned(maps[first])
    steps = rng.random(4) < [0.5, 0.4, 0.4, 0.5]
    if not steps[:3].any():  # white alone is the same light
        steps[rng.integers(3)] = True
    if steps[0]:
        moved = move_dominant_light(radiance, anywhere())
        steps[2] |= moved is radiance and not steps[1]  # no light to move: an added one makes it new
        radiance = moved
    if steps[1]:
        radiance = blend(radiance, turned(maps[second]), rng.uniform(0.15, 0.85))
    if steps[2]:
        mean = luminance(integral(radiance))
        for _ in range(rng.integers(1, 4)):
            radius = np.radians(np.exp(rng.uniform(np.log(1.5), np.log(30.0))))
            radius = max(radius, 1.5 * np.pi / radiance.shape[0])
            power = mean * np.exp(rng.uniform(np.log(0.05), np.log(1.0))) * tint(rng, 0.25)
            radiance = add_lamp(radiance, anywhere(), radius, power, rng.uniform(0.1, 1.5))
    if steps[3]:
        radiance = white_balance(radiance, tint(rng, 0.15))
    return normalize_map(np.maximum(radiance, 0.0))

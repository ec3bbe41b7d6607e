"""The light of one scene: drawn anew for every scene from real maps and procedural ones, never one of a fixed set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import integral, reduced, rotate
from anyprobe.light.light_sources import BLUR_RADIUS, dilate, find_dominant_light
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import lamp_direction, sky, soft_cap, studio, tint

CONTRAST = 0.12
"""Standard deviation of ln of the exponent that a map's radiance is raised to."""
TINT = 0.12
"""Standard deviation of ln of a map's white."""
BLENDS, MOVED, LAMPS = 0.2, 0.1, 0.3
"""Shares of the lights made of real maps that are a blend of two, have their dominant light moved, or get lamps."""
LAMP_TINT = 0.35
"""Standard deviation of ln of a lamp's colour: each lamp of a scene has its own."""
LAMP_DEG = (1.5, 25.0)
LAMP_POWER = (0.1, 3.0)
"""Bounds of a lamp's radius and of its power, in shares of all other light; even in the logarithm."""
ROWS, MADE_ROWS = 256, 128
"""Rows of every light, and of procedural ones as they are made: a camera does not see them at full size."""
SEARCH_HEIGHT = 64
"""Rows of the map in which the dominant light is found."""

MAX_RADIUS = np.radians(35.0)
"""Largest radius of a light that is moved [radians]; a wider one is the surround itself."""


def draw_real_light(rng: np.random.Generator, maps: Sequence[np.ndarray]) -> np.ndarray:
    """Return a light made of real maps [256, 512, 3]: turned, of another contrast and white, some with lamps."""
    radiance = _turned(rng, maps[rng.integers(len(maps))])
    if rng.random() < BLENDS:
        other = _turned(rng, maps[rng.integers(len(maps))])
        share = float(rng.uniform(0.2, 0.8))
        radiance = (1 - share) * radiance + share * other
    elif rng.random() < MOVED:
        radiance = _enlarged(move_dominant_light(reduced(radiance, MADE_ROWS), lamp_direction(rng)))
    radiance = _contrast(rng, radiance)
    if rng.random() < LAMPS:
        radiance = with_lamps(rng, radiance, int(rng.integers(1, 4)))
    return normalize_map(np.maximum(radiance * tint(rng, TINT), 0.0))


def draw_place(rng: np.random.Generator, maps: Sequence[np.ndarray]) -> np.ndarray:
    """Return one real place [256, 512, 3] as it is but for yaw, contrast and white."""
    radiance = _contrast(rng, _turned(rng, maps[rng.integers(len(maps))]))
    return normalize_map(np.maximum(radiance * tint(rng, 0.5 * TINT), 0.0))


def draw_procedural_light(rng: np.random.Generator) -> np.ndarray:
    """Return a procedural room, day or studio [256, 512, 3], some with lamps of unlike colours."""
    kind = (room, room, sky, studio)[rng.integers(4)]
    radiance = _enlarged(kind(rng, MADE_ROWS))
    if rng.random() < LAMPS:
        radiance = with_lamps(rng, radiance, int(rng.integers(1, 3)))
    return normalize_map(np.maximum(radiance * tint(rng, TINT), 0.0))


def with_lamps(rng: np.random.Generator, radiance: np.ndarray, count: int) -> np.ndarray:
    """Return the map with so many lamps, each of its own size, colour and power."""
    mean = luminance(integral(radiance))
    for _ in range(count):
        radius = np.radians(np.exp(rng.uniform(*np.log(LAMP_DEG))))
        radius = max(radius, 1.5 * np.pi / len(radiance))
        strength = mean * np.exp(rng.uniform(*np.log(LAMP_POWER)))
        color = tint(rng, LAMP_TINT)
        radiance = add_lamp(radiance, lamp_direction(rng), radius, strength * color, float(rng.uniform(0.1, 1.5)))
    return radiance


def _turned(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    """Return the map turned about +Y by whole columns, mirrored or not."""
    columns, mirrored = int(rng.integers(radiance.shape[1])), rng.random() < 0.5
    return np.roll(radiance[:, ::-1] if mirrored else radiance, columns, axis=1)


def _enlarged(radiance: np.ndarray) -> np.ndarray:
    """Return a map of half the rows at ROWS."""
    return radiance.repeat(2, axis=0).repeat(2, axis=1)


def _contrast(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    return radiance ** float(np.exp(rng.normal(0.0, CONTRAST)))


def add_lamp(
    radiance: np.ndarray, direction: np.ndarray, radius: float, power: np.ndarray, softness: float
) -> np.ndarray:
    """Add a soft round light source, wider than a pixel, whose integral over the sphere is power [3]."""
    height = radiance.shape[0]
    cap = soft_cap(pixel_directions(height).astype(np.float64), direction, radius, softness)
    total = (cap[..., 0] * pixel_solid_angles(height)).sum()
    return radiance + cap * (np.asarray(power) / total)


def split_light_cap(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the map without its dominant light, that light alone, and its direction [3]; their sum is the map.

    The light is what a cap around the lobe of find_dominant_light has more than the mean of a ring around
    the cap. None where no light stands out, or one wider than MAX_RADIUS does.
    """
    height = radiance.shape[0]
    found = find_dominant_light(reduced(radiance, SEARCH_HEIGHT))
    if not found.irradiance.any():
        return None
    radius = 1.3 * np.hypot(np.radians(found.radius_deg), BLUR_RADIUS) + np.radians(3.0)
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
    """Move the dominant light of a map to direction [3]; its power stays, and it stays upright."""
    split = split_light_cap(radiance)
    if split is None:
        return radiance
    rest, light, old = split
    moved = rotate(light, _upright_turn(old, direction)).astype(np.float64)
    before, after = integral(light.astype(np.float64)), integral(moved)
    if (after <= 0.1 * before).any():  # fell between the pixels
        return radiance
    return rest + moved * (before / np.where(after > 0, after, 1.0))


def _upright_turn(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Return a rotation [3, 3] that carries old to new and tilts about a level axis between two turns about +Y."""

    def angles(d):
        return np.arctan2(d[0], -d[2]), np.arcsin(np.clip(d[1], -1.0, 1.0))

    (a, e), (b, f) = angles(old), angles(new)
    return rotation_y(-b) @ rotation_x(f - e) @ rotation_y(a)

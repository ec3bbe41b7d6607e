"""The light of one scene: drawn anew for every scene from real maps and procedural ones, never one of a fixed set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.light.environment import integral, reduced
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.lighting import add_lamp, blend_maps, move_dominant_light, turn
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import lamp_direction, sky, studio, tint

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


def draw_real_light(rng: np.random.Generator, maps: Sequence[np.ndarray]) -> np.ndarray:
    """Return a light made of real maps [256, 512, 3]: turned, of another contrast and white, some with lamps."""
    radiance = _turned(rng, maps[rng.integers(len(maps))])
    if rng.random() < BLENDS:
        other = _turned(rng, maps[rng.integers(len(maps))])
        radiance = blend_maps(radiance, other, float(rng.uniform(0.2, 0.8)))
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


def with_lamps(
    rng: np.random.Generator, radiance: np.ndarray, count: int, power: tuple[float, float] = LAMP_POWER
) -> np.ndarray:
    """Return the map with so many lamps, each of its own size, colour and power."""
    mean = luminance(integral(radiance))
    for _ in range(count):
        radius = np.radians(np.exp(rng.uniform(*np.log(LAMP_DEG))))
        radius = max(radius, 1.5 * np.pi / len(radiance))
        strength = mean * np.exp(rng.uniform(*np.log(power)))
        color = tint(rng, LAMP_TINT)
        radiance = add_lamp(radiance, lamp_direction(rng), radius, strength * color, float(rng.uniform(0.1, 1.5)))
    return radiance


def _turned(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    return turn(radiance, int(rng.integers(radiance.shape[1])), bool(rng.random() < 0.5))


def _enlarged(radiance: np.ndarray) -> np.ndarray:
    """Return a map of half the rows at ROWS."""
    return radiance.repeat(2, axis=0).repeat(2, axis=1)


def _contrast(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    return radiance ** float(np.exp(rng.normal(0.0, CONTRAST)))

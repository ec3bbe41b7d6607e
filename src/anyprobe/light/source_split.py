"""A map as its soft part and a few discrete sources, which a filter over time can turn and fade.

The brightest pixel is a source's first place; twice the source moves to the middle of what is brighter than its
surroundings, the median of the ring around. What it has above that, within reach_deg, is taken out of the map, and
the next one is looked for apart_deg away. What is wider than most_radius_deg stays in the soft part: averages of it
overlap, and show no source twice. split_sources and draw_sources keep the power of every source.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles

if TYPE_CHECKING:
    from jaxtyping import Float

RULES = contract("source_split")
MOST: int = RULES["most"]
REACH, RING, APART = (np.cos(np.radians(RULES[name])) for name in ("reach_deg", "ring_deg", "apart_deg"))
LEAST_SHARE: float = RULES["least_share"]
"""Of the map's power: less is no source."""
LEAST_RADIUS, MOST_RADIUS = (float(np.radians(RULES[name])) for name in ("least_radius_deg", "most_radius_deg"))


@dataclass(frozen=True, kw_only=True, slots=True)
class Source:
    """direction: [3], unit. power: [3], integral of radiance over its pixels, sr. radius: of its disc, radians."""

    direction: np.ndarray
    power: np.ndarray
    radius: float


def split_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[np.ndarray, tuple[Source, ...]]:
    """The map [H, 2H, 3] without its discrete sources, and these, the one with the brightest pixel first."""
    height = len(radiance)
    d, angles = _grid(height)
    soft = radiance.reshape(-1, 3).copy()
    bright = luminance(soft)
    least = LEAST_SHARE * float(bright @ angles[:, 0])
    sources: list[Source] = []
    for _ in range(MOST):
        center = d[int(np.argmax(bright))].astype(np.float64)
        for _ in range(2):
            cosine = d @ center
            near = np.flatnonzero(cosine > REACH)
            level = _median(soft[(cosine > RING) & (cosine <= REACH)]) if len(near) else np.zeros(3, np.float32)
            excess = np.maximum(soft[near] - level, 0.0)
            energy = luminance(excess) * angles[near, 0]
            total = float(energy.sum())
            if total <= least:
                return soft.reshape(radiance.shape), tuple(sources)
            center = _unit(energy @ d[near])
        turned = np.arccos(np.clip(d[near] @ center, -1.0, 1.0))
        bright[d @ center > APART] = 0.0
        radius = float(np.sqrt(3.0 * (energy @ np.square(turned)) / total))
        if radius > MOST_RADIUS:
            continue
        power = (excess * angles[near]).sum(axis=0)
        sources.append(Source(direction=center, power=power.astype(np.float64), radius=max(radius, LEAST_RADIUS)))
        soft[near] -= excess
    return soft.reshape(radiance.shape), tuple(sources)


def draw_sources(height: int, sources: Iterable[Source]) -> Float[np.ndarray, "H 2*H 3"]:
    """Discs, brightest in the middle: L ~ cos(angle) - cos(radius). Each has its power, however few its pixels."""
    d, angles = _grid(height)
    drawn = np.zeros((2 * height * height, 3), np.float32)
    for source in sources:
        shape = d @ source.direction - np.cos(source.radius)
        pixels = np.flatnonzero(shape > 0.0)
        part = shape[pixels]
        drawn[pixels] += (part / (part @ angles[pixels, 0]))[:, None] * source.power
    return drawn.reshape(height, 2 * height, 3)


@lru_cache(maxsize=4)
def _grid(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions [P, 3] and solid angles [P, 1] of the pixels."""
    return pixel_directions(height).reshape(-1, 3), np.repeat(pixel_solid_angles(height), 2 * height, axis=0)


def _median(colors: np.ndarray) -> np.ndarray:
    """The lower one of an even number, channel by channel; [3] of [K, 3]."""
    return np.sort(colors, axis=0)[(len(colors) - 1) // 2] if len(colors) else np.zeros(3, np.float32)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)

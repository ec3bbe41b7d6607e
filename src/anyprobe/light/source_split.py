"""A map as its soft part and a few discrete sources, which a filter over time can turn and fade.

A source starts at the brightest pixel; twice it moves to the centroid of what is brighter than its surroundings, the
median of the ring around. Its excess over that median within reach_deg is removed from the map, and the next source is
looked for apart_deg away. Its radius R is that of a disc of draw_sources with as much power P and as bright a peak:
R^2 = 4 / (3 pi) P^2 / Q, with P the integral of the excess luminance and Q that of its square. A source wider than
most_radius_deg is measured again by the numbers of `wide`; one wider than theirs stays in the soft part, whose averages
overlap and show no source twice. split_sources and draw_sources keep the power of every source.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.light_sources import MOST_SOURCES

if TYPE_CHECKING:
    from jaxtyping import Float

RULES = contract("source_split")
NAMES = ("reach_deg", "ring_deg", "apart_deg")
COMPACT_AND_WIDE = tuple(
    (*(np.cos(np.radians(rules[name])) for name in NAMES), float(np.radians(rules["most_radius_deg"])))
    for rules in (RULES, RULES["wide"])
)
"""Cosines of reach, ring and apart, and the largest radius, for compact and for wide sources."""
LEAST_SHARE: float = RULES["least_share"]
"""Smallest share of the map's power that a source may have."""
LEAST_RADIUS = float(np.radians(RULES["least_radius_deg"]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Source:
    """Discrete source: direction [3], unit; power [3], integral of radiance [sr]; radius of its disc [radians]."""

    direction: np.ndarray
    power: np.ndarray
    radius: float


def split_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[np.ndarray, tuple[Source, ...]]:
    """Split a map [H, 2H, 3] into its soft part and its discrete sources, the one with the brightest pixel first."""
    height = len(radiance)
    d, angles = _grid(height)
    soft = radiance.reshape(-1, 3).copy()
    bright = luminance(soft)
    least = LEAST_SHARE * float(bright @ angles[:, 0])
    sources: list[Source] = []
    for _ in range(MOST_SOURCES):
        peak = d[int(np.argmax(bright))].astype(np.float64)
        for reach, ring, apart, most_radius in COMPACT_AND_WIDE:  # noqa: B007
            found = _around(soft, peak, reach, ring, least)
            if found is None:
                return soft.reshape(radiance.shape), tuple(sources)
            near, excess, source = found
            if source.radius <= most_radius:
                soft[near] -= excess
                sources.append(replace(source, radius=max(source.radius, LEAST_RADIUS)))
                break
        bright[d @ source.direction > apart] = 0.0
    return soft.reshape(radiance.shape), tuple(sources)


def _around(
    soft: np.ndarray, center: np.ndarray, reach: float, ring: float, least: float
) -> tuple[np.ndarray, np.ndarray, Source] | None:
    """Measure the bright spot of soft [P, 3] around `center`; None if its power is at most `least`.

    Returns its pixels [K], their radiance above the surroundings [K, 3], and the source.
    """
    d, angles = _grid(int(np.sqrt(len(soft) / 2)))
    for _ in range(2):
        cosine = d @ center
        near = np.flatnonzero(cosine > reach)
        level = _median(soft[(cosine > ring) & (cosine <= reach)]) if len(near) else np.zeros(3, np.float32)
        excess = np.maximum(soft[near] - level, 0.0)
        energy = luminance(excess) * angles[near, 0]
        total = float(energy.sum())
        if total <= least:
            return None
        center = _unit(energy @ d[near])
    power = (excess * angles[near]).sum(axis=0).astype(np.float64)
    radius = float(np.sqrt(4.0 / (3.0 * np.pi) * total**2 / (energy @ luminance(excess))))
    return near, excess, Source(direction=center, power=power, radius=radius)


def draw_sources(height: int, sources: Iterable[Source]) -> Float[np.ndarray, "H 2*H 3"]:
    """Draw sources as discs, brightest in the middle: L ~ cos(angle) - cos(radius). Each keeps its power on any
    grid."""
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
    """Return directions [P, 3] and solid angles [P, 1] of the pixels."""
    return pixel_directions(height).reshape(-1, 3), np.repeat(pixel_solid_angles(height), 2 * height, axis=0)


def _median(colors: np.ndarray) -> np.ndarray:
    """Return the median of each channel, [K, 3] -> [3]; the lower one if K is even."""
    return np.sort(colors, axis=0)[(len(colors) - 1) // 2] if len(colors) else np.zeros(3, np.float32)


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)

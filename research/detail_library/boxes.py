"""Scenes of upright boxes seen from inside: what ray casts hit, noise in space, and shadows.

For panoramas whose detail is looked at, not their light: shading is direct light, shadows and a little darkness in
corners, no light between walls as dataset.room has it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from anyprobe.core.latlong import pixel_directions

SUPERSAMPLE = 3
TOE = 0.02
"""Radiance added before the mean of ln."""
NEAR = 1e-3
"""Metres by which a shadow ray starts off its surface."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Boxes:
    """low, high [K, 3] in metres, albedo and emission [K, 3] radiance, texture [K]: a number of box_textures;
    shadow [K]: whether it throws one."""

    low: np.ndarray
    high: np.ndarray
    albedo: np.ndarray
    emission: np.ndarray
    texture: np.ndarray
    shadow: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Hits:
    """Of N rays: index of the box [N], -1 where there is none; distance [N], position and normal [N, 3]."""

    index: np.ndarray
    distance: np.ndarray
    position: np.ndarray
    normal: np.ndarray


class Builder:
    """Collects boxes."""

    def __init__(self) -> None:
        self.rows: list[tuple] = []

    def add(self, centre, size, albedo, emission=0.0, texture: int = 0, shadow: bool = True) -> None:
        """A box by its centre [3] and size [3]."""
        centre, half = np.asarray(centre, float), np.asarray(size, float) / 2
        color, glow = np.broadcast_to(albedo, 3), np.broadcast_to(emission, 3)
        self.rows.append((centre - half, centre + half, color, glow, texture, shadow))

    def boxes(self) -> Boxes:
        """All of them."""
        low, high, albedo, emission, texture, shadow = (np.array(values) for values in zip(*self.rows, strict=True))
        return Boxes(low=low, high=high, albedo=albedo, emission=emission, texture=texture, shadow=shadow)


def cast(boxes: Boxes, eye: np.ndarray, d: np.ndarray) -> Hits:
    """The nearest box along unit directions d [N, 3] from an eye outside of all (slabs, Kay and Kajiya 1986)."""
    distance, index = np.full(len(d), np.inf), np.full(len(d), -1)
    axis = np.zeros(len(d), np.int64)
    safe = np.where(np.abs(d) < 1e-9, 1e-9, d)
    inverse = 1.0 / safe
    for k, (low, high) in enumerate(zip(boxes.low, boxes.high, strict=True)):
        near = np.minimum((low - eye) * inverse, (high - eye) * inverse)
        far = np.maximum((low - eye) * inverse, (high - eye) * inverse).min(axis=1)
        entry = near.max(axis=1)
        closer = np.flatnonzero((entry < far) & (entry > 0) & (entry < distance))
        distance[closer], index[closer], axis[closer] = entry[closer], k, near[closer].argmax(axis=1)
    normal = np.eye(3)[axis] * -np.sign(np.take_along_axis(safe, axis[:, None], axis=1))
    reach = np.where(np.isfinite(distance), distance, 0.0)
    return Hits(index=index, distance=distance, position=eye + d * reach[:, None], normal=normal)


def visible(boxes: Boxes, position: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Whether no box lies between positions [N, 3] and a target [3], [N]."""
    position = position.astype(np.float32).T
    way = target.astype(np.float32)[:, None] - position
    inverse = 1.0 / np.where(np.abs(way) < 1e-9, np.float32(1e-9), way)
    lit = np.ones(position.shape[1], bool)
    for low, high in zip(boxes.low[boxes.shadow], boxes.high[boxes.shadow], strict=True):
        entry, leave = np.full((2, len(lit)), [[-np.inf], [1.0]], np.float32)
        for axis in range(3):
            one = (np.float32(low[axis]) - position[axis]) * inverse[axis]
            other = (np.float32(high[axis]) - position[axis]) * inverse[axis]
            np.maximum(entry, np.minimum(one, other), out=entry)
            np.minimum(leave, np.maximum(one, other), out=leave)
        lit &= ~((entry < leave) & (leave > NEAR))
    return lit


def noise(rng: np.random.Generator, x: np.ndarray) -> np.ndarray:
    """Smooth noise at points x [N, 3] of cells of size 1, [N] in [-1, 1]; the rng draws the cells' values."""
    table = rng.uniform(-1.0, 1.0, 1 << 14)
    cell = np.floor(x)
    t = x - cell
    t = t * t * (3 - 2 * t)
    i, j, k = (cell.astype(np.int64) * [73856093, 19349663, 83492791]).T
    total = np.zeros(len(x))
    for corner in range(8):
        a, b, c = corner & 1, corner >> 1 & 1, corner >> 2
        value = table[((i + a * 73856093) ^ (j + b * 19349663) ^ (k + c * 83492791)) & 0x3FFF]
        share = [t[:, n] if side else 1 - t[:, n] for n, side in enumerate((a, b, c))]
        total += value * share[0] * share[1] * share[2]
    return total


def turbulence(
    rng: np.random.Generator, x: np.ndarray, octaves: int, footprint: np.ndarray | float = 0.0, fall: float = 0.55
) -> np.ndarray:
    """Octaves of noise at x [N, 3], the first of cells of size 1, [N]; cells smaller than a footprint [N] fade out."""
    total, size, weight = np.zeros(len(x)), 1.0, 1.0
    for _ in range(octaves):
        fade = np.clip(1.5 - 2.0 * np.asarray(footprint) / size, 0.0, 1.0)
        own = np.random.default_rng(rng.integers(1 << 62))  # the same draws however much fades
        if np.any(fade > 0):
            total += weight * fade * noise(own, x / size + own.uniform(0, 99, 3))
        size, weight = size / 2, weight * fall
    return total


def lines(x: np.ndarray, spacing: float, width: float, footprint: np.ndarray | float) -> np.ndarray:
    """How much of a pixel lies on lines `width` wide every `spacing` along x [N], a footprint [N] wide: [N]."""
    reach = np.maximum(footprint, 1e-6)

    def covered(at: np.ndarray) -> np.ndarray:
        whole = np.floor(at / spacing)
        return whole * width + np.minimum(at - whole * spacing, width)

    return np.clip((covered(x + reach / 2) - covered(x - reach / 2)) / reach, 0.0, 1.0)


def panorama(look: Callable[[np.ndarray], np.ndarray], height: int) -> np.ndarray:
    """What look(d [N, 3]) -> [N, 3] gives, [height, 2 height, 3] float32: SUPERSAMPLE^2 rays a pixel under a tent two
    pixels wide. The mean is that of ln, so that the edges of what shines are as smooth as others."""
    d = pixel_directions(height * SUPERSAMPLE).astype(np.float64)
    bands = [look(band.reshape(-1, 3)).reshape(band.shape) for band in np.array_split(d, 8)]
    fine = np.log(np.clip(np.concatenate(bands), 0.0, 1e4) + TOE)
    for axis, mode in ((0, "edge"), (1, "wrap")):
        reach = [(SUPERSAMPLE - 1, SUPERSAMPLE - 1) if k == axis else (0, 0) for k in range(3)]
        padded = np.pad(fine, reach, mode=mode)
        tent = np.convolve(np.ones(SUPERSAMPLE), np.ones(SUPERSAMPLE)) / SUPERSAMPLE**2
        length = fine.shape[axis]
        fine = sum(w * padded.take(np.arange(k, k + length), axis) for k, w in enumerate(tent))
        fine = fine.take(np.arange(SUPERSAMPLE // 2, length, SUPERSAMPLE), axis)
    return np.maximum(np.exp(fine) - TOE, 0.0).astype(np.float32)

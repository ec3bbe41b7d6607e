"""Directions that an object hides from its own surface.

Directions around a pixel are cells: AZIMUTHS about the camera's axis times RINGS, equal in the sine of their elevation
above the picture's plane, so that all have one solid angle. A cell is hidden where the picture itself shows something
in it: between the first face that a pixel sees and where the ray leaves the object again (Therrien, Levesque and Gilet
2023, Screen Space Indirect Lighting with Visibility Bitmask, who guess that thickness). What a picture does not show
hides nothing.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.render.surface import Surface, pixel_rays

AZIMUTHS, RINGS = 16, 8
SIDE = 64
"""Side of the pictures of hidden cells [pixels]."""
STEPS = (1, 2, 3, 4, 5, 7, 9, 12, 15, 19, 24, 30, 38, 48)
"""Distances at which each azimuth is searched for occluders [pixels of SIDE]."""
REACH = np.append(np.array(STEPS[1:]) / STEPS[:-1], 1.0)[:, None].astype(np.float32)
"""Ratio of each step to the one before."""


def hidden_cells(surface: Surface) -> np.ndarray:
    """Compute the hidden cells [AZIMUTHS, SIDE, SIDE] uint8: ring e of an azimuth in bit e; zero off the object.

    Args:
        surface: of a square camera looking straight ahead, whose side is a multiple of SIDE.
    """
    near, far = _points(surface)
    mask = np.isfinite(near[..., 0])
    padded = [
        np.pad(points, ((STEPS[-1],) * 2, (STEPS[-1],) * 2, (0, 0)), constant_values=np.nan) for points in (near, far)
    ]
    row, column = np.nonzero(mask)
    positions = near[mask]
    edges = (2 * np.arange(RINGS) + 1) / RINGS - 1
    result = np.zeros((AZIMUTHS, SIDE, SIDE), np.uint8)
    for number in range(AZIMUTHS):
        angle = 2 * np.pi * number / AZIMUTHS
        down, right = (np.rint(np.array(STEPS) * move).astype(int) for move in (-np.sin(angle), np.cos(angle)))
        indices = row[:, None] + down + STEPS[-1], column[:, None] + right + STEPS[-1]
        first, last = (points[indices] - positions[:, None] for points in padded)
        last[..., :2] *= np.where(last[..., 2:] > 0, REACH, 1.0)  # what is found goes on to the next step
        first, last = _sine(first), _sine(last)
        covered = np.zeros(len(positions), np.uint8)
        for ring, middle in enumerate(edges):
            covered |= ((last < middle) & (middle < first)).any(axis=1).astype(np.uint8) << ring
        result[number][mask] = covered
    return result


def _points(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Return where pixels' rays meet the object and where they leave it, camera frame, [SIDE, SIDE, 3]; NaN off it."""
    size = len(surface.mask)
    every = size // SIDE
    slopes = -pixel_rays(surface.tan_half, size)
    slopes = slopes / -slopes[..., 2:]
    points = []
    for depth in (surface.depth, surface.exit):
        picture = np.full((size, size), np.nan, np.float32)
        picture[surface.mask] = depth
        points.append((slopes * picture[..., None])[every // 2 :: every, every // 2 :: every])
    return points[0], points[1]


def _sine(offset: np.ndarray) -> np.ndarray:
    """Return the sine of the elevation of [..., 3]; NaN where there is nothing."""
    return offset[..., 2] / np.maximum(np.sqrt((offset**2).sum(axis=-1)), 1e-9)


def mirrored_cells(hidden: np.ndarray) -> np.ndarray:
    """Return the cells [AZIMUTHS, S, S] of the picture mirrored left to right."""
    return hidden[(AZIMUTHS // 2 - np.arange(AZIMUTHS)) % AZIMUTHS, :, ::-1]


@lru_cache(maxsize=1)
def cell_directions() -> np.ndarray:
    """Return the middles of the cells, [AZIMUTHS * RINGS, 3] float32."""
    angle = 2 * np.pi * np.arange(AZIMUTHS)[:, None] / AZIMUTHS
    sine = ((2 * np.arange(RINGS) + 1) / RINGS - 1)[None]
    cosine = np.sqrt(1 - sine**2)
    parts = np.broadcast_arrays(np.cos(angle) * cosine, np.sin(angle) * cosine, sine)
    return np.stack(parts, axis=-1).reshape(-1, 3).astype(np.float32)


@lru_cache(maxsize=2)
def cell_weights(height: int) -> np.ndarray:
    """Return the weights of a map's pixels in the mean over each cell, [AZIMUTHS * RINGS, H * 2H] float32."""
    d = pixel_directions(height).reshape(-1, 3)
    azimuth = np.rint(np.arctan2(d[:, 1], d[:, 0]) * AZIMUTHS / (2 * np.pi)).astype(int) % AZIMUTHS
    ring = np.clip(((d[:, 2] + 1) / 2 * RINGS).astype(int), 0, RINGS - 1)
    weights = np.zeros((AZIMUTHS * RINGS, len(d)), np.float32)
    solid = np.broadcast_to(pixel_solid_angles(height), (height, 2 * height)).reshape(-1)
    weights[azimuth * RINGS + ring, np.arange(len(d))] = solid
    return weights / weights.sum(axis=1, keepdims=True)

"""Smooth enlargement of maps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.light.environment import reduced


def enlarged_map(values: np.ndarray, rows: int) -> np.ndarray:
    """Resize smooth values [h, 2h, C] to [rows, 2 rows, C] float32, by cubic B-splines, or by means where they shrink.

    Beyond a pole lies the opposite side.
    """
    height, width = values.shape[:2]
    if height >= rows:
        return reduced(values, rows).astype(np.float32)
    planes = np.moveaxis(values, -1, 0).astype(np.float32)
    beyond = np.roll(planes, width // 2, axis=2)
    tall = np.concatenate([beyond[:, 1::-1], planes, beyond[:, :-3:-1]], axis=1)
    padded = np.concatenate([tall[:, :, -2:], tall, tall[:, :, :2]], axis=2)
    return np.ascontiguousarray(np.moveaxis(_spline(height, rows) @ padded @ _spline(width, 2 * rows).T, 0, -1))


@lru_cache(maxsize=16)
def _spline(old: int, new: int) -> np.ndarray:
    """Return the weights [new, old + 4] of the cubic B-spline on values padded by two at both ends."""
    at = (np.arange(new) + 0.5) * old / new - 0.5
    first = np.floor(at).astype(int)
    t = at - first
    parts = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    weights = np.zeros((new, old + 4), np.float32)
    for k, part in enumerate(parts):
        weights[np.arange(new), first + 1 + k] = part / 6
    return weights

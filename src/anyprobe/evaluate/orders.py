"""Spherical harmonics of any order, to say which orders of a map an estimate explains."""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.dataset.pair import LN_RANGE

ORDERS = 9
"""0 to 8: no dull object shows more."""


@lru_cache(maxsize=2)
def basis(height: int, orders: int = ORDERS) -> np.ndarray:
    """Real, orthonormal Y_lm times solid angle at the pixels of a map, [orders^2, H * 2H]; row l^2 + l + m.

    Legendre functions by the recurrence in l (Numerical Recipes, Sect. 6.7); the polar axis is +Y.
    """
    d = pixel_directions(height).reshape(-1, 3).astype(np.float64)
    z, azimuth = d[:, 1], np.arctan2(d[:, 0], -d[:, 2])
    rows = np.zeros((orders**2, len(z)))
    for m in range(orders):
        before, now = np.zeros_like(z), np.prod(np.arange(1, 2 * m, 2)) * (1 - z * z) ** (m / 2)
        for l in range(m, orders):
            scale = np.sqrt((2 * l + 1) / (4 * np.pi) * factorial(l - m) / factorial(l + m)) * now
            if m == 0:
                rows[l * l + l] = scale
            else:
                rows[l * l + l + m] = np.sqrt(2) * scale * np.cos(m * azimuth)
                rows[l * l + l - m] = np.sqrt(2) * scale * np.sin(m * azimuth)
            before, now = now, ((2 * l + 1) * z * now - (l + m) * before) / (l - m + 1)
    solid = np.broadcast_to(pixel_solid_angles(height), (height, 2 * height)).reshape(-1)
    return (rows * solid).astype(np.float32)


def order_powers(difference: np.ndarray) -> np.ndarray:
    """Power of each order in a map [H, 2H, C], over all channels: [ORDERS]."""
    height = difference.shape[0]
    coefficients = basis(height) @ difference.reshape(2 * height * height, -1)
    power = (coefficients**2).sum(axis=1)
    return np.add.reduceat(power, np.arange(ORDERS) ** 2)


def ln_error(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Power of the error of ln radiance, clipped to LN_RANGE, in each order: [ORDERS]."""
    p, g = (np.log(np.clip(one, *np.exp(LN_RANGE))) for one in (estimate, truth))
    return order_powers((p - g).astype(np.float32))

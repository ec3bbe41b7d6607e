"""Which orders of spherical harmonics of a map an estimate explains."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.paper.chain import LN_SCALE
from research.harmonics import real_basis

ORDERS = 9
"""0 to 8: no dull object shows more."""


@lru_cache(maxsize=2)
def basis(height: int) -> np.ndarray:
    """Orthonormal real harmonics times solid angle at the pixels of a map, [ORDERS^2, H * 2H]."""
    d = pixel_directions(height).reshape(-1, 3).astype(np.float64)
    solid = np.broadcast_to(pixel_solid_angles(height), (height, 2 * height)).reshape(-1)
    return (real_basis(d, ORDERS - 1).T * solid).astype(np.float32)


def order_powers(difference: np.ndarray) -> np.ndarray:
    """Power of each order in a map [H, 2H, C], over all channels: [ORDERS]."""
    height = difference.shape[0]
    coefficients = basis(height) @ difference.reshape(2 * height * height, -1)
    power = (coefficients**2).sum(axis=1)
    return np.add.reduceat(power, np.arange(ORDERS) ** 2)


def ln_error(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Power of the error of ln radiance, clipped to LN_SCALE, in each order: [ORDERS]."""
    p, g = (np.log(np.clip(one, *np.exp(LN_SCALE))) for one in (estimate, truth))
    return order_powers((p - g).astype(np.float32))

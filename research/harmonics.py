"""Spherical harmonics of any order."""

from __future__ import annotations

from math import factorial

import numpy as np


def real_basis(d: np.ndarray, order: int) -> np.ndarray:
    """Orthonormal real harmonics of order 0 to `order` about +Y at unit directions [N, 3], [N, (order + 1)^2].

    Column l^2 + l + m. Legendre functions by the recurrence in l (Numerical Recipes, Sect. 6.7), Condon-Shortley phase.
    """
    z, azimuth = d[:, 1], np.arctan2(d[:, 0], d[:, 2])
    columns = np.zeros((len(d), (order + 1) ** 2))
    for m in range(order + 1):
        before, now = np.zeros_like(z), (-1.0) ** m * np.prod(np.arange(1, 2 * m, 2)) * (1 - z * z) ** (m / 2)
        for l in range(m, order + 1):
            scale = np.sqrt((2 * l + 1) / (4 * np.pi) * factorial(l - m) / factorial(l + m)) * now
            if m == 0:
                columns[:, l * l + l] = scale
            else:
                columns[:, l * l + l + m] = np.sqrt(2) * scale * np.cos(m * azimuth)
                columns[:, l * l + l - m] = np.sqrt(2) * scale * np.sin(m * azimuth)
            before, now = now, ((2 * l + 1) * z * now - (l + m) * before) / (l - m + 1)
    return columns

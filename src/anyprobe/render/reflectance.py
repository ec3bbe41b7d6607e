"""Reflectance maps: with distant light and one view direction, radiance depends on the normal alone.

A picture [S, S] over the visible hemisphere of normals (camera frame, wo = +Z), radius
proportional to the angle between n and +Z, so that equal steps turn the mirror direction
equally. One such map serves every shape of that material under that light by a lookup.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core.frames import normalize

LIMIT = 0.995
"""The rim's angle as a share of 90 degrees: at 90 nothing is seen."""


@lru_cache(maxsize=8)
def reflectance_normals(size: int) -> np.ndarray:
    """The normal of every pixel, [S, S, 3]; outside the disc the rim's normal."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    right, up = np.meshgrid(x, -x)
    radius = np.hypot(right, up)
    theta = np.minimum(radius, LIMIT) * np.pi / 2
    scale = np.sin(theta) / np.maximum(radius, 1e-9)
    return np.stack([right * scale, up * scale, np.cos(theta)], axis=-1).astype(np.float32)


def reflectance_disc(size: int) -> tuple[np.ndarray, np.ndarray]:
    """reflectance_normals and which pixels lie in the disc, [S, S] bool."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    return reflectance_normals(size), np.hypot(*np.meshgrid(x, x)) < 1


def normal_to_reflectance_xy(n):
    """Where a normal lies in a reflectance map: (x right, y down) in [-1, 1], [..., 3] -> [..., 2]."""
    xp = array_namespace(n)
    sine = xp.sqrt(xp.clip(n[..., 0] ** 2 + n[..., 1] ** 2, 1e-12, None))
    radius = xp.atan2(sine, n[..., 2]) / (np.pi / 2)
    radius = xp.clip(radius, None, LIMIT)
    return xp.stack([n[..., 0] / sine * radius, -n[..., 1] / sine * radius], axis=-1)


def straight_on_normal(n, wo):
    """The normal that, seen along +Z, mirrors the direction that n mirrors seen from wo.

    It stands for n in the specular terms when the view is perspective: the lobe's
    centre is then exact, its shape and Fresnel term only nearly so.
    """
    reflected = (
        2.0 * (n[..., 0:1] * wo[..., 0:1] + n[..., 1:2] * wo[..., 1:2] + n[..., 2:3] * wo[..., 2:3]) * n - wo
    )
    xp = array_namespace(n)
    forward = xp.stack([reflected[..., 0], reflected[..., 1], reflected[..., 2] + 1.0], axis=-1)
    return normalize(forward)

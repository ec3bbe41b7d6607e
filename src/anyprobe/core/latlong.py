"""The equirectangular map: H x 2H, row 0 up (+Y), the centre column is -Z.

u = 0.5 + atan2(x, -z) / 2 pi and v = acos(y) / pi; pixel centres at (i + 0.5) / N.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from array_api_compat import array_namespace

from anyprobe.core import Float

KEPT_ROWS = 512
"""Largest number of rows whose directions are cached."""


def direction_to_uv(d):
    """Convert unit directions [..., 3] to map coordinates [..., 2], u in [0, 1], v in [0, 1]."""
    xp = array_namespace(d)
    u = 0.5 + xp.atan2(d[..., 0], -d[..., 2]) / (2.0 * np.pi)
    v = xp.acos(xp.clip(d[..., 1], -1.0, 1.0)) / np.pi
    return xp.stack([u, v], axis=-1)


def uv_to_direction(uv):
    """Convert map coordinates [..., 2] to unit directions [..., 3]; inverse of direction_to_uv."""
    xp = array_namespace(uv)
    phi = 2.0 * np.pi * (uv[..., 0] - 0.5)
    theta = np.pi * uv[..., 1]
    sin_theta = xp.sin(theta)
    return xp.stack([sin_theta * xp.sin(phi), xp.cos(theta), -sin_theta * xp.cos(phi)], axis=-1)


def pixel_directions(height: int) -> Float[np.ndarray, "H 2*H 3"]:
    """Return the direction of every pixel centre, [H, 2H, 3]."""
    return _kept_directions(height).copy() if height <= KEPT_ROWS else _directions(height)


def _directions(height: int) -> np.ndarray:
    u = (np.arange(2 * height) + 0.5) / (2 * height)
    v = (np.arange(height) + 0.5) / height
    return uv_to_direction(np.stack(np.meshgrid(u, v), axis=-1)).astype(np.float32)


_kept_directions = lru_cache(maxsize=4)(_directions)


def pixel_solid_angles(height: int) -> Float[np.ndarray, "H 1"]:
    """Return the solid angle [sr] of a pixel of each row, [H, 1]; exact band integral: the sum is 4 pi to rounding.

    (phi step) x (cos of the upper edge - cos of the lower edge); the midpoint rule sin(theta) dtheta dphi misses it.
    """
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    return ((edges[:-1] - edges[1:]) * np.pi / height)[:, None].astype(np.float32)


def bilinear(image, uv):
    """Interpolate a map [H, 2H, C] at uv [..., 2]: [..., C]; wraps in u, clamps at the poles."""
    xp = array_namespace(image, uv)
    height, width = image.shape[0], image.shape[1]
    x = uv[..., 0] * width - 0.5
    y = xp.clip(uv[..., 1] * height - 0.5, 0.0, height - 1.0)
    x0, y0 = xp.floor(x), xp.floor(y)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    column0 = xp.astype(x0, xp.int64) % width
    column1 = (column0 + 1) % width
    row0 = xp.astype(y0, xp.int64)
    row1 = xp.clip(row0 + 1, None, height - 1)
    flat = xp.reshape(image, (height * width, image.shape[2]))

    def read(row, column):
        index = xp.reshape(row * width + column, (-1,))
        return xp.reshape(xp.take(flat, index, axis=0), (*row.shape, image.shape[2]))

    upper = read(row0, column0) * (1 - fx) + read(row0, column1) * fx
    lower = read(row1, column0) * (1 - fx) + read(row1, column1) * fx
    return upper * (1 - fy) + lower * fy


def corners(column, row, width, start=0) -> list:
    """Return the four pixels around fractional (column, row) in a flat picture of this width, whose first pixel is at
    start: index pairs (int32) and shares. Columns and rows are of one shape, at least 0 and below the last."""
    xp = array_namespace(column)
    column0, row0 = xp.floor(column), xp.floor(row)
    right, down = column - column0, row - row0
    first = xp.astype(start + row0 * width + column0, xp.int32)
    below = first + (width if isinstance(width, int) else xp.astype(width, xp.int32))
    return [
        (first, (1.0 - right) * (1.0 - down)),
        (first + 1, right * (1.0 - down)),
        (below, (1.0 - right) * down),
        (below + 1, right * down),
    ]

"""From what rivals estimate to maps: a mirror ball's picture, or mirror values of an object's pixels."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.frames import normalize, reflect
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.render.reflectance import normal_to_reflectance_xy


@lru_cache(maxsize=1)
def _ball_xy() -> np.ndarray:
    """Where each direction of the map lies on the ball's picture, [64, 128, 2] in [-1, 1], y down."""
    d = pixel_directions(MAP_HEIGHT)
    return normal_to_reflectance_xy(normalize(d + np.array([0, 0, 1 + 1e-6], np.float32)))


def unwrap_ball(ball: np.ndarray) -> np.ndarray:
    """Mirror ball [S, S, C], drawn as render.reflectance draws normals -> map [64, 128, C]."""
    size = ball.shape[0]
    place = ((_ball_xy() + 1) / 2 * size - 0.5).clip(0, size - 1)
    low = np.minimum(np.floor(place).astype(int), size - 2)
    fx, fy = np.moveaxis(place - low, -1, 0)[..., None]
    x, y = low[..., 0], low[..., 1]
    upper = ball[y, x] * (1 - fx) + ball[y, x + 1] * fx
    lower = ball[y + 1, x] * (1 - fx) + ball[y + 1, x + 1] * fx
    return (upper * (1 - fy) + lower * fy).astype(np.float32)


def unwrap_mirror(values: np.ndarray, normals: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """Mirror values [P, C] of pixels with normals and wo [P, 3] -> map [64, 128, C], holes filled.

    Pixels that fall on one another are averaged; holes by push_pull.
    """
    uv = direction_to_uv(reflect(wo, normals))
    column = np.clip((uv[:, 0] * 2 * MAP_HEIGHT).astype(int), 0, 2 * MAP_HEIGHT - 1)
    row = np.clip((uv[:, 1] * MAP_HEIGHT).astype(int), 0, MAP_HEIGHT - 1)
    sums = np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, values.shape[1]))
    count = np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, 1))
    np.add.at(sums, (row, column), values)
    np.add.at(count, (row, column), 1.0)
    return push_pull(sums / np.maximum(count, 1.0), count > 0)


def push_pull(values: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Fill a map's holes from ever coarser means of what is known (Grossman and Dally 1998).

    Args:
        values: [H, 2H, C], anything where not known; H a power of two.
        known: [H, 2H, 1] bool.
    Returns:
        [H, 2H, C] float32; what was known is unchanged. Nothing known gives zeros.
    """
    weight = known * pixel_solid_angles(values.shape[0]).astype(np.float64)[..., None]
    return _fill(np.where(known, values, 0.0), weight, known).astype(np.float32)


def _fill(values: np.ndarray, weight: np.ndarray, known: np.ndarray) -> np.ndarray:
    height = values.shape[0]
    if known.all() or not known.any():
        return values
    if height == 1:
        return np.where(known, values, (values * weight).sum(axis=1, keepdims=True) / weight.sum())
    below = weight.reshape(height // 2, 2, height, 2, 1).sum(axis=(1, 3))
    sums = (values * weight).reshape(height // 2, 2, height, 2, -1).sum(axis=(1, 3))
    coarse = _fill(sums / np.maximum(below, 1e-300), below, below > 0)
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    return np.where(known, values, bilinear(coarse, np.stack([u, v], axis=-1)))

"""Light made the estimate's by a smooth gain of what is not seen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.light.harmonics import project, sh_basis

MOST_GAIN = np.log(6.0)
"""Bound of the gain's logarithm."""
NEWTON_STEPS = 12


def with_moments(free: np.ndarray, fixed: np.ndarray, goal: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Return the light [R, 2R, 3] of `free`, changed, and of `fixed`, with the harmonics [9, 3] of goal.

    The gain exp(s(d) sum of c_i Y_i(d)) of free, with s the strength [R, 2R, 1], is the nearest to 1 of all gains that
    reach the goal.
    """
    small, held = (reduced(one, MAP_HEIGHT).astype(np.float64) for one in (free, fixed))
    force = reduced(strength, MAP_HEIGHT)[..., 0].reshape(-1).astype(np.float64)
    gain = _gain(small, goal - project(held.astype(np.float32)), force)
    changed = free * enlarged_map(gain.astype(np.float32), len(free))
    return fixed + changed * _residual(changed, goal - project(fixed + changed), force)


def enlarged_map(values: np.ndarray, rows: int) -> np.ndarray:
    """Resize a map [h, 2h, C] to `rows` rows, more (smoothly) or fewer."""
    if len(values) >= rows:
        return reduced(values, rows)
    return np.ascontiguousarray(np.moveaxis(enlarged_planes(np.moveaxis(values, -1, 0), rows), 0, -1)).astype(
        np.float32
    )


def _gain(light: np.ndarray, lack: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the gain [64, 128, 3] of light that gives it the harmonics lack [9, 3].

    Found by Newton's method on sum of light exp(s Y c) / s - c . lack, which is convex.
    """
    y, areas = _basis()
    coefficients = np.stack([_newton(light[..., k].reshape(-1) * areas, y, force, lack[:, k]) for k in range(3)], 1)
    gain = np.exp(np.clip(force[:, None] * (y @ coefficients), -MOST_GAIN, MOST_GAIN))
    return gain.reshape(light.shape)


def _residual(light: np.ndarray, lack: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return the factor [R, 2R, 3] of light that adds the small harmonics lack [9, 3]."""
    y, areas = _basis()
    small = reduced(light.astype(np.float32), MAP_HEIGHT).astype(np.float64)
    factor = np.empty((len(y), 3))
    for k in range(3):
        gram = (y * (force * small[..., k].reshape(-1) * areas)[:, None]).T @ y
        step = np.linalg.solve(gram + (1e-6 * np.trace(gram) + 1e-9) * np.eye(9), lack[:, k])
        factor[:, k] = 1.0 + np.clip(force * (y @ step), -0.5, 0.5)
    return enlarged_map(factor.reshape(small.shape).astype(np.float32), len(light))


@lru_cache(maxsize=1)
def _basis() -> tuple[np.ndarray, np.ndarray]:
    """Return harmonics [8192, 9] and solid angles [8192] of a map's pixels."""
    y = sh_basis(pixel_directions(MAP_HEIGHT)).reshape(-1, 9).astype(np.float64)
    return y, np.repeat(pixel_solid_angles(MAP_HEIGHT), 2 * MAP_HEIGHT, axis=1).reshape(-1).astype(np.float64)


def _newton(light: np.ndarray, y: np.ndarray, force: np.ndarray, lack: np.ndarray) -> np.ndarray:
    """Solve for the coefficients [9] of one channel."""
    c = np.zeros(9)
    for _ in range(NEWTON_STEPS):
        gained = light * np.exp(np.clip(force * (y @ c), -MOST_GAIN, MOST_GAIN))
        rest = lack - gained @ y
        gram = (y * (force * gained)[:, None]).T @ y
        step = np.linalg.solve(gram + (1e-5 * np.trace(gram) + 1e-9) * np.eye(9), rest)
        largest = np.abs(y @ step).max()
        c = c + step * min(1.0, 0.7 / max(largest, 1e-9))
        if np.abs(rest).max() < 1e-4 * max(np.abs(lack).max(), 1e-6):
            break
    return c


@lru_cache(maxsize=8)
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


def enlarged_planes(planes: np.ndarray, rows: int) -> np.ndarray:
    """Enlarge smooth values [3, h, 2h] to [3, rows, 2 rows]; beyond a pole lies the opposite side."""
    height, width = planes.shape[1:]
    if rows == height:
        return planes
    beyond = np.roll(planes, width // 2, axis=2)
    tall = np.concatenate([beyond[:, 1::-1], planes, beyond[:, :-3:-1]], axis=1)
    padded = np.concatenate([tall[:, :, -2:], tall, tall[:, :, :2]], axis=2)
    return _spline(height, rows) @ padded @ _spline(width, 2 * rows).T

"""Light made the estimate's by a smooth gain of what is not seen."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.light.harmonics import project, sh_basis
from anyprobe.place.enlarge import enlarged_map

MOST_GAIN = np.log(6.0)
"""Bound of the gain's logarithm."""
NEWTON_STEPS = 12


def with_moments(free: np.ndarray, fixed: np.ndarray, goal: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Return the light [R, 2R, 3] of `free`, changed, and of `fixed`, with the harmonics [9, 3] of goal.

    The gain exp(s(d) sum of c_i Y_i(d)) of free, with s the strength [R, 2R, 1], is the nearest to 1 of all gains that
    reach the goal.
    """
    small, held, force = (reduced(one, MAP_HEIGHT).astype(np.float64) for one in (free, fixed, strength))
    y, areas = _basis()
    wanted = luminance(goal.astype(np.float64))
    light = luminance(small).reshape(-1) * areas
    force = force.reshape(-1)
    c = _newton(light, y, force, wanted - luminance(project(held.astype(np.float32)).astype(np.float64)))
    gain = np.exp(np.clip(force * (y @ c), -MOST_GAIN, MOST_GAIN))
    changed = free * enlarged_map(gain.astype(np.float32).reshape(*small.shape[:2], 1), len(free))
    light = luminance(reduced(changed, MAP_HEIGHT).astype(np.float64)).reshape(-1) * areas
    gram = (y * (force * light)[:, None]).T @ y
    lack = wanted - luminance(project(fixed + changed).astype(np.float64))
    step = np.linalg.solve(gram + (1e-6 * np.trace(gram) + 1e-9) * np.eye(9), lack)
    factor = (1.0 + np.clip(force * (y @ step), -0.5, 0.5)).astype(np.float32)
    return fixed + changed * enlarged_map(factor.reshape(*small.shape[:2], 1), len(changed))


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

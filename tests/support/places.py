"""Made-up surroundings with sharp detail."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import pixel_directions


def place(seed: int, height: int = 128) -> np.ndarray:
    """A bright sky over a dark ground with a lamp, and detail of a few degrees all over."""
    return _drawn(seed, height).copy()


@lru_cache
def _drawn(seed: int, height: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    d = pixel_directions(height).astype(np.float64)
    smooth = sum(np.sin(d @ rng.normal(0, 2.5, 3) + rng.uniform(0, 6)) for _ in range(6))
    fine = sum(np.sin(d @ rng.normal(0, 22, 3) + rng.uniform(0, 6)) for _ in range(8))
    up = np.where(d[..., 1] > 0.05 * np.sin(5 * d[..., 0]), 0.5, 0.12)
    at = world_from_camera(rng.uniform(0, 6.28), rng.uniform(-0.9, -0.3)) @ [0, 0, -1]
    lamp = 30.0 * (d @ at > np.cos(0.12))
    radiance = (up * np.exp(0.25 * smooth + 0.35 * np.sign(fine)) + lamp)[..., None] * [1.0, 0.95, 0.9]
    return radiance.astype(np.float32)

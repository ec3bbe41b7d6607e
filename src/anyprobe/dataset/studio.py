"""Studios, and the soft lamps that they and other maps are made of."""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.dataset.catalog import normalize_map


def tint(rng: np.random.Generator, strength: float) -> np.ndarray:
    """A random colour [3] of mean 1."""
    color = np.exp(rng.normal(0.0, strength, size=3))
    return color / color.mean()


def direction_at(azimuth: float, elevation: float) -> np.ndarray:
    """Unit vector [3]; azimuth 0 is -Z, a quarter turn +X."""
    c = np.cos(elevation)
    return np.array([c * np.sin(azimuth), np.sin(elevation), -c * np.cos(azimuth)])


def soft_cap(d: np.ndarray, centre: np.ndarray, radius: float, softness: float = 0.15) -> np.ndarray:
    """1 inside a cap of the given radius [radians], falling off over softness x radius: [..., 1]."""
    angle = np.arccos(np.clip(d @ centre, -1.0, 1.0))
    return np.clip((radius - angle) / (softness * radius) + 0.5, 0.0, 1.0)[..., None]


def soft_box(d: np.ndarray, centre: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """1 inside an upright rectangle a unit away of half width and height extent [2]: [..., 1]."""
    right = np.cross(centre, [0, 1, 0])
    right /= np.linalg.norm(right)
    top = np.cross(right, centre)
    toward = np.maximum(d @ centre, 1e-6)
    x, y = (d @ right) / toward, (d @ top) / toward
    return ((np.abs(x) < extent[0]) & (np.abs(y) < extent[1]) & (d @ centre > 0))[..., None]


def studio(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """A dim surround with a few soft boxes and round lamps; mean luminance 1."""
    d = pixel_directions(height).astype(np.float64)
    up = d[..., 1:2] * 0.5 + 0.5
    radiance = rng.uniform(0.02, 0.25) * (tint(rng, 0.1) * (1 - up) + tint(rng, 0.1) * up)
    for _ in range(rng.integers(1, 6)):
        centre = direction_at(rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 1.45))
        power = np.exp(rng.uniform(np.log(2.0), np.log(60.0))) * tint(rng, 0.15)
        if rng.random() < 0.5:
            radiance = radiance + power * soft_cap(d, centre, rng.uniform(0.06, 0.5))
        else:
            radiance = radiance + power * soft_box(d, centre, rng.uniform(0.1, 0.7, size=2))
    return normalize_map(radiance)

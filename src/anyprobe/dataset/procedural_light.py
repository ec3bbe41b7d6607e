"""Maps the project makes itself: rooms, skies and studios, [H, 2H, 3] with mean luminance 1."""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.dataset.catalog import normalize_map


def _tint(rng: np.random.Generator, strength: float) -> np.ndarray:
    color = np.exp(rng.normal(0.0, strength, size=3))
    return color / color.mean()


def _cap(d: np.ndarray, centre: np.ndarray, radius: float, softness: float = 0.15) -> np.ndarray:
    """1 inside a cap of the given radius [radians], falling off over softness x radius."""
    angle = np.arccos(np.clip(d @ centre, -1.0, 1.0))
    return np.clip((radius - angle) / (softness * radius) + 0.5, 0.0, 1.0)[..., None]


def _unit(azimuth: float, elevation: float) -> np.ndarray:
    c = np.cos(elevation)
    return np.array([c * np.sin(azimuth), np.sin(elevation), -c * np.cos(azimuth)])


def sky(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """A gradient sky with a sun or clouds over a ground of one colour."""
    d = pixel_directions(height).astype(np.float64)
    up = d[..., 1:2]
    zenith = np.array([0.25, 0.45, 1.0]) * rng.uniform(0.4, 1.2)
    horizon = np.array([0.9, 0.95, 1.0]) * rng.uniform(0.6, 1.4) * _tint(rng, 0.1)
    blend = np.clip(up, 0, 1) ** rng.uniform(0.3, 0.8)
    radiance = horizon * (1 - blend) + zenith * blend
    cloud = np.zeros(d.shape[:2])
    for _ in range(12):
        k = rng.normal(size=3) * rng.uniform(1.5, 9.0)
        cloud += np.sin(d @ k + rng.uniform(0, 6.28)) / np.linalg.norm(k)
    cover = np.clip(cloud * rng.uniform(0.5, 2.0) + rng.uniform(-0.5, 0.5), 0, 1)[..., None]
    radiance = radiance * (1 - cover) + rng.uniform(0.7, 1.5) * cover
    sun = _unit(rng.uniform(0, 2 * np.pi), rng.uniform(0.05, 1.4))
    power = rng.choice([0.0, 1.0, 1.0]) * np.exp(rng.uniform(np.log(0.3), np.log(8.0)))  # E / E of the sky
    radius = np.radians(rng.uniform(0.6, 2.0))
    warm = np.array([1.0, 0.9 - 0.3 * (1 - sun[1]), 0.75 - 0.5 * (1 - sun[1])])
    radiance = radiance + power * np.pi / (np.pi * radius**2) * warm * _cap(d, sun, radius)
    glow = np.clip(d @ sun, 0, 1)[..., None] ** rng.uniform(8, 60)
    radiance = radiance + power * rng.uniform(0.1, 0.8) * warm * glow
    ground = rng.uniform(0.05, 0.5) * _tint(rng, 0.25) * (0.6 + power * sun[1])
    texture = 1 + 0.3 * np.sin(6 * d[..., :1] / (np.abs(up) + 0.15)) * np.sin(
        6 * d[..., 2:] / (np.abs(up) + 0.15)
    )
    radiance = np.where(up < rng.uniform(-0.05, 0.15), ground * texture, radiance)
    return normalize_map(np.maximum(radiance, 0.0))


def room(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """Inside a box: six coloured walls, windows and lamps as bright rectangles, soft fall-off."""
    d = pixel_directions(height).astype(np.float64)
    half = rng.uniform([1.5, 1.1, 1.5], [5.0, 2.2, 5.0])
    offset = rng.uniform(-0.5, 0.5, size=3) * half * np.array([1, 0.6, 1])
    yaw = rng.uniform(0, 2 * np.pi)
    c, s = np.cos(yaw), np.sin(yaw)
    d = d @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    with np.errstate(divide="ignore"):
        t = np.where(d > 0, (half - offset) / d, (-half - offset) / d)
    axis = np.argmin(t, axis=-1)
    distance = np.take_along_axis(t, axis[..., None], axis=-1)
    point = offset + d * distance
    face = axis * 2 + (np.take_along_axis(d, axis[..., None], axis=-1)[..., 0] > 0)
    walls = rng.uniform(0.2, 0.9, size=(6, 1)) * np.stack([_tint(rng, 0.15) for _ in range(6)])
    walls[2] *= rng.uniform(0.2, 0.8)  # floors are darker
    albedo = walls[face]
    for _ in range(rng.integers(4, 14)):  # furniture, pictures, doors
        albedo = np.where(
            _rectangle(point, face, half, rng, rng.integers(6), 0.7),
            rng.uniform(0.05, 1.0) * _tint(rng, 0.4),
            albedo,
        )
    ambient, emission = np.full((*face.shape, 1), rng.uniform(0.05, 0.3)), np.zeros_like(albedo)
    for _ in range(rng.integers(1, 6)):
        where = rng.choice([0, 1, 3, 3, 4, 5])
        size = rng.choice([0.15, 0.35, 0.6])
        inside = _rectangle(point, face, half, rng, where, size)
        power = np.exp(rng.uniform(np.log(3.0), np.log(120.0))) * (0.3 / size)
        emission = np.where(inside, power * _tint(rng, 0.2), emission)
        if inside.any():
            source = point[inside[..., 0]].mean(axis=0)
            away = ((point - source) ** 2).sum(axis=-1, keepdims=True)
            ambient = ambient + power * inside.mean() * 2.0 / (0.5 + away)
    return normalize_map(np.where(emission > 0, emission, albedo * ambient))


def _rectangle(point, face, half, rng, where: int, size: float) -> np.ndarray:
    """Whether the point lies in a random rectangle on wall `where`, [H, 2H, 1]."""
    a, b = [(1, 2), (0, 2), (0, 1)][where // 2]
    centre = rng.uniform(-0.8, 0.8, size=2) * half[[a, b]]
    extent = np.abs(rng.normal(0, 1, size=2)).clip(0.2, 1.5) * size * half[[a, b]] * 0.7
    inside = (np.abs(point[..., a] - centre[0]) < extent[0]) & (np.abs(point[..., b] - centre[1]) < extent[1])
    return (inside & (face == where))[..., None]


def studio(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """A dim surround with a few soft boxes and round lamps."""
    d = pixel_directions(height).astype(np.float64)
    up = d[..., 1:2] * 0.5 + 0.5
    radiance = rng.uniform(0.02, 0.25) * (_tint(rng, 0.1) * (1 - up) + _tint(rng, 0.1) * up)
    for _ in range(rng.integers(1, 6)):
        centre = _unit(rng.uniform(0, 2 * np.pi), rng.uniform(-0.2, 1.45))
        power = np.exp(rng.uniform(np.log(2.0), np.log(60.0))) * _tint(rng, 0.15)
        if rng.random() < 0.5:
            radiance = radiance + power * _cap(d, centre, rng.uniform(0.06, 0.5))
        else:
            right = np.cross(centre, [0, 1, 0])
            right /= np.linalg.norm(right)
            top = np.cross(right, centre)
            toward = np.maximum(d @ centre, 1e-6)
            x, y = (d @ right) / toward, (d @ top) / toward
            box = (np.abs(x) < rng.uniform(0.1, 0.7)) & (np.abs(y) < rng.uniform(0.1, 0.7)) & (d @ centre > 0)
            radiance = radiance + power * box[..., None]
    return normalize_map(radiance)


def draw_map(rng: np.random.Generator, height: int = 256) -> tuple[np.ndarray, bool]:
    """One map of a random family and whether it is indoor."""
    kind = rng.integers(3)
    return [sky, room, studio][kind](rng, height), bool(kind > 0)

"""Pictures of balls of some material under a map, which is their background too."""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import reflect
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response
from anyprobe.light.filtering import irradiance_map

FOV = 60.0


def rich_map() -> np.ndarray:
    """[64, 128, 3]: fine structure all around."""
    noise = np.random.default_rng(4).normal(0, 1, (16, 32, 3))
    d = direction_to_uv(pixel_directions(64))
    return np.exp(0.9 * bilinear(noise, d) - 1.2).astype(np.float32)


def ball_photo(radiance: np.ndarray, kind: str, fov_deg: float = FOV) -> tuple[np.ndarray, np.ndarray]:
    """uint8 [240, 320, 3] and mask of a ball under a map, which is its background too."""
    height, width = 240, 320
    focal = width / 2 / np.tan(np.radians(fov_deg) / 2)
    y, x = np.mgrid[:height, :width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    axis, radius = np.array([0.05, -0.08, -1.0]) / np.linalg.norm([0.05, -0.08, -1.0]), 0.22
    along = d @ axis
    inside = along**2 - 1 + radius**2
    on = inside > 0
    n = (((along - np.sqrt(np.maximum(inside, 0)))[..., None] * d - axis) / radius)[on]
    picture = bilinear(radiance, direction_to_uv(d))
    if kind == "mirror":
        picture[on] = 0.8 * bilinear(radiance, direction_to_uv(reflect(-d[on], n)))
    else:
        stripes = 0.5 + 0.45 * np.sign(np.sin(12.0 * n @ [0.6, 0.8, 0.0]))[:, None] if kind == "painted" else 0.6
        picture[on] = stripes * bilinear(irradiance_map(radiance), direction_to_uv(n)) / np.pi
    return np.round(response(picture) * 255).astype(np.uint8), on.astype(np.float32)

"""Drawn photos: a shaded sphere under a small made map, anywhere in a picture."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.render.spheres import diffuse, sphere_normals

HEIGHT, WIDTH, DIAMETER = 96, 128, 64
CENTER = (64, 48)


@lru_cache(maxsize=1)
def made_map() -> np.ndarray:
    """[16, 32, 3]: a blue sky over brown ground and a warm emitter at the upper left."""
    d = pixel_directions(16)
    sky = np.where(d[..., 1:2] > 0, [0.25, 0.3, 0.4], [0.15, 0.1, 0.08])
    toward = np.array([-0.6, 0.6, 0.5]) / np.linalg.norm([-0.6, 0.6, 0.5])
    emitter = (d @ toward > np.cos(np.radians(20)))[..., None] * np.array([7.0, 6.0, 5.0])
    return (sky + emitter).astype(np.float32)


@lru_cache(maxsize=8)
def _sphere(diameter: int) -> np.ndarray:
    return response(diffuse(made_map(), diameter))


def sphere_photo(
    center: tuple[int, int] = CENTER, diameter: int = DIAMETER, height: int = HEIGHT, width: int = WIDTH
) -> np.ndarray:
    """[H, W, 4] uint8: the sphere at x, y over a dull background, and alpha 255 on the sphere."""
    rows, columns = np.mgrid[0:height, 0:width]
    photo = np.zeros((height, width, 4), np.float32)
    photo[..., 2] = 0.1 + 0.2 * columns / width
    photo[..., 1] = 0.1 * rows / height
    left, top = center[0] - diameter // 2, center[1] - diameter // 2
    on = sphere_normals(diameter)[1]
    window = photo[top : top + diameter, left : left + diameter]  # a view
    window[on, :3] = _sphere(diameter)[on]
    window[on, 3] = 1.0
    return to_bytes(photo)

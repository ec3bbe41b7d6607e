"""Transport matrices: what a scene shows under any map is one matrix times the map's pixels.

Light is distant and single-bounce, so a picture of P points under a map of Q pixels is
T [P, Q] @ L [Q, 3]. Every entry is reflectance times cosine times the pixel's solid angle at
the pixel's centre: exact for maps that are constant over pixels much narrower than the lobe.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from anyprobe.core.frames import rotation_x
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import reduced
from anyprobe.paper.equations import ggx_distribution, schlick_weight, smith_visibility
from anyprobe.render.spheres import sphere_normals

CHUNK = 64
ARRAY_SIZE = (48, 80)
"""Rows and columns of the picture of nine spheres."""
ARRAY_ROWS = 32
"""Rows of the maps that light it."""
ARRAY_ALBEDO = 0.8


def light(matrix: np.ndarray, maps: Sequence[np.ndarray]) -> list[np.ndarray]:
    """T [P, Q] times each of M maps [H, 2H, 3] with H * 2H = Q: M pictures [P, 3].

    All maps go through one product, since the matrix is what costs time to read.
    """
    columns = np.concatenate([one.reshape(-1, 3) for one in maps], axis=1).astype(np.float32)
    return np.split(matrix @ columns, len(maps), axis=1)


def reflectance_matrix(
    normals: np.ndarray,
    wo: np.ndarray,
    height: int,
    *,
    albedo: float = 0.0,
    f0: float = 0.0,
    alpha: float | None = None,
) -> np.ndarray:
    """T of points with normals [P, 3] seen along wo [P, 3] (towards the eye), grey materials, no shadows.

    albedo: of a Lambert base, lessened by the coat's Schlick term as in the paper's Eq. 2.
    f0, alpha: of a GGX coat; alpha None has none.
    """
    wi = pixel_directions(height).reshape(-1, 3)
    solid_angle = np.broadcast_to(pixel_solid_angles(height), (height, 2 * height)).reshape(-1)
    matrix = np.empty((len(normals), len(wi)), np.float32)
    for first in range(0, len(normals), CHUNK):
        n, eye = normals[first : first + CHUNK], wo[first : first + CHUNK]
        cosine = n @ wi.T
        above = np.maximum(cosine, 0.0)
        if alpha is None:
            value = np.full_like(cosine, albedo / np.pi)
        else:
            h = wi[None] + eye[:, None]
            length = np.maximum(np.linalg.norm(h, axis=-1), 1e-6)
            s = schlick_weight(0.5 * length)  # |wo + wi| = 2 wo.h
            fresnel = f0 + (1.0 - f0) * s
            n_dot_h = np.einsum("pqk,pk->pq", h, n) / length
            n_dot_wo = np.maximum((n * eye).sum(axis=-1), 1e-4)[:, None]
            coat = ggx_distribution(n_dot_h, alpha) * smith_visibility(n_dot_wo, above, alpha) * fresnel
            value = coat + albedo / np.pi * (1.0 - fresnel)
        matrix[first : first + CHUNK] = value * above * solid_angle
    return matrix


@lru_cache(maxsize=8)
def sphere_matrix(
    height: int, size: int, albedo: float = 0.0, f0: float = 0.0, alpha: float | None = None
) -> np.ndarray:
    """reflectance_matrix of the sphere of render.spheres, seen along -Z; one row a pixel inside it."""
    normals, _ = sphere_normals(size)
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape)
    return reflectance_matrix(normals, wo, height, albedo=albedo, f0=f0, alpha=alpha)


@lru_cache(maxsize=1)
def array_matrix() -> np.ndarray:
    """T of nine Lambert spheres standing 3 x 3 on a Lambert plane, [48 * 80, 32 * 64].

    Spheres and plane hide the light from each other; light that bounces twice is left out. The
    camera looks 25 degrees down, straight ahead along -Z.
    """
    rows, columns = ARRAY_SIZE
    centers = np.array([[2.6 * i, 1.0, 2.6 * j] for j in (-1, 0, 1) for i in (-1, 0, 1)])
    origin = np.array([0.0, 0.0, 30.0]) @ rotation_x(np.radians(-25.0)).T
    x = (np.arange(columns) + 0.5) / columns * 2 - 1
    y = ((np.arange(rows) + 0.5) / rows * 2 - 1) * rows / columns
    right, up = np.meshgrid(x * 0.17, -y * 0.17 + 0.035)
    ray = np.stack([right, up, -np.ones_like(right)], axis=-1).reshape(-1, 3) @ rotation_x(np.radians(-25.0)).T
    ray /= np.linalg.norm(ray, axis=1, keepdims=True)
    point, normal, there = _first_hit(origin, ray, centers)
    wi = pixel_directions(ARRAY_ROWS).reshape(-1, 3).astype(np.float64)
    solid_angle = np.broadcast_to(pixel_solid_angles(ARRAY_ROWS), (ARRAY_ROWS, 2 * ARRAY_ROWS)).reshape(-1)
    cosine = np.maximum(normal @ wi.T, 0.0) * there[:, None] * (wi[:, 1] > 0)
    for center in centers:
        toward = center - point + 1e-9
        along = toward @ wi.T
        away = (toward**2).sum(axis=1, keepdims=True) - along**2
        own = np.abs(np.linalg.norm(toward, axis=1) - 1.0) < 1e-6  # a sphere's own far side is below n.wi
        cosine *= ~((along > 0) & (away < 1.0) & ~own[:, None])
    return (ARRAY_ALBEDO / np.pi * cosine * solid_angle).astype(np.float32)


def _first_hit(origin: np.ndarray, ray: np.ndarray, centers: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and normals [P, 3] of what rays meet first, unit spheres or the plane y = 0, and whether any."""
    distance = np.where(ray[:, 1] < 0, -origin[1] / np.minimum(ray[:, 1], -1e-9), np.inf)
    normal = np.broadcast_to(np.array([0.0, 1.0, 0.0]), ray.shape).copy()
    for center in centers:
        toward = center - origin
        along = ray @ toward
        inside = 1.0 - (toward @ toward - along**2)
        near = along - np.sqrt(np.maximum(inside, 0.0))
        hit = (inside > 0) & (near < distance)
        distance = np.where(hit, near, distance)
        normal[hit] = origin + near[hit, None] * ray[hit] - center
    there = np.isfinite(distance)
    return origin + np.where(there, distance, 0.0)[:, None] * ray, normal, there


def array_of_spheres(maps: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Linear pictures [48, 80, 3] of the nine spheres under maps [H, 2H, 3], H a multiple of 32."""
    seen = light(array_matrix(), [reduced(one, ARRAY_ROWS) for one in maps])
    return [picture.reshape(*ARRAY_SIZE, 3) for picture in seen]

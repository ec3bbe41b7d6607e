"""A picture of a mesh under a map: linear radiance and coverage, split-sum shading, soft edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import reduced
from anyprobe.render.by_maps import radiance_by_maps
from anyprobe.render.integrate import PATCHES, shade, shading_pyramid
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera, see
from anyprobe.scatter.brdf import Material

NUM_SAMPLES = 64
SUPERSAMPLE = 3
CHUNK = 4096
MAPS_FROM = 0.3
"""Materials of this alpha or more are looked up in reflectance maps of side MAP_SIZE if points are more."""
MAP_SIZE = 48
LIGHT_ROWS = 256
"""Rows of the light that is drawn with: a pyramid reads a larger map at points, and misses what lies between."""


def draw_mesh(
    mesh: Mesh,
    camera: Camera,
    radiance: np.ndarray,
    material: Material,
    num_samples: int = NUM_SAMPLES,
    supersample: int = SUPERSAMPLE,
) -> np.ndarray:
    """The mesh as the camera sees it; distant light, nothing shadows anything.

    A pixel's coverage is that of supersample^2 points; it is shaded once, with the mean of their
    normals: by itself, or where that is as good by reflectance maps.

    Args:
        camera: in the mesh's frame.
        radiance: [H, 2H, 3] linear, in the same frame; more than LIGHT_ROWS rows are averaged down.
    Returns:
        [S, S, 4] float32: linear radiance in the map's units, 0 where nothing is, and coverage in [0, 1].
        The radiance is the object's own, not multiplied by the coverage.
    """
    size = camera.size
    fine = see(mesh, replace(camera, size=size * supersample))
    row, column = np.nonzero(fine.mask)
    pixel = row // supersample * size + column // supersample
    count = np.bincount(pixel, minlength=size * size)
    seen = np.nonzero(count)[0]
    n, wo = (_mean_direction(v, pixel, size * size)[seen] for v in (fine.normals, fine.wo))
    turn = np.asarray(camera.world_from_camera, np.float32).T
    n, wo = n @ turn, wo @ turn
    light, u = reduced(np.asarray(radiance, np.float32), LIGHT_ROWS), hammersley(num_samples)
    wide = shading_pyramid(light)
    pyramid = wide if material.alpha >= PATCHES[0][0] else shading_pyramid(light, material.alpha)
    picture = np.zeros((size * size, 4), np.float32)
    picture[:, 3] = count / supersample**2
    if material.alpha >= MAPS_FROM and len(seen) > MAP_SIZE**2:
        picture[seen, :3] = radiance_by_maps(pyramid, n, wo, material, u, u, size=MAP_SIZE, wide=wide)
        return picture.reshape(size, size, 4)
    for some in np.array_split(np.arange(len(seen)), max(1, -(-len(seen) // CHUNK))):
        if len(some):
            shading = shade(pyramid, n[some], wo[some], material.alpha, u, wide=wide)
            picture[seen[some], :3] = shading.radiance(material)
    return picture.reshape(size, size, 4)


def _mean_direction(vectors: np.ndarray, pixel: np.ndarray, count: int) -> np.ndarray:
    """Unit means [count, 3] of the vectors [P, 3] that fall into each pixel [P]."""
    total = np.stack([np.bincount(pixel, vectors[:, k], count) for k in range(3)], axis=-1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.maximum(length, 1e-12)).astype(np.float32)

"""A picture of a mesh under a map: linear radiance and coverage, split-sum shading, soft edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.core import Float
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import reduced
from anyprobe.render.integrate import PATCHES, shade_diffuse, shade_specular, shading_pyramid
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import Camera, see
from anyprobe.scatter.materials import Material

NUM_SAMPLES = 64
"""Samples of a point; wide lobes, whose emitters are patches (integrate.PATCHES), need only half of them."""
SUPERSAMPLE = 3
CHUNK = 4096
CREASE, ALONE_SAMPLES = 0.95, 16
"""Length of the mean of a pixel's unit normals below which they are shaded one by one, with so many samples each: over
a crease of 36 degrees the mean of two faces faces nowhere, and a metal would mirror there what neither face does. So
are normals that vary more than a narrow lobe is wide."""
LIGHT_ROWS = 256
"""Rows of the light that is drawn with: a pyramid samples a larger map at points and misses what lies between."""


def draw_mesh(
    mesh: Mesh,
    camera: Camera,
    radiance: Float[np.ndarray, "H 2*H 3"],
    material: Material,
    num_samples: int = NUM_SAMPLES,
    supersample: int = SUPERSAMPLE,
) -> Float[np.ndarray, "S S 4"]:
    """Draw the mesh as the camera sees it, under distant light and without shadows.

    A pixel's coverage is that of supersample^2 points; it is shaded once, with the mean of their normals, or where
    these vary point by point.

    Args:
        camera: in the mesh's frame.
        radiance: [H, 2H, 3] linear, in the same frame; more than LIGHT_ROWS rows are averaged down.
        num_samples: of a point; half as many of a wide lobe.
    Returns:
        [S, S, 4] float32: linear radiance in the map's units, 0 where there is nothing, and coverage in [0, 1].
        The radiance is the object's own, not multiplied by the coverage.
    """
    size = camera.size
    fine = see(mesh, replace(camera, size=size * supersample))
    row, column = np.nonzero(fine.mask)
    pixel = row // supersample * size + column // supersample
    count = np.bincount(pixel, minlength=size * size)
    point, of_point, share = _shaded_points(fine.normals, pixel, count, max(CREASE, 1.0 - material.alpha**2 / 2))
    n, wo = (_mean_direction(v, point, len(of_point)) for v in (fine.normals, fine.wo))
    turn = np.asarray(camera.world_from_camera, np.float32).T
    n, wo = n @ turn, wo @ turn
    light, is_wide = reduced(np.asarray(radiance, np.float32), LIGHT_ROWS), material.alpha >= PATCHES[0][0]
    u, wide = hammersley(num_samples // 2 if is_wide else num_samples), shading_pyramid(light)
    pyramid = wide if is_wide else shading_pyramid(light, material.alpha)
    picture = np.zeros((size * size, 4), np.float32)
    picture[:, 3] = count / supersample**2
    shaded = np.zeros((len(of_point), 3), np.float32)
    for group, samples in ((share == 1, u), (share < 1, hammersley(ALONE_SAMPLES))):
        for first in range(0, int(group.sum()), CHUNK):
            some = np.flatnonzero(group)[first : first + CHUNK]
            _, specular, grazing = shade_specular(pyramid, n[some], wo[some], material.alpha, samples)
            shaded[some] = material.f0 * specular + (1.0 - material.f0) * grazing
            if np.any(material.albedo):  # a metal has none
                shaded[some] += material.albedo * (1.0 - material.f0) * shade_diffuse(wide, n[some], wo[some], samples)
    for channel in range(3):
        picture[:, channel] = np.bincount(of_point, share * shaded[:, channel], size * size)
    return picture.reshape(size, size, 4)


def _shaded_points(
    normals: Float[np.ndarray, "P 3"], pixel: np.ndarray, count: np.ndarray, crease: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Group samples of unit normals [P, 3], each in a pixel [P] of count [S * S] samples, into points to be shaded.

    Returns:
        The point of each sample [P]; the pixel of each point [N], and its share of that pixel's samples [N].
    """
    total = np.stack([np.bincount(pixel, normals[:, k], len(count)) for k in range(3)], axis=-1)
    is_creased = np.linalg.norm(total, axis=-1) < crease * count
    own = np.where(is_creased[pixel], len(count) + np.arange(len(pixel)), pixel)
    _, first, point, samples = np.unique(own, return_index=True, return_inverse=True, return_counts=True)
    of_point = pixel[first]
    return point, of_point, (samples / count[of_point]).astype(np.float32)


def _mean_direction(vectors: np.ndarray, pixel: np.ndarray, count: int) -> np.ndarray:
    """Return unit means [count, 3] of the vectors [P, 3] that fall into each pixel [P]."""
    total = np.stack([np.bincount(pixel, vectors[:, k], count) for k in range(3)], axis=-1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return (total / np.maximum(length, 1e-12)).astype(np.float32)

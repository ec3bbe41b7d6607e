"""Three spheres under a map: how the light looks on matt, silvery and mirroring things.

The camera is orthographic and looks along -Z, so that wo = +Z for every pixel and
the mirror sphere shows the whole sphere of directions.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from anyprobe.core import Float
from anyprobe.core.frames import reflect
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.render.integrate import shade_specular, shading_pyramid

SPHERE_SIZE = 64
SILVER_ALPHA = 0.3
SILVER_F0 = 0.9
NUM_SAMPLES = 64
WO = np.array([0, 0, 1], np.float32)


@lru_cache(maxsize=4)
def sphere_normals(size: int = SPHERE_SIZE) -> tuple[np.ndarray, np.ndarray]:
    """Return normals [N, 3] of the visible half sphere, row by row, and their mask [S, S], with N pixels set.

    The sphere fills the picture: at pixel centre (x, y) in [-1, 1]^2, y up, the normal is (x, y, sqrt(1 - x^2 - y^2)).
    """
    x = (np.arange(size) + 0.5) / size * 2 - 1
    right, up = np.meshgrid(x, -x)
    squared = right**2 + up**2
    mask = squared < 1
    normals = np.stack([right, up, np.sqrt(np.where(mask, 1 - squared, 0.0))], axis=-1)[mask].astype(np.float32)
    normals.flags.writeable = mask.flags.writeable = False  # the cache's own arrays
    return normals, mask


def _picture(values: np.ndarray, size: int) -> np.ndarray:
    """Put values [N, 3] into a picture [S, S, 3] that is black outside the sphere."""
    picture = np.zeros((size, size, 3), np.float32)
    picture[sphere_normals(size)[1]] = values
    return picture


def diffuse(radiance: Float[np.ndarray, "H 2*H 3"], size: int = SPHERE_SIZE) -> Float[np.ndarray, "S S 3"]:
    """Render a Lambert sphere of albedo 1, Lo = E(n) / pi: [H, 2H, 3] -> [S, S, 3]."""
    normals, _ = sphere_normals(size)
    return _picture(bilinear(irradiance_map(reduced(radiance)), direction_to_uv(normals)) / np.pi, size)


def silver(radiance: Float[np.ndarray, "H 2*H 3"], size: int = SPHERE_SIZE) -> Float[np.ndarray, "S S 3"]:
    """Render a grey GGX conductor, alpha 0.3, f0 0.9: Lo = f0 S1 + (1 - f0) Ss, [H, 2H, 3] -> [S, S, 3]."""
    normals, _ = sphere_normals(size)
    # a larger map would be read at points, and a sun between them lost
    pyramid = shading_pyramid(reduced(radiance), SILVER_ALPHA)
    wo = np.broadcast_to(WO, normals.shape)
    _, s1, ss = shade_specular(pyramid, normals, wo, SILVER_ALPHA, hammersley(NUM_SAMPLES))
    return _picture(SILVER_F0 * s1 + (1 - SILVER_F0) * ss, size)


def mirror(radiance: Float[np.ndarray, "H 2*H 3"], size: int = SPHERE_SIZE) -> Float[np.ndarray, "S S 3"]:
    """Render a perfect mirror, f0 1: Lo = L(reflect(wo, n)), [H, 2H, 3] -> [S, S, 3]."""
    normals, _ = sphere_normals(size)
    return _picture(bilinear(radiance, direction_to_uv(reflect(np.broadcast_to(WO, normals.shape), normals))), size)


def spheres_ev(matte: Float[np.ndarray, "S S 3"]) -> float:
    """Return the exposure [EV], a whole or half one and 0 at most, at which a matte sphere's picture does not clip."""
    return min(0.0, math.floor(-2 * math.log2(max(float(matte.max()), 1e-6))) / 2)


def sphere_images(radiance: Float[np.ndarray, "H 2*H 3"], size: int = SPHERE_SIZE) -> dict[str, np.ndarray]:
    """Render the three spheres, by name: [S, S, 3] each, linear radiance."""
    return {"diffuse": diffuse(radiance, size), "silver": silver(radiance, size), "mirror": mirror(radiance, size)}

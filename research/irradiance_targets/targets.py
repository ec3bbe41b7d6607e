"""What an irradiance network could be asked for (Fig. 4), of a distant sphere: matrices from map pixels to points."""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.scatter.materials import Material
from research.irradiance_targets.transport import TO_EYE, transport

TARGETS = ("importance-weighted", "uniform", "mirror, grey")


def metal_and_irradiance(alpha: float, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows [P, H * 2H] over a map's pixels, of points with normals n [P, 3]: Eq. 3 for f0 = 1, and Eq. 5."""
    radiance, irradiance = transport(n, Material(albedo=np.zeros(3), f0=np.ones(3), alpha=alpha), MAP_HEIGHT)
    return radiance[0], irradiance


def weights(target: str, alpha: float, n: np.ndarray) -> np.ndarray:
    """Rows that sum to 1, [P, H * 2H], for points with normals n [P, 3] seen from +Z.

    importance-weighted: Eq. 5. uniform: every direction above the horizon alike, whatever alpha. mirror: the one that
    a mirror shows.
    """
    if target == TARGETS[0]:
        return metal_and_irradiance(alpha, n)[1]
    wi = pixel_directions(MAP_HEIGHT).reshape(-1, 3).astype(np.float32)
    if target == TARGETS[1]:
        solid = np.broadcast_to(pixel_solid_angles(MAP_HEIGHT), (MAP_HEIGHT, 2 * MAP_HEIGHT)).reshape(-1)
        rows = (n @ wi.T > 0) * solid
        return (rows / rows.sum(axis=1, keepdims=True)).astype(np.float32)
    mirrored = 2 * n[:, 2:] * n - TO_EYE
    rows = np.zeros((len(n), len(wi)), np.float32)
    rows[np.arange(len(n)), np.argmax(mirrored @ wi.T, axis=1)] = 1.0
    return rows


def seen(target: str, alpha: float, radiance: np.ndarray, n: np.ndarray) -> np.ndarray:
    """The target [N, P, 3] of points under maps [N, H, 2H, 3]; the mirror image is grey in all three channels."""
    image = lit(weights(target, alpha, n), radiance)
    if target == TARGETS[2]:
        image = np.repeat((image @ np.array(REC709, np.float32))[..., None], 3, axis=-1)
    return image


def lit(rows: np.ndarray, radiance: np.ndarray) -> np.ndarray:
    """[N, P, 3]: rows [P, H * 2H] times maps [N, H, 2H, 3]."""
    columns = np.moveaxis(radiance, -1, 1).reshape(3 * len(radiance), -1).T
    return np.moveaxis((rows @ columns).T.reshape(len(radiance), 3, -1), 1, -1)

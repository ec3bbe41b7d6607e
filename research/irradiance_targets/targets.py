"""What an irradiance network could be asked for (Fig. 4), of a distant sphere: matrices from map pixels to points."""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import REC709
from anyprobe.core.frames import dot, normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.scatter.microfacet import ggx_distribution, smith_visibility

TARGETS = ("importance-weighted", "uniform", "mirror, grey")
_WO = np.array([0.0, 0.0, 1.0], np.float32)


def mirror_metal(alpha: float, n: np.ndarray) -> np.ndarray:
    """The specular term of Eq. 4 with f0 = 1, rows [P, H * 2H] over a map's pixels, of points with normals n [P, 3]."""
    wi, solid = _pixels()
    n_wi = np.maximum(dot(n[:, None], wi)[..., 0], 0.0)
    n_dot_h = np.maximum(dot(n[:, None], normalize(wi + _WO))[..., 0], 0.0)
    visibility = smith_visibility(np.maximum(n[:, 2:], 1e-3), n_wi, alpha)
    return (ggx_distribution(n_dot_h, alpha) * visibility * n_wi * solid).astype(np.float32)


def _pixels() -> tuple[np.ndarray, np.ndarray]:
    """Directions [1, H * 2H, 3] and solid angles [H * 2H] of a map's pixels."""
    wi = pixel_directions(MAP_HEIGHT).reshape(1, -1, 3).astype(np.float32)
    return wi, np.broadcast_to(pixel_solid_angles(MAP_HEIGHT), (MAP_HEIGHT, 2 * MAP_HEIGHT)).reshape(-1)


def weights(target: str, alpha: float, n: np.ndarray) -> np.ndarray:
    """Rows that sum to 1, [P, H * 2H], for points with normals n [P, 3] seen from +Z.

    importance-weighted: Eq. 5, density D (n.h) / (4 wo.h) of the samples above the horizon. uniform: every direction
    above the horizon alike, whatever alpha. mirror: the one that a mirror shows.
    """
    wi, solid = _pixels()
    above = dot(n[:, None], wi)[..., 0] > 0
    if target == TARGETS[0]:
        h = normalize(wi + _WO)
        n_dot_h = np.maximum(dot(n[:, None], h)[..., 0], 0.0)
        density = ggx_distribution(n_dot_h, alpha) * n_dot_h / (4 * np.maximum(h[..., 2], 1e-3))
    elif target == TARGETS[1]:
        density = np.ones_like(above, np.float32)
    else:
        mirrored = 2 * n[:, 2:] * n - _WO
        nearest = np.argmax(mirrored @ wi[0].T, axis=1)
        density = np.zeros_like(above, np.float32)
        density[np.arange(len(n)), nearest] = 1.0
        return density
    rows = density * above * solid
    return (rows / rows.sum(axis=1, keepdims=True)).astype(np.float32)


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

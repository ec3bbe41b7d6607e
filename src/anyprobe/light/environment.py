"""Operations on a whole radiance map [H, 2H, 3]: checks, sizes, rotations, integrals."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core import Float
from anyprobe.core.contract import contract
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.resample import overlaps
from anyprobe.errors import InvalidEnvironment

MAP_HEIGHT: int = contract("sizes")["map_height"]
"""Rows of every estimated map; the paper leaves the size open."""
SEARCH_ROWS = 128
"""Rows at which a larger map is searched for its dominant light, and blurred."""


def check_radiance(radiance: np.ndarray, name: str = "map") -> Float[np.ndarray, "H 2*H 3"]:
    """Return the map as float32 [H, 2H, 3], or raise InvalidEnvironment."""
    radiance = np.asarray(radiance)
    shape = radiance.shape
    if radiance.ndim != 3 or shape[2] != 3 or shape[1] != 2 * shape[0] or shape[0] == 0:
        raise InvalidEnvironment(
            f"expected width = 2 x height and 3 channels, got shape {shape}; "
            "convert a cube map or mirror sphere to latitude-longitude first",
            source=name,
        )
    if not np.isfinite(radiance).all():
        raise InvalidEnvironment("expected finite radiance, got NaN or infinity; repair the map first", source=name)
    if (radiance < 0).any():
        raise InvalidEnvironment(f"expected radiance >= 0, got {radiance.min():.3g}; repair the map first", source=name)
    return np.asarray(radiance, dtype=np.float32)


def reduced(radiance: Float[np.ndarray, "H 2*H C"], rows: int = SEARCH_ROWS) -> Float[np.ndarray, "R 2*R C"]:
    """Average a map [H, 2H, C] down to at most `rows` rows; the integral over the sphere is kept.

    Meant for operations that cost H^3, such as a blur by an angle, and need no detail; maps of thousands of rows are
    common.
    """
    height = radiance.shape[0]
    if height <= rows:
        return radiance
    weights = pixel_solid_angles(height).astype(np.float64)  # [H, 1]
    down, across = (overlaps(np.linspace(0.0, n * height, n * rows + 1), n * height) for n in (1, 2))
    total = np.stack([down @ (radiance[..., c] * weights) @ across.T for c in range(radiance.shape[2])], axis=-1)
    return (total / ((down @ weights) * (height / rows))[..., None]).astype(radiance.dtype)


def rotate(radiance, rotation):
    """Rotate a map [H, 2H, 3] by an active rotation [3, 3]: new(d) = old(rotation^T d).

    A world-to-camera rotation gives the camera's view.
    """
    xp = array_namespace(radiance)
    directions = pixel_directions(radiance.shape[0]) @ np.asarray(rotation, dtype=np.float32)  # R^T d
    uv = direction_to_uv(directions).astype(np.float32)
    return bilinear(radiance, xp.asarray(uv, device=device(radiance)))


def integral(radiance):
    """Integrate L dOmega over the sphere, [3]."""
    xp = array_namespace(radiance)
    weights = xp.asarray(pixel_solid_angles(radiance.shape[0]), dtype=radiance.dtype, device=device(radiance))
    return xp.sum(xp.sum(radiance * weights[:, :, None], axis=1), axis=0)


def enlarged_map(values: np.ndarray, rows: int) -> np.ndarray:
    """Resize smooth values [h, 2h, C] to [rows, 2 rows, C] float32, by cubic B-splines, or by means where they shrink.

    Beyond a pole lies the opposite side.
    """
    height, width = values.shape[:2]
    if height >= rows:
        return reduced(values, rows).astype(np.float32)
    planes = np.moveaxis(values, -1, 0).astype(np.float32)
    beyond = np.roll(planes, width // 2, axis=2)
    tall = np.concatenate([beyond[:, 1::-1], planes, beyond[:, :-3:-1]], axis=1)
    padded = np.concatenate([tall[:, :, -2:], tall, tall[:, :, :2]], axis=2)
    return np.ascontiguousarray(np.moveaxis(_spline(height, rows) @ padded @ _spline(width, 2 * rows).T, 0, -1))


@lru_cache(maxsize=16)
def _spline(old: int, new: int) -> np.ndarray:
    """Return the weights [new, old + 4] of the cubic B-spline on values padded by two at both ends."""
    at = (np.arange(new) + 0.5) * old / new - 0.5
    first = np.floor(at).astype(int)
    t = at - first
    parts = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    weights = np.zeros((new, old + 4), np.float32)
    for k, part in enumerate(parts):
        weights[np.arange(new), first + 1 + k] = part / 6
    return weights

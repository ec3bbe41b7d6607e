"""Operations on a whole radiance map [H, 2H, 3]: checks, sizes, rotations, integrals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from array_api_compat import array_namespace, device

from anyprobe.core.arrays import plain_array
from anyprobe.core.contract import contract
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.resample import overlaps
from anyprobe.errors import InvalidEnvironment

if TYPE_CHECKING:
    from jaxtyping import Float

MAP_HEIGHT: int = contract("sizes")["map_height"]
"""Rows of every estimated map; the paper leaves the size open."""
SEARCH_ROWS = 128
"""Rows at which a larger map is searched for its dominant light, and blurred."""


def check_radiance(radiance: np.ndarray, name: str = "map") -> Float[np.ndarray, "H 2*H 3"]:
    """Return the map as float32 [H, 2H, 3], or raise InvalidEnvironment."""
    radiance = plain_array(radiance, name, InvalidEnvironment)
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
    height = radiance.shape[0]
    directions = pixel_directions(height) @ np.asarray(rotation, dtype=np.float32)  # R^T d
    uv = direction_to_uv(directions).astype(np.float32)
    return bilinear(radiance, xp.asarray(uv, device=device(radiance)))


def integral(radiance):
    """Integrate L dOmega over the sphere, [3]."""
    xp = array_namespace(radiance)
    weights = xp.asarray(pixel_solid_angles(radiance.shape[0]), dtype=radiance.dtype, device=device(radiance))
    return xp.sum(xp.sum(radiance * weights[:, :, None], axis=1), axis=0)

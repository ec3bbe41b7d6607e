"""A light as one frame of a clip: its map, and a matte, a silver and a mirror sphere under it."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.light.environment import reduced
from anyprobe.render.spheres import SILVER_ALPHA, SILVER_F0, WO, diffuse, mirror, sphere_normals, spheres_ev
from anyprobe.scatter.materials import Material, brdf

if TYPE_CHECKING:
    from jaxtyping import Float, UInt8

_SIDE = 128
SPHERES = ("diffuse", "silver", "mirror")

_SILVER_SIDE, _ROWS = 32, 32
"""Rows of the silver sphere, and of the map that both spheres see: neither shows anything finer."""


def preview_ev(radiance: Float[np.ndarray, "H 2*H 3"]) -> float:
    """Return the exposure [EV] of light_picture's spheres at which the matte one under this light does not clip."""
    return spheres_ev(diffuse(reduced(radiance, _ROWS), _SIDE))


def light_picture(radiance: Float[np.ndarray, "H 2*H 3"] | None, ev: float = 0.0) -> UInt8[np.ndarray, "128 640 3"]:
    """Return the map, then SPHERES, through the mean camera curve; black where there is no light.

    The map is shown at the clip's exposure, the spheres at ev [EV] relative to it.
    """
    if radiance is None:
        return np.zeros((_SIDE, (2 + len(SPHERES)) * _SIDE, 3), np.uint8)
    shown = resample(reduced(np.asarray(radiance, np.float32), _SIDE), (2 * _SIDE, _SIDE), smooth=True)
    spheres = diffuse(reduced(radiance, _ROWS), _SIDE), _silver(radiance), mirror(radiance, _SIDE)
    exposed = (sphere * np.float32(2.0**ev) for sphere in spheres)
    return to_bytes(response(np.concatenate([shown, *exposed], axis=1)))


def _silver(radiance: np.ndarray) -> np.ndarray:
    """Draw the sphere of render.spheres.silver, [S, S, 3], by one product of a matrix and the map; that one samples."""
    _, inside = sphere_normals(_SILVER_SIDE)
    picture = np.zeros((_SILVER_SIDE, _SILVER_SIDE, 4), np.float32)
    picture[inside, :3] = _silver_weights() @ reduced(radiance, _ROWS).reshape(-1, 3)
    picture[inside, 3] = 1.0
    larger = resample(picture, (_SIDE, _SIDE), smooth=True)
    return np.where(sphere_normals(_SIDE)[1][..., None], larger[..., :3] / np.maximum(larger[..., 3:], 1e-3), 0.0)


@lru_cache(maxsize=1)
def _silver_weights() -> np.ndarray:
    """Return how much each pixel of the map adds to each of the sphere, [N, P]: f_r (n.wi) dwi, Eq. 1."""
    normals, _ = sphere_normals(_SILVER_SIDE)
    wi = pixel_directions(_ROWS).reshape(-1, 3)
    silver = Material(albedo=0.0, f0=SILVER_F0, alpha=SILVER_ALPHA)
    cosine = np.maximum(normals @ wi.T, 0.0)
    reflected = brdf(silver, WO, wi, normals[:, None])[..., 0]
    solid_angles = np.repeat(pixel_solid_angles(_ROWS)[:, 0], 2 * _ROWS)
    return (reflected * cosine * solid_angles).astype(np.float32)

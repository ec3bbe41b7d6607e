"""Draw a frame of light.mp4: the clip's, and beside it the map over a matte, a silver and a mirror sphere."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.light.environment import reduced
from anyprobe.render.spheres import SILVER_ALPHA, SILVER_F0, WO, diffuse, mirror, sphere_normals, spheres_ev
from anyprobe.scatter.materials import Material, brdf

if TYPE_CHECKING:
    from jaxtyping import Float, UInt8

WIDTH = 640
"""Width of the clip's frame, and of the map beside it [pixels]."""
SIDE, MAP_ROWS = 208, WIDTH // 2
"""Heights of a sphere, and of the map [pixels]."""
HEIGHT = MAP_ROWS + SIDE
SPHERES = ("diffuse", "silver", "mirror")

_SILVER_SIDE, _ROWS = 32, 32
"""Rows of the silver sphere, and of the map that lights both spheres: neither shows anything finer."""


def preview_ev(radiance: Float[np.ndarray, "H 2*H 3"]) -> float:
    """Return the exposure of light_picture's spheres [EV] at which the matte one does not clip under this light."""
    return spheres_ev(diffuse(reduced(radiance, _ROWS), SIDE))


def light_picture(radiance: Float[np.ndarray, "H 2*H 3"] | None, ev: float = 0.0) -> UInt8[np.ndarray, "528 640 3"]:
    """Draw the map with SPHERES below it, through the mean camera curve; black if there is no light.

    The map is shown at the clip's exposure, the spheres at ev [EV] relative to it.
    """
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    if radiance is None:
        return picture
    shown = resample(np.asarray(radiance, np.float32), (WIDTH, MAP_ROWS), smooth=True)
    picture[:MAP_ROWS] = to_bytes(response(shown))
    spheres = diffuse(reduced(radiance, _ROWS), SIDE), _silver(radiance), mirror(radiance, SIDE)
    for k, sphere in enumerate(spheres):
        picture[MAP_ROWS:, k * SIDE : (k + 1) * SIDE] = to_bytes(response(sphere * np.float32(2.0**ev)))
    return picture


def beside_frame(
    rgb: UInt8[np.ndarray, "H W 3"], light: UInt8[np.ndarray, "528 640 3"]
) -> UInt8[np.ndarray, "528 1280 3"]:
    """Draw a clip's frame, as large as it fits, with a light_picture on its right."""
    scale = min(WIDTH / rgb.shape[1], HEIGHT / rgb.shape[0])
    width, height = (max(1, round(n * scale)) for n in (rgb.shape[1], rgb.shape[0]))
    picture = np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8)
    left, top = (WIDTH - width) // 2, (HEIGHT - height) // 2
    small = Image.fromarray(rgb).resize(
        (width, height), Image.Resampling.BOX if scale < 1 else Image.Resampling.BILINEAR
    )
    picture[top : top + height, left : left + width] = np.asarray(small)
    picture[:, WIDTH:] = light
    return picture


def _silver(radiance: np.ndarray) -> np.ndarray:
    """Draw the sphere of render.spheres.silver, [S, S, 3], by one product of a matrix and the map; that one samples."""
    _, inside = sphere_normals(_SILVER_SIDE)
    picture = np.zeros((_SILVER_SIDE, _SILVER_SIDE, 4), np.float32)
    picture[inside, :3] = _silver_weights() @ reduced(radiance, _ROWS).reshape(-1, 3)
    picture[inside, 3] = 1.0
    larger = resample(picture, (SIDE, SIDE), smooth=True)
    return np.where(sphere_normals(SIDE)[1][..., None], larger[..., :3] / np.maximum(larger[..., 3:], 1e-3), 0.0)


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

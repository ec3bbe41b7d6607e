"""Draw a frame of light.mp4: the clip's, and beside it the map over a matte and a mirror sphere."""

from __future__ import annotations

import numpy as np
from PIL import Image

from anyprobe.core import Float, UInt8
from anyprobe.core.color import to_bytes
from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.light.environment import reduced
from anyprobe.render.spheres import diffuse, mirror, spheres_ev

WIDTH = 640
"""Width of the clip's frame, and of the map beside it [pixels]."""
SIDE = MAP_ROWS = WIDTH // 2
"""Heights of a sphere, and of the map [pixels]."""
HEIGHT = MAP_ROWS + SIDE

_ROWS = 32
"""Rows of the map that lights the matte sphere, which shows nothing finer."""


def preview_ev(radiance: Float[np.ndarray, "H 2*H 3"]) -> float:
    """Return the exposure of light_picture's spheres [EV] at which the matte one does not clip under this light."""
    return spheres_ev(diffuse(reduced(radiance, _ROWS), SIDE))


def light_picture(radiance: Float[np.ndarray, "H 2*H 3"] | None, ev: float = 0.0) -> UInt8[np.ndarray, "640 640 3"]:
    """Draw the map over a matte and a mirror sphere, through the mean camera curve; black if there is no light.

    The map is shown at the clip's exposure, the spheres at ev [EV] relative to it.
    """
    picture = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    if radiance is None:
        return picture
    picture[:MAP_ROWS] = to_bytes(response(resample(np.asarray(radiance, np.float32), (WIDTH, MAP_ROWS), smooth=True)))
    for k, sphere in enumerate((diffuse(reduced(radiance, _ROWS), SIDE), mirror(radiance, SIDE))):
        picture[MAP_ROWS:, k * SIDE : (k + 1) * SIDE] = to_bytes(response(sphere * np.float32(2.0**ev)))
    return picture


def beside_frame(
    rgb: UInt8[np.ndarray, "H W 3"], light: UInt8[np.ndarray, "640 640 3"]
) -> UInt8[np.ndarray, "640 1280 3"]:
    """Draw a clip's frame, as large as it fits, with a light_picture on its right."""
    scale = min(WIDTH / rgb.shape[1], HEIGHT / rgb.shape[0])
    width, height = (max(1, round(n * scale)) for n in (rgb.shape[1], rgb.shape[0]))
    picture = np.zeros((HEIGHT, 2 * WIDTH, 3), np.uint8)
    left, top = (WIDTH - width) // 2, (HEIGHT - height) // 2
    kernel = Image.Resampling.BOX if scale < 1 else Image.Resampling.BILINEAR
    picture[top : top + height, left : left + width] = np.asarray(Image.fromarray(rgb).resize((width, height), kernel))
    picture[:, WIDTH:] = light
    return picture

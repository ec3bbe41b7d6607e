"""A partial panorama from a file: part of the light, as another program or a mirror ball shows it.

A panorama is [64, 128, 4] in the camera's frame: display RGB times cover, and cover in [0, 1]. A value above 1 is
linear radiance, as in those from an .exr or .hdr.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.inputs.hints import PHOTO, SurroundingsSource
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.maps.radiance import read_linear
from anyprobe.pictures.headers import MAX_PIXELS
from anyprobe.pictures.images import read_image

LEAST_COVER = 1e-3
"""Divisor of colours where next to nothing is covered."""


def read_panorama(source: SurroundingsSource) -> np.ndarray:
    """Read a partial panorama.

    Args:
        source: picture twice as wide as high, transparent where nothing is known; path, bytes, Pillow image or array.
            An .exr or .hdr holds linear radiance in the photo's exposure units.
    Returns:
        [64, 128, 4].
    Raises:
        InputError: not a panorama, or nothing known in it.
    """
    try:
        linear = read_linear(source, MAX_PIXELS)
        picture = _displayed(source) if linear is None else linear
    except InputError as error:
        raise InputError(error, subject="surroundings") from error
    height, width = picture.shape[:2]
    if width != 2 * height:
        raise InputError(
            f"expected a panorama twice as wide as high, or {PHOTO!r}, got {width} x {height} pixels",
            subject="surroundings",
        )
    if not picture[..., 3].any():
        raise InputError("expected pixels that are not transparent, found none", subject="surroundings")
    small = resample(picture, (2 * MAP_HEIGHT, MAP_HEIGHT))
    if linear is None:
        return small
    cover = small[..., 3:]
    radiance = small[..., :3] / np.maximum(cover, LEAST_COVER)
    display = np.where(radiance > 1, radiance, response(radiance))
    return np.concatenate([display * cover, cover], axis=-1).astype(np.float32)


def _displayed(source: SurroundingsSource) -> np.ndarray:
    """Return a picture [H, W, 4]: display RGB times cover, and cover."""
    pixels = read_image(source)
    cover = np.ones(pixels.rgb.shape[:2], np.float32) if pixels.alpha is None else pixels.alpha
    return np.dstack([pixels.rgb * cover[..., None], cover])

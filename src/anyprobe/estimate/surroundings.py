"""A partial panorama from a file: part of the light, as another program or a mirror ball shows it.

A panorama is [64, 128, 4] in the camera's frame: display RGB times cover, and cover in [0, 1]. A value above 1 is
linear radiance, as in those from an .exr or .hdr.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.resample import resample
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.estimate.normals_hint import normals_from_outline, read_normals
from anyprobe.inputs.hints import AUTO, NONE, PHOTO, SPHERE, NormalsSource, SurroundingsSource
from anyprobe.light.environment import MAP_HEIGHT, rotate
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
        text = f"expected a panorama twice as wide as high, or {PHOTO!r}, got {width} x {height} pixels"
        raise InputError(text, subject="surroundings")
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


@dataclass(frozen=True, kw_only=True, slots=True)
class PhotoBackground:
    """The photo's background, used as part of the map.

    is_asked: whether the caller asked for it, so that it is used whatever it looks like.
    """

    is_asked: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class GivenPanorama:
    """Part of the map given by a file, in the camera's frame, see estimate.surroundings.

    values: [64, 128, 4].
    """

    values: np.ndarray

    def turned(self, rotation: np.ndarray) -> GivenPanorama:
        """Return it after a turn by rotation [3, 3]; no value falls below 0, and no cover rises above 1."""
        turned = np.maximum(rotate(self.values, rotation), 0.0)
        turned[..., 3] = np.minimum(turned[..., 3], 1.0)
        return GivenPanorama(values=turned.astype(np.float32))


def asked_surroundings(asked: SurroundingsSource | None) -> PhotoBackground | GivenPanorama | None:
    """Read the caller's surroundings; the default is "auto"."""
    if asked is None or (isinstance(asked, str) and asked in (AUTO, PHOTO, NONE)):
        return None if asked == NONE else PhotoBackground(is_asked=asked == PHOTO)
    return GivenPanorama(values=read_panorama(asked))


def read_given_normals(source: NormalsSource | None, mask: np.ndarray, long_fov_deg: float) -> np.ndarray | None:
    """Return the given normals [H, W, 3], unit, or zero where unknown, in the camera's frame; None where none are."""
    if source is None:
        return None
    if isinstance(source, str) and source == SPHERE:
        return normals_from_outline(mask, long_fov_deg)
    try:
        return read_normals(source, mask.shape)
    except InputError as error:
        raise InputError(error, subject="normals") from error

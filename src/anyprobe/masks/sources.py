"""Masks that come ready made: the photo's alpha channel, a picture, somebody else's segmenter."""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance, to_bytes
from anyprobe.errors import InvalidMask, InvalidPhoto
from anyprobe.files.images import read_image
from anyprobe.masks.check import check_mask

MaskPicture = str | os.PathLike[str] | bytes | Image.Image | np.ndarray
MaskFunction = Callable[[np.ndarray], np.ndarray]
MaskSource = MaskPicture | MaskFunction


def mask_from_alpha(alpha: np.ndarray) -> np.ndarray:
    """The photo's own transparency as the mask, [H, W] in [0, 1]."""
    return check_mask(alpha)


def mask_from_file(source: MaskPicture, shape: tuple[int, int]) -> np.ndarray:
    """A picture of the mask, white on the object.

    Its alpha channel counts if it has one that varies, else its brightness. The
    outer tenths of the range are flattened, which removes the noise of JPEG around
    black and white and keeps soft edges, with the half level in place.

    Args:
        source: anything read_image takes, or a boolean or 0/1 array.
        shape: (height, width) of the photo after its EXIF rotation.
    """
    if isinstance(source, np.ndarray) and (source.dtype == bool or _is_binary(source)):
        source = source.astype(np.uint8) * 255
    try:
        pixels = read_image(source, None if isinstance(source, (str, os.PathLike)) else "mask")
    except InvalidPhoto as error:
        raise InvalidMask(f"mask: {error}") from error
    found = pixels.rgb.shape[:2]
    if found != tuple(shape):
        raise InvalidMask(
            f"{pixels.name}: expected a mask of the photo's size {shape[1]} x {shape[0]}, "
            f"got {found[1]} x {found[0]}; draw it on the upright photo"
        )
    if pixels.alpha is not None and pixels.alpha.min() < pixels.alpha.max():
        return check_mask(pixels.alpha)
    return check_mask(np.clip((luminance(pixels.rgb) - 0.1) / 0.8, 0.0, 1.0))


def mask_from_function(segment: MaskFunction, rgb: np.ndarray) -> np.ndarray:
    """Ask a segmenter of the caller's own.

    Args:
        segment: gets the upright photo [H, W, 3] uint8 and returns its mask [H, W]: bool, 0/1,
            uint8, or float in [0, 1]; axes of length 1 around it do not matter.
        rgb: [H, W, 3] display values in [0, 1].
    """
    answer = segment(to_bytes(rgb))
    if not isinstance(answer, np.ndarray):
        raise InvalidMask(
            f"mask function: expected an array [height, width] back, got {type(answer).__name__}; "
            "convert it with numpy.asarray"
        )
    answer = answer.squeeze()
    if answer.ndim != 2:
        raise InvalidMask(
            f"mask function: expected an array [height, width] back, got shape {answer.shape}; "
            "return one object's mask"
        )
    return mask_from_file(answer, rgb.shape[:2])


def _is_binary(values: np.ndarray) -> bool:
    """True for an integer array of 0 and 1 only, as labelling tools give."""
    return (
        np.issubdtype(values.dtype, np.integer)
        and values.size > 0
        and bool(((values == 0) | (values == 1)).all())
    )

"""Ready-made masks: the photo's alpha channel, a picture, the caller's own function."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.errors import InvalidMask, InvalidPhoto
from anyprobe.maps.exr import EXR_MAGIC, read_exr
from anyprobe.maps.radiance import bytes_of
from anyprobe.masks.check import IN_OBJECT, MASK_BLACK, MASK_WHITE, check_mask
from anyprobe.pictures.headers import MAX_PIXELS
from anyprobe.pictures.images import read_image

MaskPicture = str | os.PathLike[str] | bytes | Image.Image | np.ndarray
MaskFunction = Callable[[np.ndarray], np.ndarray]
MaskSource = MaskPicture | MaskFunction


def mask_from_alpha(alpha: np.ndarray | None, found_in: str = "") -> np.ndarray | None:
    """Return a picture's alpha channel [H, W] as the mask; None where it is absent or marks no object.

    Alpha that is constant, or above one half everywhere, marks no object: renderers and editors write 0.9995, or 254 of
    255, into opaque pictures. found_in: see check_mask.
    """
    if alpha is None or not alpha.min() <= IN_OBJECT or alpha.min() == alpha.max():
        return None
    return check_mask(alpha, found_in)


def mask_from_file(source: MaskPicture, shape: tuple[int, int]) -> np.ndarray:
    """Read a picture of the mask, white on the object.

    The mask is its alpha channel if that marks an object, else its brightest channel: labelling tools paint objects in
    a colour. The outer tenths of the range are flattened, which removes JPEG noise around black and white and keeps
    soft edges centred at one half. An .exr and an array of floats have no such noise and are used unchanged.

    Args:
        source: anything read_image takes, or a boolean or 0/1 array.
        shape: (height, width) of the photo after its EXIF rotation.
    """
    if isinstance(source, np.ndarray) and source.size and source.dtype.kind in "bui" and np.isin(source, (0, 1)).all():
        source = source.astype(np.uint8) * 255
    if isinstance(source, np.ndarray) and not _is_mask_array(source):
        raise InvalidMask(
            f"expected bool, 0 and 1, uint8, uint16 or floats from 0 to 1, got {source.dtype} from "
            f"{source.min():g} to {source.max():g}; scale it",
            subject="mask",
        )
    try:
        brightness, alpha, name = _read(source)
    except InvalidPhoto as error:
        raise InvalidMask(error, subject="mask") from error
    found = brightness.shape
    if found != tuple(shape):
        raise InvalidMask(
            f"expected a mask of the photo's size {shape[1]} x {shape[0]}, "
            f"got {found[1]} x {found[0]}; draw it on the upright photo",
            subject="mask",
            source=name,
        )
    cut_out = mask_from_alpha(alpha)
    return check_mask(brightness) if cut_out is None else cut_out


def _read(source: MaskPicture) -> tuple[np.ndarray, np.ndarray | None, str]:
    """Return a mask picture's brightness [H, W] in [0, 1], its alpha or None, and its name for messages."""
    name = Path(source).name if isinstance(source, (str, os.PathLike)) else "mask"
    if data := bytes_of(source, EXR_MAGIC):
        return *_read_exr(data, name), name
    pixels = read_image(source, name, as_data=True)
    is_exact = isinstance(source, np.ndarray) and np.issubdtype(source.dtype, np.floating)
    return pixels.rgb.max(axis=-1) if is_exact else _brightness(pixels.rgb), pixels.alpha, pixels.name


def _brightness(rgb: np.ndarray) -> np.ndarray:
    """Return the brightness [H, W] of display values [H, W, 3], its outer tenths flattened, in place."""
    brightness = rgb.max(axis=-1)
    brightness -= MASK_BLACK
    brightness /= MASK_WHITE - MASK_BLACK
    return np.clip(brightness, 0.0, 1.0, out=brightness)


def _read_exr(data: bytes, name: str) -> tuple[np.ndarray, np.ndarray | None]:
    """Read the brightest channel as stored, and alpha or None, both [H, W] in [0, 1]."""
    values = read_exr(data, name, InvalidPhoto, MAX_PIXELS)
    if not np.isfinite(values).all():
        raise InvalidPhoto("expected finite values, got NaN or infinity; repair the picture first", source=name)
    alpha = np.clip(values[..., 3], 0.0, 1.0) if values.shape[2] == 4 else None
    return np.clip(values[..., :3].max(axis=-1), 0.0, 1.0), alpha


def mask_from_function(segment: MaskFunction, rgb: np.ndarray) -> np.ndarray:
    """Run the caller's own segmenter.

    Args:
        segment: gets the upright photo [H, W, 3] uint8 and returns its mask [H, W]: bool, 0/1,
            uint8, or float in [0, 1]; axes of length 1 are dropped.
        rgb: [H, W, 3] display values in [0, 1].
    """
    answer = segment(to_bytes(rgb))
    if not isinstance(answer, np.ndarray) or answer.squeeze().ndim != 2:
        got = f"shape {answer.shape}" if isinstance(answer, np.ndarray) else type(answer).__name__
        text = f"expected a function that returns an array [height, width], got {got}; return one object's mask"
        raise InvalidMask(text, subject="mask")
    return mask_from_file(answer.squeeze(), rgb.shape[:2])


def _is_mask_array(values: np.ndarray) -> bool:
    """Return whether an array's type and range are those of a mask; True for types that read_image refuses."""
    if values.size == 0 or values.dtype in (np.uint8, np.uint16) or values.dtype.kind not in "uif":
        return True
    return values.dtype.kind == "f" and not (np.nanmin(values) < 0 or np.nanmax(values) > 1)

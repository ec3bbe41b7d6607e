"""Where the object is: a mask [H, W] in [0, 1] from alpha, from a file or from a box."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from PIL import Image

from anyprobe.core.color import luminance
from anyprobe.errors import InvalidMask, InvalidPhoto, MissingExtra
from anyprobe.files.images import read_image

MIN_OBJECT_PX = 24
"""Smallest longer side of the object's bounding box."""

GRABCUT_LONG_PX = 640
"""Longer side of the picture that GrabCut works on; its time grows with the area."""

GRABCUT_ROUNDS = 5

MaskSource = str | os.PathLike[str] | bytes | Image.Image | np.ndarray


def mask_from_alpha(alpha: np.ndarray) -> np.ndarray:
    """The photo's own transparency as the mask, [H, W] in [0, 1]."""
    return check_mask(alpha)


def mask_from_file(source: MaskSource, shape: tuple[int, int]) -> np.ndarray:
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


def mask_from_box(rgb: np.ndarray, box: Sequence[float]) -> np.ndarray:
    """Cut the object out of a box around it with GrabCut (Rother et al. 2004).

    Args:
        rgb: [H, W, 3] display values in [0, 1].
        box: X0, Y0, X1, Y1 in pixels, X1 and Y1 exclusive, with some background inside.
    Raises:
        InvalidMask: the box is not inside the picture, or nothing was found in it.
        MissingExtra: OpenCV is not installed.
    """
    height, width = rgb.shape[:2]
    x0, y0, x1, y1 = _check_box(box, width, height)
    try:
        import cv2
    except ImportError as error:
        raise MissingExtra("opencv-python-headless", "box", "cutting the object out of a box") from error

    scale = min(1.0, GRABCUT_LONG_PX / max(width, height))
    small_width, small_height = max(1, round(width * scale)), max(1, round(height * scale))
    small = cv2.resize(rgb, (small_width, small_height), interpolation=cv2.INTER_AREA)
    left = min(int(x0 * scale), small_width - 1)
    top = min(int(y0 * scale), small_height - 1)
    right = min(small_width, max(left + 1, round(x1 * scale)))
    bottom = min(small_height, max(top + 1, round(y1 * scale)))
    if (left, top, right, bottom) == (0, 0, small_width, small_height):
        left, right = 1, small_width - 1  # the surroundings must not be empty
    labels = np.zeros((small_height, small_width), dtype=np.uint8)
    cv2.setRNGSeed(0)  # its clustering starts at random
    try:
        cv2.grabCut(
            np.round(small[..., ::-1] * 255.0).astype(np.uint8),  # BGR
            labels,
            (left, top, right - left, bottom - top),
            np.zeros((1, 65)),
            np.zeros((1, 65)),
            GRABCUT_ROUNDS,
            cv2.GC_INIT_WITH_RECT,
        )
    except cv2.error as error:
        raise InvalidMask(f"box: cutting out failed ({error.err}); pass --mask FILE") from error
    cut = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD)).astype(np.float32)
    if not cut.any():
        raise InvalidMask(
            f"box: expected an object in {x0:g},{y0:g},{x1:g},{y1:g}, found none that stands out; "
            "pass --mask FILE"
        )
    smooth = cv2.GaussianBlur(cut, (0, 0), 1.0)
    large = cv2.resize(smooth, (width, height), interpolation=cv2.INTER_LINEAR)
    return check_mask(np.clip((large - 0.25) / 0.5, 0.0, 1.0))


def check_mask(mask: np.ndarray) -> np.ndarray:
    """Return the mask as float32 [H, W], or raise InvalidMask: empty, too small, NaN."""
    mask = np.asarray(mask, dtype=np.float32)
    if mask.ndim != 2 or not (mask.size and mask.min() >= 0.0 and mask.max() <= 1.0):
        raise InvalidMask(
            f"mask: expected [height, width] in 0 to 1, got shape {mask.shape} or values outside"
        )
    if not (mask > 0.5).any():
        raise InvalidMask(
            f"mask: expected white on the object, got an empty mask (largest value {mask.max():.2f}); "
            "paint the object white"
        )
    x0, y0, x1, y1 = object_box(mask)
    if max(x1 - x0, y1 - y0) < MIN_OBJECT_PX:
        raise InvalidMask(
            f"mask: expected an object at least {MIN_OBJECT_PX} pixels across, got {x1 - x0} x {y1 - y0}; "
            "use a larger photo or go closer"
        )
    return mask


def object_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Bounding box x0, y0, x1, y1 (exclusive) of mask > 0.5, which must not be empty."""
    inside = mask > 0.5
    columns = np.flatnonzero(inside.any(axis=0))
    rows = np.flatnonzero(inside.any(axis=1))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


def _check_box(box: Sequence[float], width: int, height: int) -> tuple[float, float, float, float]:
    try:
        x0, y0, x1, y1 = (float(v) for v in box)
    except (TypeError, ValueError) as error:
        raise InvalidMask(f"box: expected four numbers X0,Y0,X1,Y1 in pixels, got {box!r}") from error
    shown = f"{x0:g},{y0:g},{x1:g},{y1:g}"
    if not (0 <= x0 < x1 <= width and 0 <= y0 < y1 <= height):
        raise InvalidMask(
            f"box: expected X0,Y0,X1,Y1 with 0 <= X0 < X1 <= {width} and 0 <= Y0 < Y1 <= {height}, "
            f"got {shown}; count pixels from the top left of the upright photo"
        )
    if max(x1 - x0, y1 - y0) < MIN_OBJECT_PX:
        raise InvalidMask(
            f"box: expected an object at least {MIN_OBJECT_PX} pixels across, got the box {shown}; "
            "use a larger photo or go closer"
        )
    if (x1 - x0) * (y1 - y0) >= width * height:
        raise InvalidMask(
            f"box: expected some background around the box, got the whole photo {shown}; draw it closer"
        )
    return x0, y0, x1, y1


def _is_binary(values: np.ndarray) -> bool:
    """True for an integer array of 0 and 1 only, as labelling tools give."""
    return (
        np.issubdtype(values.dtype, np.integer)
        and values.size > 0
        and bool(((values == 0) | (values == 1)).all())
    )

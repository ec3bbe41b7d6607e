"""Turn a decoded picture of a clip into what a player shows: upright, square pixels, sRGB, and light above white.

Streams describe their colours by code points of ITU-T H.273. Without one for the matrix it is chosen as players do:
BT.2020 for its primaries, else BT.709 for HD and BT.601 for smaller pictures.
"""

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.response import inverse_response
from anyprobe.errors import InputError
from anyprobe.pictures.color_encoding import HLG, PQ, UNSPECIFIED, ColorEncoding, by_code_points, is_srgb, to_display
from anyprobe.pictures.headers import MAX_PIXELS

BT709, RGB, BT601, YCGCO, BT2020, MOST_MATRIX = 1, 0, 5, 8, 9, 10
"""Code points of matrices; FFmpeg's scaler converts those up to the last but YCgCo."""
UNNAMED = (UNSPECIFIED, 3, 12, 13)
"""Code points of matrices that name none."""

HD = (1280, 576)
"""A picture of at least this width, or higher than this, is HD."""

MOST_ASPECT = 4
"""Largest ratio of a pixel's sides that is believed and made square."""

BITS = 8

FULL = 2
"""FFmpeg's number of the range without head and foot room."""

EXACT = 0x2 | 0x2000 | 0x40000
"""Flags of FFmpeg's scaler: bilinear, colours of every pixel, rounded. Without the last two grey is 1 % too dark."""


def shown_pixels(
    picture, aspect: Fraction | None, size: tuple[int, int] | None, path: Path
) -> tuple[dict[str, Any], tuple[int, int]]:
    """Return the pixels of an av.VideoFrame as a player shows them, and its transparency.

    Args:
        aspect: width of a pixel over its height; None if the file does not state it.
        size: width and height to fit it into, with black bars where the shape differs; None: its own.
    Returns:
        rgb, radiance and alpha of clip.Frame by name, and the width and height before it was fitted. The radiance, of
        PQ and HLG alone, is linear Rec. 709 above diffuse white (1) and by core.response below.
    Raises:
        InputError: it has too many pixels, or colours that cannot be converted.
    """
    width, height = picture.width, picture.height
    if aspect and 1 / MOST_ASPECT <= aspect <= MOST_ASPECT:
        width = max(1, round(width * aspect))
    if max(picture.width, width) * max(picture.height, height) > MAX_PIXELS:
        raise InputError(
            f"expected at most {MAX_PIXELS // 1_000_000} million pixels, "
            f"got {picture.width} x {picture.height}; shrink it first",
            source=path,
        )
    degrees = picture.rotation  # counter-clockwise; no angle where the file's matrix flattens the picture
    turns = round(degrees / 90) if abs(degrees) <= 180 else 0
    own = (height, width) if turns % 2 else (width, height)
    target = own
    if size is not None and size != own:
        scale = min(Fraction(size[0], own[0]), Fraction(size[1], own[1]))
        target = max(1, round(own[0] * scale)), max(1, round(own[1] * scale))
    stored = target[::-1] if turns % 2 else target
    rgb, radiance = _converted(picture, stored, path)

    def placed(pixels: np.ndarray) -> np.ndarray:
        upright = np.rot90(pixels, turns)
        if size is None or size == target:
            return np.ascontiguousarray(upright)
        canvas = np.zeros((size[1], size[0], *pixels.shape[2:]), pixels.dtype)
        top, left = (size[1] - target[1]) // 2, (size[0] - target[0]) // 2
        canvas[top : top + target[1], left : left + target[0]] = upright
        return canvas

    planes = {"rgb": rgb, "radiance": radiance, "alpha": _alpha(picture, stored)}
    return {name: None if plane is None else placed(plane) for name, plane in planes.items()}, own


def _alpha(picture, stored: tuple[int, int]) -> np.ndarray | None:
    """Return the transparency [H, W] of a frame of this width and height; None where all is opaque."""
    if not any(part.is_alpha for part in picture.format.components):
        return None
    alpha = picture.to_ndarray(format="rgba64le", width=stored[0], height=stored[1])[..., 3]
    return alpha / np.float32(0xFFFF) if (alpha < 0xFFFF).any() else None


def _converted(picture, stored: tuple[int, int], path: Path) -> tuple[np.ndarray, np.ndarray | None]:
    """Return pixels of this width and height: sRGB uint8, and radiance as of shown_pixels."""
    encoding, matrix = _encoding(picture), _matrix(picture, path)
    said = {} if matrix is None else {"src_colorspace": matrix, "dst_colorspace": matrix}
    how = {"interpolation": EXACT, "width": stored[0], "height": stored[1], **said}
    bits = max((part.bits for part in picture.format.components), default=BITS)
    if bits <= BITS:
        values = picture.to_ndarray(format="rgb24", **how)
        if encoding is None:
            return values, None
    else:
        kind = "rgb48le" if matrix is None else "gbrp16le"  # of 4:2:0 the scaler makes other colours in the former
        # FFmpeg's scaler shifts bits up, and leaves the low ones zero
        used = 16 if matrix is None else bits if int(picture.color_range) == FULL else BITS
        values = np.clip(picture.to_ndarray(format=kind, **how) / np.float32(((1 << used) - 1) << (16 - used)), 0, 1)
        if encoding is None:
            return (values * 255 + 0.5).astype(np.uint8), None
    display, radiance = to_display(values, encoding)
    if radiance is not None:
        # display values are read alike in every clip, so that one scene has one light
        radiance = np.where(radiance > 1, radiance, inverse_response(display)).astype(np.float32)
    return (display * 255 + 0.5).astype(np.uint8), radiance


def _encoding(picture) -> ColorEncoding | None:
    """Return the colour encoding of a frame's RGB; None for sRGB."""
    transfer, primaries = int(picture.color_trc), int(picture.color_primaries)
    if primaries == UNSPECIFIED and (transfer in (PQ, HLG) or int(picture.colorspace) == BT2020):
        primaries = BT2020
    found = by_code_points(primaries, transfer) or by_code_points(UNSPECIFIED, transfer)
    return None if found is None or is_srgb(found) else found


def _matrix(picture, path: Path) -> int | None:
    """Return the code point of the matrix by which it was made from RGB; None if it is RGB."""
    said = int(picture.colorspace)
    if picture.format.is_rgb or said == RGB:
        return None
    if said in UNNAMED:
        hd = picture.width >= HD[0] or picture.height > HD[1]
        return BT2020 if int(picture.color_primaries) == BT2020 else BT709 if hd else BT601
    if said <= MOST_MATRIX and said != YCGCO:
        return said
    text = f"expected RGB or YCbCr colours, got others (matrix {said} of ITU-T H.273); convert it to SDR first"
    raise InputError(text, source=path)

"""Colour encoding that a picture's file declares, and its pixels in sRGB.

Sources, in this order: code points of a PNG (cICP), an embedded profile, code points of HEIC and AVIF (nclx), a PNG's
gAMA and cHRM where it does not say sRGB, EXIF's Adobe RGB (R03). A file without any is sRGB.
"""

from __future__ import annotations

import struct
from contextlib import suppress
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from PIL import ExifTags, Image

from anyprobe.maps.image_io import open_image
from anyprobe.pictures.color_encoding import ADOBE_RGB, ColorEncoding, by_code_points, by_numbers, is_srgb, to_display
from anyprobe.pictures.file_parts import iso_boxes
from anyprobe.pictures.icc import converted, encoding_of
from anyprobe.pictures.raw import HEAD_BYTES

USUAL_GAMMA = 1 / 2.2
"""PNG gamma by which most programs mean sRGB."""
GAMMA_TOLERANCE = 0.005

ADOBE_GAMMA = 563 / 256
R03, INTEROPERABILITY = "R03", 1
"""EXIF's name for Adobe RGB (DCF), and the tag that holds it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DisplayPixels:
    """A picture in sRGB.

    Attributes:
        values: [H, W] or [H, W, 3], uint8, uint16 or float in [0, 1].
        radiance: [H, W, 3] linear Rec. 709, above white too; or None.
        warnings: one line each, without the picture's name.
    """

    values: np.ndarray
    radiance: np.ndarray | None = None
    warnings: tuple[str, ...] = ()


def declared_encoding(
    image: Image.Image, stream: BinaryIO | None
) -> tuple[ColorEncoding | None, bytes, tuple[str, ...]]:
    """Return the encoding or the ICC profile that a picture declares, neither for sRGB, and warnings.

    Args:
        image: opened by Pillow, its file still open where it has one.
        stream: the file, for what Pillow does not return; None where there is none.
    """
    if image.mode == "LAB":  # absolute: Pillow converts it, and a profile adds nothing
        return None, b"", ()
    profile = image.info.get("icc_profile") or b""
    points = _code_points(image, stream)
    if points is not None and (image.format == "PNG" or not profile):
        primaries, transfer, full, bits = points
        if (primaries, transfer) == (2, 2):
            return None, profile, ()
        encoding = by_code_points(primaries, transfer, full, bits)
        note = f"its colour encoding (primaries {primaries}, transfer {transfer}) is unknown; read as sRGB"
        return encoding, b"", (note,) if encoding is None else ()
    if profile:
        return None, profile, ()
    if image.format == "PNG" and "srgb" not in image.info:
        return _by_gamma(image), b"", ()
    if image.format in ("JPEG", "MPO", "TIFF") and _is_adobe_rgb(image):
        return by_numbers(ADOBE_RGB, ADOBE_GAMMA), b"", ()
    return None, b"", ()


def to_srgb(picture: Image.Image | np.ndarray, encoding: ColorEncoding | None, profile: bytes = b"") -> DisplayPixels:
    """Convert a picture from an encoding or a profile to sRGB; unchanged if it has neither.

    picture: L, RGB or CMYK of Pillow; or [H, W] or [H, W, 3] of 16 bits or floats.
    """
    has_8_bits = isinstance(picture, Image.Image)
    if profile:
        encoding = encoding_of(profile)
        space = {"L": b"GRAY", "RGB": b"RGB ", "CMYK": b"CMYK"}[_mode(picture)]
        if profile[16:20] != space and profile[36:40] == b"acsp":
            return DisplayPixels(values=_plain(picture), warnings=(UNFIT,))
        if encoding is None or (has_8_bits and not encoding.is_hdr and not is_srgb(encoding)):
            return _by_table(picture, profile)
    values = _plain(picture)
    if encoding is None or is_srgb(encoding):
        return DisplayPixels(values=values)
    display, radiance = to_display(values, encoding)
    return DisplayPixels(values=display, radiance=radiance)


UNFIT = "its colour profile is damaged or for another colour model; read as sRGB"


def _mode(picture: Image.Image | np.ndarray) -> str:
    if isinstance(picture, Image.Image):
        return picture.mode
    return "L" if picture.ndim == 2 else "RGB"


def _plain(picture: Image.Image | np.ndarray) -> np.ndarray:
    """Return its values unconverted, [H, W] or [H, W, 3]."""
    if isinstance(picture, Image.Image):
        return np.asarray(picture if picture.mode in ("L", "RGB") else picture.convert("RGB"))
    return picture


def _by_table(picture: Image.Image | np.ndarray, profile: bytes) -> DisplayPixels:
    """Convert by LittleCMS, with 8 bits."""
    if not isinstance(picture, Image.Image):
        scaled = picture * 255.0 if picture.dtype.kind == "f" else picture / 257.0
        picture = Image.fromarray(np.clip(np.round(scaled), 0, 255).astype(np.uint8))
    try:
        return DisplayPixels(values=np.asarray(converted(picture, profile)))
    except ValueError:
        return DisplayPixels(values=_plain(picture), warnings=(UNFIT,))


def _code_points(image: Image.Image, stream: BinaryIO | None) -> tuple[int, int, bool, int] | None:
    """Return primaries, transfer, whether the range is full, and bits, where the file has H.273's code points."""
    if image.format == "PNG" and stream is not None:
        return _cicp(stream)
    if image.format == "HEIF":
        nclx = image.info.get("nclx_profile")
        return None if not nclx else (int(nclx["color_primaries"]), int(nclx["transfer_characteristics"]), True, 8)
    if image.format == "AVIF" and stream is not None:
        return _nclx(stream)
    return None


def _cicp(stream: BinaryIO) -> tuple[int, int, bool, int] | None:
    """Return the code points of a PNG's cICP chunk, None without one."""
    place, found, kind = stream.tell(), None, np.dtype(np.uint8)
    with suppress(ValueError), open_image(stream, "png") as image:  # of a damaged one Pillow says why
        found, kind = image.spec().getattribute("CICP"), np.dtype(str(image.spec().format))
    stream.seek(place)
    return None if found is None else (found[0], found[1], found[3] == 1, 8 * kind.itemsize)


def _nclx(stream: BinaryIO) -> tuple[int, int, bool, int] | None:
    """Return the code points of an AVIF's first nclx property, None without one; the decoder handles the range."""
    place = stream.tell()
    stream.seek(0)
    data = stream.read(HEAD_BYTES)
    stream.seek(place)
    span = (0, len(data))
    try:
        for wanted, skipped in ((b"meta", 4), (b"iprp", 0), (b"ipco", 0)):
            start, end = next(found for kind, found in iso_boxes(data, span) if kind == wanted)
            span = (start + skipped, end)
        for kind, (at, end) in iso_boxes(data, span):
            if kind == b"colr" and data[at : at + 4] == b"nclx" and end - at >= 10:
                primaries, transfer = struct.unpack_from(">HH", data, at + 4)
                return primaries, transfer, True, 8
    except (StopIteration, ValueError):  # it has none, or is damaged
        pass
    return None


def _by_gamma(image: Image.Image) -> ColorEncoding | None:
    """Return the encoding of a PNG's gAMA and cHRM; sRGB's curve for the usual gamma."""
    gamma, found = image.info.get("gamma"), image.info.get("chromaticity")
    if not gamma and not found:
        return None
    if gamma and (not 0.01 < gamma < 100 or abs(gamma - USUAL_GAMMA) < GAMMA_TOLERANCE):
        gamma = None
    white_first = tuple(map(float, found)) if found else None
    return by_numbers(white_first and white_first[2:] + white_first[:2], None if not gamma else 1.0 / gamma)


def _is_adobe_rgb(image: Image.Image) -> bool:
    try:
        return str(image.getexif().get_ifd(ExifTags.IFD.Interop).get(INTEROPERABILITY, ""))[:3] == R03
    except Exception:  # its parser raises whatever the bad bytes lead it to
        return False

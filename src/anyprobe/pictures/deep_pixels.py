"""Pictures that Pillow reads with 8 bits, or not at all, decoded by OpenImageIO: 16 bits, floats, JPEG XL."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from PIL import Image

from anyprobe.errors import InvalidPhoto
from anyprobe.maps.image_io import open_image, read_pixels
from anyprobe.pictures.headers import JXL_STARTS, MAX_PIXELS, ON_ITS_SIDE, check_size, jxl_boxes, jxl_size

if TYPE_CHECKING:
    from anyprobe.maps.image_io import ImageInput

TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
EXIF_HEAD_BYTES = 16
"""Number of bytes in which EXIF's TIFF begins; programs put up to ten before it."""

MOST_BYTES = 16 * MAX_PIXELS
"""Largest number of bytes that a picture is decoded to: four floats a pixel."""

WHITE_IS_ZERO, BLACK_IS_ZERO, RGB = 0, 1, 2
"""Photometric interpretations of TIFF 6.0 whose samples are grey or colours."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DeepPicture:
    """A decoded picture.

    Attributes:
        values: [H, W, C] uint8 or uint16, white at the largest, or float32; not turned upright. Of 2 or 4 channels the
            last is alpha.
        premultiplied: whether colour is multiplied by alpha.
        profile: the embedded ICC profile, or empty.
        exif: bytes that begin with the file's EXIF, or empty.
        kind: Pillow's name of the format.
    """

    values: np.ndarray
    premultiplied: bool
    profile: bytes
    exif: bytes
    kind: str

    @property
    def floats(self) -> bool:
        """Whether it is of floats."""
        return self.values.dtype.kind == "f"

    def header(self) -> Image.Image:
        """Return what Pillow would have opened: profile, EXIF and format, of a picture of one pixel."""
        image = Image.new("L", (1, 1))
        image.info["icc_profile"], image.format = self.profile, self.kind
        at = max(self.exif.find(start, 0, EXIF_HEAD_BYTES) for start in TIFF_STARTS)
        with suppress(Exception):  # its parser raises whatever the bad bytes lead it to
            image.getexif().load(b"Exif\0\0" + self.exif[at:])
        return image


def read_deep(stream: BinaryIO, head: bytes, name: str) -> DeepPicture | None:
    """Read a TIFF of 16 bits or floats, or a JPEG XL; None for any other picture, and one that Pillow has to refuse.

    Raises:
        InvalidPhoto: damaged, or too large.
    """
    if head.startswith(TIFF_STARTS):
        found = _read(stream, "tiff", name)
        stream.seek(0)
        return None if found is None else DeepPicture(**found, exif=stream.read(), kind="TIFF")
    if head.startswith(JXL_STARTS):  # its decoder works when it opens
        data = stream.read()
        width, height = jxl_size(data)
        check_size(width, height, name)
        found = _read(stream, "jpegxl", name)
        exif = b"".join(jxl_boxes(data, b"Exif")[:1])
        return None if found is None else DeepPicture(**found, exif=exif, kind="JXL")
    return None


def read_sixteen_bits(image: Image.Image, stream: BinaryIO, name: str) -> np.ndarray | None:
    """Return a PNG of 16 bits, or a JPEG 2000 of more than 8, as uint16 [H, W, 1 to 4]; None for any other.

    image: opened by Pillow from the stream.
    """
    kind = {"PNG": "png", "JPEG2000": "jpeg2000"}.get(image.format or "")
    stream.seek(0)
    found = None if kind is None else _read(stream, kind, name)
    return None if found is None else found["values"]


def _read(stream: BinaryIO, kind: str, name: str) -> dict | None:
    """Return what a DeepPicture holds, but for its EXIF; None for 8 bits, 32-bit integers and other colour models."""
    opened = False
    try:
        with open_image(stream, kind) as image:
            opened = True
            spec, photometric = image.spec(), image.spec().get_int_attribute("tiff:PhotometricInterpretation", RGB)
            is_wide = str(spec.format) in ("uint16", "int16", "half", "float", "double")
            if photometric not in (WHITE_IS_ZERO, BLACK_IS_ZERO, RGB) or not (is_wide or kind == "jpegxl"):
                return None
            check_size(spec.width, spec.height, name)
            if (size := spec.image_bytes(True)) > MOST_BYTES:
                text = f"expected at most {MOST_BYTES >> 20} MB of pixel data, got {size >> 20} MB; save fewer channels"
                raise InvalidPhoto(text, source=name)
            values = _values(image, photometric)
            profile = spec.getattribute("ICCProfile")
            return {
                "values": values,
                "premultiplied": kind == "tiff" and not spec.get_int_attribute("oiio:UnassociatedAlpha"),
                "profile": b"" if profile is None else np.asarray(profile, np.uint8).tobytes(),
            }
    except InvalidPhoto:
        raise
    except ValueError as error:
        if not opened:
            return None
        text = f"expected a complete image, got a damaged or truncated one ({error}); copy it again"
        raise InvalidPhoto(text, source=name) from error


def _values(image: ImageInput, photometric: int) -> np.ndarray:
    """Read the colours and alpha of an open picture, integers as unsigned, white at the largest."""
    spec = image.spec()
    colors = 3 if spec.nchannels >= 3 else 1
    has_alpha = spec.alpha_channel == colors or (spec.nchannels == 2 and image.format_name() == "jpegxl")
    values = read_pixels(image, range(colors + has_alpha))
    if values.dtype.kind == "f":
        return values.astype(np.float32)
    if values.dtype == np.int16:
        values = np.rint(np.maximum(values, 0) * np.float32(65535 / 32767)).astype(np.uint16)
    if photometric == WHITE_IS_ZERO:
        values[..., 0] = np.iinfo(values.dtype).max - values[..., 0]
    return values


def heif_sixteen_bits(stream: BinaryIO) -> np.ndarray | None:
    """Return a HEIC picture of more than 8 bits as uint16 [H, W, 3 or 4], upright; None for one of 8 bits."""
    import pillow_heif

    stream.seek(0)
    picture = pillow_heif.open_heif(stream, convert_hdr_to_8bit=False)
    return np.array(picture) if picture.mode in ("RGB;16", "RGBA;16") else None


def turned_upright(values: np.ndarray, orientation: int) -> np.ndarray:
    """Turn an array [H, W, ...] upright from its EXIF orientation."""
    if orientation in ON_ITS_SIDE:
        values = values.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    return np.ascontiguousarray(values)


def straight(values: np.ndarray) -> np.ndarray:
    """Divide premultiplied colours of integers by their alpha."""
    top = np.iinfo(values.dtype).max
    share = np.maximum(values[..., -1:], 1) / np.float32(top)
    color = np.rint(np.minimum(values[..., :-1] / share, top))
    return np.concatenate([color.astype(values.dtype), values[..., -1:]], axis=-1)

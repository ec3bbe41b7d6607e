"""Pictures of more than 8 bits that Pillow reads with 8, or not at all: 16-bit colour, and TIFF of floats."""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from PIL import Image, ImageFile
from PIL.TiffImagePlugin import TiffImageFile

from anyprobe.errors import InvalidPhoto
from anyprobe.pictures.headers import MAX_PIXELS, check_size

OTHER_HALF = {"B": "L", "L": "B", "N": "B" if sys.byteorder == "little" else "L"}
"""Last letters of Pillow's names of 16-bit layouts: each layout keeps the byte of a value that its partner drops."""

TIFF_STARTS = (b"II*\0", b"MM\0*")
MAX_ENTRIES = 4096
MOST_BYTES = 16 * MAX_PIXELS
"""Largest number of bytes in the tiles of a TIFF: four floats a pixel."""
MAX_SAMPLES = 16

WIDTH, HEIGHT, BITS_PER_SAMPLE, COMPRESSION, PHOTOMETRIC, STRIPS, ORIENTATION = 256, 257, 258, 259, 262, 273, 274
SAMPLES, ROWS_PER_STRIP, STRIP_SIZES, PLANAR, PREDICTOR = 277, 278, 279, 284, 317
TILE_WIDTH, TILE_HEIGHT, TILES, TILE_SIZES, EXTRA, FORMAT = 322, 323, 324, 325, 338, 339
EXIF, PROFILE, FILL_ORDER = 34665, 34675, 266
"""Tags of TIFF 6.0."""

KEPT = (HEIGHT, COMPRESSION, FILL_ORDER, STRIPS, ROWS_PER_STRIP, STRIP_SIZES, TILE_HEIGHT, TILES, TILE_SIZES, EXIF)
"""Tags that are kept when a picture of floats is presented to Pillow as one of bytes."""

BYTES_OF = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
"""Bytes of a value, by TIFF type."""

_Entry = tuple[int, int, bytes]
"""Type of a tag, number of its values, and their bytes."""


def sixteen_bits(image: ImageFile.ImageFile, reopen: Callable[[], ImageFile.ImageFile]) -> np.ndarray | None:
    """Return a PNG or TIFF of 16-bit colour as uint16 [H, W, 2, 3 or 4]; None for any other.

    Pillow keeps the upper byte of each value; read again as if in the other byte order, it keeps the lower one.

    Args:
        image: opened, not loaded.
        reopen: opens the same file again.
    Raises:
        ValueError: a TIFF of separate planes, which Pillow misreads as 8 bits.
    """
    layout = stored_layout(image)
    if isinstance(image, TiffImageFile) and layout == "R" and max(image.tag_v2.get(BITS_PER_SAMPLE, (8,))) > 8:
        raise ValueError("more than 8 bits in separate planes; save it with interleaved channels")
    if image.format not in ("PNG", "TIFF") or layout[:-1] not in ("RGB;16", "RGBA;16", "RGBX;16", "LA;16"):
        return None
    if "transparency" in image.info:
        return None
    upper = np.asarray(image)
    again = reopen()
    if layout == "LA;16B":  # four bytes a pixel
        again.tile = [tile._replace(args="RGBA") for tile in again.tile]
        return np.asarray(again).view(">u2").astype(np.uint16)
    other = layout[:-1] + OTHER_HALF[layout[-1]]
    again.tile = [
        tile._replace(args=other if isinstance(tile.args, str) else (other, *(tile.args or ())[1:]))
        for tile in again.tile
    ]
    lower = np.asarray(again)
    channels = 3 if layout.startswith("RGBX") else upper.shape[2]
    return upper[..., :channels].astype(np.uint16) << 8 | lower[..., :channels]


def is_white_zero(image: Image.Image) -> bool:
    """Return whether a TIFF's 16-bit grey is stored inverted, white as 0, which Pillow does not undo."""
    return isinstance(image, TiffImageFile) and image.mode.startswith("I") and image.tag_v2.get(PHOTOMETRIC) == 0


def heif_sixteen_bits(stream: BinaryIO) -> np.ndarray | None:
    """Return a HEIC picture of more than 8 bits as uint16 [H, W, 3 or 4], upright; None for one of 8 bits."""
    import pillow_heif

    stream.seek(0)
    picture = pillow_heif.open_heif(stream, convert_hdr_to_8bit=False)
    return np.array(picture) if picture.mode in ("RGB;16", "RGBA;16") else None


def stored_layout(image: ImageFile.ImageFile) -> str:
    """Return Pillow's name for the layout of the file's values, "" where there is none."""
    arguments = image.tile[0].args if image.tile else ""
    first = arguments[0] if isinstance(arguments, tuple) and arguments else arguments
    return first if isinstance(first, str) else ""


@dataclass(frozen=True, kw_only=True, slots=True)
class FloatPicture:
    """Pixels of a TIFF of floats.

    Attributes:
        values: [H, W, C] float32, upright; of 2 or 4 channels the last is alpha.
        premultiplied: whether colour is multiplied by alpha.
        profile: the embedded ICC profile, or empty.
        image: opened picture, for its EXIF.
    """

    values: np.ndarray
    premultiplied: bool
    profile: bytes
    image: Image.Image


def read_float_tiff(data: bytes, name: str) -> FloatPicture | None:
    """Read a TIFF of 16-, 32- or 64-bit floats; None for any other file.

    Pillow decompresses it, presented as a picture of bytes.

    Raises:
        InvalidPhoto: too large, truncated, or of a layout that cannot be read.
    """
    if data[:4] not in TIFF_STARTS:
        return None
    order = "<" if data[:2] == b"II" else ">"
    try:
        entries = _entries(data, order)
        if FORMAT not in entries or set(_numbers(entries[FORMAT], order)) != {3}:
            return None
        width, height = _first_number(entries, WIDTH, order), _first_number(entries, HEIGHT, order)
        samples, bits = _first_number(entries, SAMPLES, order, 1), set(_numbers(entries[BITS_PER_SAMPLE], order))
        planar, predictor = _first_number(entries, PLANAR, order, 1), _first_number(entries, PREDICTOR, order, 1)
        extra = _numbers(entries[EXTRA], order) if EXTRA in entries else ()
        tile = _first_number(entries, TILE_WIDTH, order, 0)
        orientation = _first_number(entries, ORIENTATION, order, 1)
        profile = entries[PROFILE][2] if PROFILE in entries else b""
    except (struct.error, KeyError, IndexError):  # no picture, or a truncated one
        return None
    check_size(width, height, name)
    colors = 3 if samples >= 3 else 1
    is_supported = (
        planar == 1 and samples in range(1, MAX_SAMPLES + 1) and tile in range(65536) and predictor in (1, 2, 3)
    )
    if not is_supported or len(bits) != 1 or not bits <= {16, 32, 64}:
        raise InvalidPhoto(
            "expected a TIFF of 16-, 32- or 64-bit floats with interleaved channels, got another layout; "
            "save it as OpenEXR (.exr)",
            source=name,
        )
    size = bits.pop() // 8
    tiles_across = -(-width // tile) if tile else 1
    row_bytes = (tile or width) * samples * size
    if row_bytes * tiles_across * height > MOST_BYTES:
        raise InvalidPhoto(
            f"expected at most {MOST_BYTES >> 20} MB of pixel data, "
            f"got {row_bytes * tiles_across * height >> 20} MB; save fewer channels, without tiles",
            source=name,
        )
    try:
        kept = {tag: entries[tag] for tag in KEPT if tag in entries}
        as_bytes = _as_bytes(data, order, kept, row_bytes * tiles_across, row_bytes if tile else 0)
        image = TiffImageFile(io.BytesIO(as_bytes), "")
        with suppress(Exception):  # damaged EXIF; read here, since it is gone once the pixels are read
            image.getexif().get_ifd(EXIF)
        raw = np.asarray(image).reshape(height * tiles_across, row_bytes)
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        text = "expected a complete TIFF of floats, got a damaged or truncated one; copy it again"
        raise InvalidPhoto(text, source=name) from error
    values = _unpredicted(raw, predictor, samples, size, order).reshape(height, -1, samples)[:, :width]
    alpha = len(extra) > 0 and extra[0] in (1, 2) and samples > colors
    return FloatPicture(
        values=np.ascontiguousarray(turned_upright(values[..., : colors + alpha], orientation), np.float32),
        premultiplied=alpha and extra[0] == 1,
        profile=profile,
        image=image,
    )


def float_tiff_size(data: bytes) -> tuple[int, int] | None:
    """Return width and height of a TIFF of floats; None for any other file."""
    order = "<" if data[:2] == b"II" else ">"
    try:
        entries = _entries(data, order)
        if FORMAT in entries and set(_numbers(entries[FORMAT], order)) == {3}:
            return _first_number(entries, WIDTH, order), _first_number(entries, HEIGHT, order)
    except (struct.error, KeyError, IndexError):
        pass
    return None


def turned_upright(values: np.ndarray, orientation: int) -> np.ndarray:
    """Turn an array [H, W, ...] upright from its EXIF orientation."""
    if orientation in (5, 6, 7, 8):
        values = values.swapaxes(0, 1)
    if orientation in (2, 3, 6, 7):
        values = values[:, ::-1]
    if orientation in (3, 4, 7, 8):
        values = values[::-1]
    return values


def _entries(data: bytes, order: str) -> dict[int, _Entry]:
    """Return the tags of a TIFF's first directory."""
    (at,) = struct.unpack_from(f"{order}I", data, 4)
    (count,) = struct.unpack_from(f"{order}H", data, at)
    found = {}
    for k in range(min(count, MAX_ENTRIES)):
        tag, kind, number = struct.unpack_from(f"{order}HHI", data, at + 2 + 12 * k)
        length = number * BYTES_OF.get(kind, 1)
        place = at + 10 + 12 * k
        if length > 4:
            (place,) = struct.unpack_from(f"{order}I", data, place)
        found[tag] = kind, number, data[place : place + length]
    return found


def _numbers(entry: _Entry, order: str) -> tuple[int, ...]:
    kind, number, value = entry
    code = {1: "B", 3: "H", 4: "I", 13: "I", 16: "Q"}[kind]
    return struct.unpack(f"{order}{number}{code}", value)


def _first_number(entries: dict[int, _Entry], tag: int, order: str, default: int | None = None) -> int:
    if tag not in entries and default is not None:
        return default
    return _numbers(entries[tag], order)[0]


def _as_bytes(data: bytes, order: str, kept: dict[int, _Entry], width: int, tile_width: int) -> bytes:
    """Return the same file with a directory that describes it as an 8-bit grey picture, `width` pixels wide."""
    grey = {WIDTH: width, BITS_PER_SAMPLE: 8, PHOTOMETRIC: 1, SAMPLES: 1, PLANAR: 1, FORMAT: 1}
    grey |= {TILE_WIDTH: tile_width} if tile_width else {}
    entries = kept | {tag: (4, 1, struct.pack(f"{order}I", value)) for tag, value in grey.items()}
    start = len(data) + len(data) % 2
    beyond = start + 2 + 12 * len(entries) + 4
    directory, values = struct.pack(f"{order}H", len(entries)), b""
    for tag, (kind, number, value) in sorted(entries.items()):
        if len(value) > 4:
            place = struct.pack(f"{order}I", beyond + len(values))
            values += value + bytes(len(value) % 2)
        else:
            place = value.ljust(4, b"\0")
        directory += struct.pack(f"{order}HHI", tag, kind, number) + place
    head = data[:4] + struct.pack(f"{order}I", start) + data[8:] + bytes(len(data) % 2)
    return head + directory + bytes(4) + values


def _unpredicted(raw: np.ndarray, predictor: int, samples: int, size: int, order: str) -> np.ndarray:
    """Return the floats of rows of bytes [N, R], their predictor undone (TIFF 6.0, section 14; Adobe's Note 3)."""
    count = raw.shape[1] // size
    if predictor == 3:
        sums = np.cumsum(raw.reshape(len(raw), -1, samples), axis=1, dtype=np.uint8)
        planes = sums.reshape(len(raw), size, count)
        return np.ascontiguousarray(np.moveaxis(planes, 1, 2)).view(f">f{size}")[..., 0]
    if predictor == 2:
        whole = raw.view(f"{order}u{size}").reshape(len(raw), -1, samples)
        sums = np.cumsum(whole, axis=1, dtype=f"u{size}").astype(f"{order}u{size}")
        return sums.reshape(len(raw), count).view(f"{order}f{size}")
    return raw.view(f"{order}f{size}")


def full_range(values: np.ndarray, image: Image.Image) -> np.ndarray:
    """Scale integers to uint16 with white at 65535; a TIFF's 12-bit and signed 16-bit values have it lower."""
    tags = getattr(image, "tag_v2", {})
    white = 65535
    if image.format == "TIFF" and tags.get(BITS_PER_SAMPLE) == (12,):
        white = 4095
    elif image.format == "TIFF" and tags.get(FORMAT, (1,))[0] == 2:
        white = 32767
    return values.astype(np.uint16) if white == 65535 else np.rint(values * (65535 / white)).astype(np.uint16)

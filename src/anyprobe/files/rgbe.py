"""Inside a Radiance .hdr: its header, pixels of three mantissas under one exponent, run-length coded rows."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import REC709_CHROMATICITIES
from anyprobe.errors import InvalidEnvironment

HDR_MAGIC = b"#?"
RESOLUTION = re.compile(rb"-Y (\d{1,9}) \+X (\d{1,9})")

HDR_HEADER_BYTES = 1 << 16
"""The header ends within these."""

RGBE_MAX = 255.0 * 2.0**119
"""Largest value of a shared-exponent pixel: mantissa 255, exponent byte 255."""

RLE_WIDTHS = range(8, 32768)
"""Widths that the new run-length coding can hold; others are written flat."""

COMMENT_WIDTH = 72
"""Characters of an attribute's value in one line of a header."""

UNSTATED = (0.0,) * 8
"""PRIMARIES as programs write them that know of none."""

MIN_RUN = 4
"""Shorter repetitions cost more as runs than inside a literal."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HdrHeader:
    """What a .hdr says before its pixels, which begin at byte `at`.

    exposure: what the pixels were multiplied by.
    primaries: CIE x, y of red, green, blue and white; those of Rec. 709 where the file names none, or eight zeros.
    """

    height: int
    width: int
    exposure: float
    primaries: tuple[float, ...]
    at: int


def read_header(data: bytes, name: str, max_pixels: int) -> HdrHeader:
    """The header of a .hdr from the file's first bytes; InvalidEnvironment if it cannot be read by it."""
    header, blank, body = data[:HDR_HEADER_BYTES].partition(b"\n\n")
    if not data.startswith(HDR_MAGIC) or not blank:
        raise InvalidEnvironment(f"{name}: expected a Radiance .hdr file, got other or no data; save it again")
    exposure, primaries = 1.0, REC709_CHROMATICITIES
    for line in header.split(b"\n"):
        key, _, value = line.partition(b"=")
        if key.strip() == b"FORMAT" and value.strip() != b"32-bit_rle_rgbe":
            raise InvalidEnvironment(f"{name}: expected FORMAT=32-bit_rle_rgbe, got {_shown(value)}; save it as RGBE")
        if key.strip() == b"EXPOSURE":  # cumulative: each line tells a factor already multiplied in
            try:
                exposure *= float(value)
            except ValueError:
                exposure = 0.0
        if key.strip() == b"PRIMARIES":
            try:
                primaries = tuple(float(number) for number in value.split())
            except ValueError as error:
                raise InvalidEnvironment(
                    f"{name}: expected PRIMARIES to be eight numbers, got {_shown(value)}; repair the header"
                ) from error
    if primaries == UNSTATED:
        primaries = REC709_CHROMATICITIES
    if not (np.isfinite(exposure) and exposure > 0.0):
        raise InvalidEnvironment(f"{name}: expected EXPOSURE to be a number > 0; repair the header")
    line, _, _ = body.partition(b"\n")
    size = RESOLUTION.fullmatch(line.strip())
    if size is None:
        raise InvalidEnvironment(f"{name}: expected the size as -Y H +X W, got {_shown(line[:40])!r}; save it upright")
    height, width = int(size[1]), int(size[2])
    if not 0 < height * width <= max_pixels:
        raise InvalidEnvironment(
            f"{name}: expected at most {max_pixels / 1e6:.0f} million pixels, got {width} x {height}; shrink it first"
        )
    at = len(header) + len(blank) + len(line) + 1
    return HdrHeader(height=height, width=width, exposure=exposure, primaries=primaries, at=at)


def hdr_pixels(data: bytes) -> int:
    """Width times height by a file's first bytes, where its pixels begin; 0 where they do not say."""
    body = data[:HDR_HEADER_BYTES].partition(b"\n\n")[2]
    size = RESOLUTION.fullmatch(body.partition(b"\n")[0].strip())
    return 0 if size is None else int(size[1]) * int(size[2])


def comments(attributes: Mapping[str, str], begin: str) -> str:
    """Attributes as lines of a header that every reader passes over; one that is long has several.

    Some readers take 127 bytes at a time, and the rest of a longer line for the next.
    """
    lines = []
    for key, value in attributes.items():
        plain = " ".join(str(value).split()).encode("ascii", "backslashreplace").decode()
        lines += [f"# {begin}{key}={part}\n" for part in textwrap.wrap(plain, COMMENT_WIDTH, break_on_hyphens=False)]
    return "".join(lines)


def read_comments(data: bytes, begin: str) -> dict[str, str]:
    """The attributes that comments wrote, from a file's first bytes."""
    found: dict[str, str] = {}
    for line in data[:HDR_HEADER_BYTES].partition(b"\n\n")[0].decode("ascii", "replace").split("\n"):
        key, equals, value = line.removeprefix(f"# {begin}").partition("=")
        if equals and line.startswith(f"# {begin}"):
            found[key] = f"{found[key]} {value}" if key in found else value
    return found


def float_to_rgbe(radiance: np.ndarray) -> np.ndarray:
    """Ward 1991: three mantissas under the exponent of the largest, [H, W, 3] -> [H, W, 4] uint8.

    Rounded, not cut, because today's readers add no half step back.
    """
    rgb = np.minimum(radiance.astype(np.float64), RGBE_MAX)
    largest = rgb.max(axis=-1)
    mantissa, exponent = np.frexp(largest)
    exponent = exponent + (mantissa >= 255.5 / 256.0)  # 255.5 would round up to a ninth bit
    rgbe = np.empty((*largest.shape, 4), dtype=np.uint8)
    rgbe[..., :3] = np.rint(np.ldexp(rgb, 8 - exponent[..., None]))
    rgbe[..., 3] = np.clip(exponent + 128, 0, 255)
    rgbe[(largest == 0.0) | (exponent + 128 < 1)] = 0  # black, or below the smallest exponent
    return rgbe


def rgbe_to_float(rgbe: np.ndarray) -> np.ndarray:
    """[H, W, 4] uint8 to [H, W, 3] float32; exponent byte 0 is black."""
    scale = np.ldexp(np.float32(1.0), rgbe[..., 3].astype(np.int32) - 136)
    return rgbe[..., :3] * np.where(rgbe[..., 3] == 0, np.float32(0.0), scale)[..., None]


def encode_rows(rgbe: np.ndarray) -> list[bytes]:
    """[H, W, 4] uint8 as pieces of a file: run-length coded where the width allows it, else flat."""
    width = rgbe.shape[1]
    if width not in RLE_WIDTHS:
        return [rgbe.tobytes()]
    pieces = []
    for row in np.ascontiguousarray(np.moveaxis(rgbe, 2, 1)):  # [4, W]: one channel after the other
        pieces.append(_start(width))
        pieces.extend(_encode_runs(channel) for channel in row)
    return pieces


def least_bytes(width: int) -> int:
    """Of a row: its start, and runs of 127 pixels in each channel; flat where it cannot be coded."""
    return min(4 * width, 4 + 8 * -(-width // 127)) if width in RLE_WIDTHS else 4 * width


def decode_row(data: bytes, at: int, width: int) -> tuple[np.ndarray, int]:
    """The row [W, 4] uint8 of a file that begins at byte `at`, run-length coded or flat, and where the next row begins.

    Raises:
        EOFError: cut, or runs that do not end with the row.
        ValueError: the run-length coding of the 1980s.
    """
    if width not in RLE_WIDTHS or data[at : at + 4] != _start(width):
        flat = np.frombuffer(data[at : at + 4 * width], dtype=np.uint8)
        if flat.size < 4 * width:
            raise EOFError
        row = flat.reshape(width, 4)
        if (row[:, :3] == 1).all(axis=1).any():  # no mantissas, but a repeat mark
            raise ValueError
        return row, at + 4 * width
    at += 4
    row = np.empty((width, 4), dtype=np.uint8)
    for i in range(4):
        channel = bytearray()
        while len(channel) < width:
            if at + 1 >= len(data):
                raise EOFError
            count = data[at]
            if count > 128:
                channel += data[at + 1 : at + 2] * (count - 128)
                at += 2
            else:
                channel += data[at + 1 : at + 1 + count]
                at += 1 + count
                if count == 0 or at > len(data):
                    raise EOFError
        if len(channel) != width:
            raise EOFError
        row[:, i] = np.frombuffer(channel, dtype=np.uint8)
    return row, at


def _shown(value: bytes) -> str:
    """A header's value for a message."""
    return value.strip().decode("ascii", "replace")


def _start(width: int) -> bytes:
    """What a run-length coded row begins with."""
    return bytes((2, 2, width >> 8, width & 255))


def _encode_runs(row: np.ndarray) -> bytes:
    """One channel of one row, uint8 [W]: count > 128 repeats a byte, count <= 128 copies bytes."""
    starts = np.concatenate([[0], np.flatnonzero(row[1:] != row[:-1]) + 1])
    lengths = np.diff(starts, append=row.size)
    long = lengths >= MIN_RUN
    data = row.tobytes()
    out = bytearray()
    cursor = 0
    for start, length in [*zip(starts[long].tolist(), lengths[long].tolist(), strict=True), (row.size, 0)]:
        for at in range(cursor, start, 128):
            literal = data[at : min(at + 128, start)]
            out.append(len(literal))
            out += literal
        for at in range(0, length, 127):
            out.append(128 + min(127, length - at))
            out.append(data[start])
        cursor = start + length
    return bytes(out)

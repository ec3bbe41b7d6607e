"""Contents of a Radiance .hdr: its header, and shared-exponent pixels."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import REC709_CHROMATICITIES, XYZ_CHROMATICITIES
from anyprobe.errors import InvalidEnvironment

HDR_MAGIC = b"#?"
RESOLUTION = re.compile(rb"([+-][XY]) +(\d{1,9}) +([+-][XY]) +(\d{1,9})")
"""Axis and number of rows, then axis and number of a row's pixels; -Y is down, +X to the right."""
BLANK = re.compile(rb"\r?\n\r?\n")

HDR_HEADER_BYTES = 1 << 16
"""Largest size [bytes] of a header."""

RGBE_MAX = 255.0 * 2.0**119
"""Largest value of a shared-exponent pixel: mantissa 255, exponent byte 255."""

COMMENT_WIDTH = 72
"""Largest number of characters of an attribute's value in one line of a header."""

_FORMATS = (b"32-bit_rle_rgbe", b"32-bit_rle_xyze")

UNSTATED = (0.0,) * 8
"""PRIMARIES as written by programs that do not know them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HdrHeader:
    """Header of a .hdr.

    Attributes:
        height, width: number of rows as they are stored, and of pixels in a row.
        axes: along which rows, and a row's pixels, follow each other.
        exposure: factors that red, green and blue were multiplied by.
        primaries: CIE x, y of red, green, blue and white; those of Rec. 709 where the file names none, or eight zeros.
        at: first byte of the pixels.
    """

    height: int
    width: int
    axes: tuple[bytes, bytes]
    exposure: tuple[float, float, float]
    primaries: tuple[float, ...]
    at: int

    def upright(self, stored: np.ndarray) -> np.ndarray:
        """Turn pixels [height, width, C] as they are stored upright."""
        rows, columns = self.axes
        stored = stored[:: 1 if rows in (b"-Y", b"+X") else -1, :: 1 if columns in (b"-Y", b"+X") else -1]
        return stored if rows.endswith(b"Y") else stored.swapaxes(0, 1)


def read_header(data: bytes, name: str, max_pixels: int) -> HdrHeader:
    """Parse the header in a .hdr file's first bytes; InvalidEnvironment if it is damaged, unsupported or too large."""
    start = data[:HDR_HEADER_BYTES]
    blank = BLANK.search(start)
    if not data.startswith(HDR_MAGIC) or blank is None:
        raise InvalidEnvironment("expected a Radiance .hdr file, got something else; copy it again", source=name)
    exposure, form = np.ones(3), _FORMATS[0]
    primaries: tuple[float, ...] = REC709_CHROMATICITIES
    for line in start[: blank.start()].split(b"\n"):
        if line[:1] in (b"\t", b" "):  # headers of the files that it was made from
            continue
        key, _, value = line.partition(b"=")
        key, value = key.strip(), value.strip()
        if key == b"FORMAT":
            form = value
        if key == b"EXPOSURE":  # cumulative, as COLORCORR: every line is a factor already applied
            exposure *= _factors(value, 1, "EXPOSURE to be a number > 0", name)
        if key == b"COLORCORR":
            exposure *= _factors(value, 3, "COLORCORR to be three numbers > 0", name)
        if key == b"GAMMA" and not np.allclose(_factors(value, 1, "GAMMA to be 1", name), 1.0, atol=1e-3):
            raise InvalidEnvironment(f"expected GAMMA=1, got {_shown(value)}; save it as linear radiance", source=name)
        if key == b"PRIMARIES":
            try:
                primaries = tuple(float(number) for number in value.split())
            except ValueError as error:
                text = f"expected PRIMARIES to be eight numbers, got {_shown(value)}; repair the header"
                raise InvalidEnvironment(text, source=name) from error
    if form not in _FORMATS:
        raise InvalidEnvironment(f"expected FORMAT=32-bit_rle_rgbe, got {_shown(form)}; save it as RGBE", source=name)
    if primaries == UNSTATED or form != _FORMATS[0]:
        primaries = REC709_CHROMATICITIES if form == _FORMATS[0] else XYZ_CHROMATICITIES
    if not (np.isfinite(exposure) & (exposure > 0.0)).all():
        raise InvalidEnvironment("expected EXPOSURE to be a number > 0; repair the header", source=name)
    line, _, _ = data[blank.end() : HDR_HEADER_BYTES].partition(b"\n")
    size = RESOLUTION.fullmatch(line.strip())
    if size is None or size[1][1:] == size[3][1:]:
        text = f"expected the size as -Y H +X W, got {_shown(line[:40])!r}; save it again"
        raise InvalidEnvironment(text, source=name)
    height, width = int(size[2]), int(size[4])
    if not 0 < height * width <= max_pixels:
        text = f"expected at most {max_pixels / 1e6:.0f} million pixels, got {width} x {height}; shrink it first"
        raise InvalidEnvironment(text, source=name)
    red, green, blue = exposure.tolist()
    return HdrHeader(
        height=height,
        width=width,
        axes=(size[1], size[3]),
        exposure=(red, green, blue),
        primaries=primaries,
        at=blank.end() + len(line) + 1,
    )


def _factors(value: bytes, count: int, expected: str, name: str) -> np.ndarray:
    """Parse the factors in a header's line; 0, which image libraries write for unknown, counts as 1."""
    try:
        numbers = np.array([float(number) for number in value.split()])
    except ValueError:
        numbers = np.array([-1.0])
    if len(numbers) != count or not (np.isfinite(numbers) & (numbers >= 0.0)).all():
        raise InvalidEnvironment(f"expected {expected}, got {_shown(value)}; repair the header", source=name)
    return np.where(numbers == 0.0, 1.0, numbers)


def hdr_pixels(data: bytes) -> int:
    """Return width times height from a file's first bytes; 0 where they do not hold the whole header."""
    blank = BLANK.search(data[:HDR_HEADER_BYTES])
    size = blank and RESOLUTION.fullmatch(data[blank.end() : HDR_HEADER_BYTES].partition(b"\n")[0].strip())
    return int(size[2]) * int(size[4]) if size else 0


def comments(attributes: Mapping[str, str], prefix: str) -> str:
    """Format attributes as comment lines of a header; a long value takes several.

    Some readers read 127 bytes at a time and take the rest of a longer line for the next one.
    """
    lines = []
    for key, value in attributes.items():
        plain = " ".join(str(value).split()).encode("ascii", "backslashreplace").decode()
        lines += [f"# {prefix}{key}={part}\n" for part in textwrap.wrap(plain, COMMENT_WIDTH, break_on_hyphens=False)]
    return "".join(lines)


def read_comments(data: bytes, prefix: str) -> dict[str, str]:
    """Parse the attributes that `comments` wrote from a file's first bytes."""
    found: dict[str, str] = {}
    start = data[:HDR_HEADER_BYTES]
    blank = BLANK.search(start)
    for line in start[: blank.start() if blank else None].decode("ascii", "replace").splitlines():
        key, equals, value = line.removeprefix(f"# {prefix}").partition("=")
        if equals and line.startswith(f"# {prefix}"):
            found[key] = f"{found[key]} {value}" if key in found else value
    return found


def rounded_up(radiance: np.ndarray) -> np.ndarray:
    """Add half a step of the shared exponent to radiance [H, W, 3], so that a writer that truncates mantissas rounds.

    Rounded, because today's readers do not add half a step (Ward 1991 did).
    """
    rgb = np.minimum(radiance, np.float32(RGBE_MAX))
    largest = rgb.max(axis=-1, keepdims=True)
    _, exponent = np.frexp(largest * np.float32(512 / 511))  # 255.5 rounds up to a ninth bit
    return np.minimum(rgb + np.where(largest > 0.0, np.ldexp(np.float32(1.0), exponent - 9), 0.0), RGBE_MAX)


def _shown(value: bytes) -> str:
    """Format a header's value for a message."""
    return value.strip().decode("ascii", "replace")

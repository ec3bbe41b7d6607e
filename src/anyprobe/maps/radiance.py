"""Linear radiance on disk: Radiance .hdr (RGBE) and OpenEXR .exr, environment maps and pictures of any shape.

A map is latitude-longitude, row 0 up, H x 2H; ours in Rec. 709 primaries. OpenImageIO decodes both, by
image_io.open_image; of a .hdr the header is read here.
"""

import os
import re
import textwrap
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import (
    COLORSPACES,
    REC709_CHROMATICITIES,
    SAME_CHROMATICITIES,
    XYZ_CHROMATICITIES,
    from_rec709,
    rec709_from_rgb,
)
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import open_regular, read_rest
from anyprobe.light.environment import check_radiance
from anyprobe.maps.exr import EXR_MAGIC, exr_attributes, open_exr, read_exr, to_rec709, write_channels
from anyprobe.maps.image_io import encode_image, open_image, read_pixels

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
        exposure: [3] factors that red, green and blue were multiplied by.
        primaries: CIE x, y of red, green, blue and white; those of Rec. 709 where the file names none, or eight zeros.
        at: first byte of the pixels.
    """

    height: int
    width: int
    axes: tuple[bytes, bytes]
    exposure: np.ndarray
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
    at = blank.end() + len(line) + 1
    return HdrHeader(height=height, width=width, axes=(size[1], size[3]), exposure=exposure, primaries=primaries, at=at)


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


MAX_MAP_PIXELS = 16384 * 8192
"""Largest number of pixels of a map that is decoded; checked in the header first."""

HALF_MAX = 65504.0
"""Largest finite half; larger values would become infinity."""

HALF_MIN = 2.0**-14
"""Smallest half of full precision; smaller values lose digits, and below 3e-8 become 0."""

ATTRIBUTE = "anyprobe:"
"""Prefix of the names of our own strings in an .exr's header."""


def read_radiance(path: str | os.PathLike[str], max_pixels: int = MAX_MAP_PIXELS) -> np.ndarray:
    """Read a .hdr or .exr map, whatever its name: [H, 2H, 3] float32, linear Rec. 709, >= 0.

    Other primaries that the file names (an .exr's chromaticities, a .hdr's PRIMARIES) are converted
    to Rec. 709, white to white; a colour outside of Rec. 709 is clipped at 0.

    Args:
        max_pixels: largest number of pixels, checked before they are decoded.
    Raises:
        InvalidEnvironment: the file is absent, damaged, not HDR, not H x 2H, too large or of impossible primaries.
    """
    path = Path(path)
    with open_regular(path, InvalidEnvironment, "a radiance map") as stream:
        start = stream.read(HDR_HEADER_BYTES)
        is_hdr = start.startswith(HDR_MAGIC)
        if is_hdr:
            read_header(start, path.name, max_pixels)  # refuses a damaged or large one before all of it is read
        elif not start.startswith(EXR_MAGIC):
            got = "another kind of file" if start else "an empty one (0 bytes)"
            text = f"expected a Radiance .hdr or an OpenEXR .exr, got {got}; other pictures do not hold radiance"
            raise InvalidEnvironment(text, source=path.name)
        data = start + read_rest(stream)
    if is_hdr:
        return check_radiance(decode_hdr(data, path.name, max_pixels), path.name)
    return check_radiance(read_exr(data, path.name, InvalidEnvironment, max_pixels, rec709=True)[..., :3], path.name)


def read_linear(source: object, max_pixels: int) -> np.ndarray | None:
    """Read the radiance of an .exr or .hdr of any shape from a path or bytes; None for files with other first bytes.

    Returns:
        [H, W, 4] float32: linear Rec. 709 >= 0 times cover, and cover in [0, 1], 1 where the file has no A.
    Raises:
        InputError: damaged, too large, NaN.
    """
    if not (data := bytes_of(source, EXR_MAGIC, HDR_MAGIC)):
        return None
    name = Path(source).name if isinstance(source, str | os.PathLike) else "bytes"
    if data.startswith(EXR_MAGIC):
        pixels = read_exr(data, name, InputError, max_pixels, rec709=True)
    else:
        pixels = decode_hdr(data, name, max_pixels)
    if not np.isfinite(pixels).all():
        raise InputError("expected finite radiance, got NaN or infinity; repair the picture first", source=name)
    cover = np.clip(pixels[..., 3:], 0.0, 1.0) if pixels.shape[2] == 4 else np.ones_like(pixels[..., :1])
    return np.concatenate([np.maximum(pixels[..., :3], 0.0) * (cover > 0), cover], axis=-1)


def bytes_of(source: object, *starts: bytes) -> bytes:
    """Return the bytes of a path's file, or bytes, that begin so; none of any other source, nor of a file that cannot
    be opened, which read_image refuses."""
    if isinstance(source, bytes | bytearray | memoryview):
        return bytes(source) if bytes(source[: len(EXR_MAGIC)]).startswith(starts) else b""
    if isinstance(source, str | os.PathLike):
        with suppress(InputError), open_regular(source, InputError) as stream:
            start = stream.read(len(EXR_MAGIC))
            return start + read_rest(stream) if start.startswith(starts) else b""
    return b""


def opaque_linear(source: Path | bytes, colorspace: str, max_pixels: int) -> np.ndarray | None:
    """Read the colours of an opaque .exr in one of COLORSPACES, negative ones kept; None for any other picture.

    Returns:
        [H, W, 3] float32: the file's own numbers where it has that colour space.
    Raises:
        InputError: damaged, too large.
    """
    data, name = bytes_of(source, EXR_MAGIC), source.name if isinstance(source, Path) else "bytes"
    if not data:
        return None
    pixels = read_exr(data, name, InputError, max_pixels)
    if (pixels[..., 3:] < 1.0).any():
        return None
    with open_exr(data, name, InputError, max_pixels) as image:
        stored = image.spec().getattribute("chromaticities") or REC709_CHROMATICITIES
    if np.allclose(stored, COLORSPACES[colorspace], rtol=0.0, atol=SAME_CHROMATICITIES):
        return pixels[..., :3]
    matrix = np.linalg.solve(rec709_from_rgb(COLORSPACES[colorspace]), rec709_from_rgb(stored))
    return pixels[..., :3] @ matrix.T.astype(np.float32)


def write_hdr(
    path: str | os.PathLike[str], radiance: np.ndarray, *, attributes: Mapping[str, str] | None = None
) -> None:
    """Write a map [H, 2H, 3] as Radiance RGBE, new run-length coding, atomically.

    Each pixel keeps 8 bits of its largest channel: the error is at most 1/255 of it.

    Args:
        attributes: stored in the header as comments that begin with "anyprobe:" + key.
    """
    write_hdr_picture(path, check_radiance(radiance), attributes)


def write_hdr_picture(
    path: str | os.PathLike[str], picture: np.ndarray, attributes: Mapping[str, str] | None = None
) -> None:
    """Write a picture of any shape [H, W, 3], finite and >= 0, such as the face of a cube, as .hdr."""
    height, width = picture.shape[:2]
    header = (
        f"#?RADIANCE\nSOFTWARE=anyprobe\n{comments(attributes or {}, ATTRIBUTE)}FORMAT=32-bit_rle_rgbe\n\n"
        f"-Y {height} +X {width}\n"
    ).encode()
    with atomic_path(path) as temporary:
        encoded = encode_image(rounded_up(picture), "hdr", {})
        temporary.write_bytes(header + encoded[read_header(encoded, "", picture.size).at :])


def write_exr(
    path: str | os.PathLike[str],
    radiance: np.ndarray,
    *,
    half: bool | None = True,
    attributes: Mapping[str, str] | None = None,
    colorspace: str = "rec709",
) -> None:
    """Write a map [H, 2H, 3] as OpenEXR with envmap and chromaticities, atomically.

    envmap only says latitude-longitude: OpenEXR has +Z in the centre column, while our maps have the frame in their
    "anyprobe:frame" (docs/reference/conventions.md).

    Args:
        half: 16-bit floats, clamped at 65504; else 32-bit, exact; None: halves unless they would clip.
        attributes: stored in the header as strings named "anyprobe:" + key.
        colorspace: of core.color.COLORSPACES, to which light is converted; the header has its chromaticities.
    """
    pixels = from_rec709(check_radiance(radiance), colorspace)
    if half if half is not None else pixels.max() < HALF_MAX:
        pixels = np.minimum(pixels, np.float32(HALF_MAX)).astype(np.float16)
    named = {f"{ATTRIBUTE}{key}": str(value) for key, value in (attributes or {}).items()}
    channels = {name: pixels[..., i] for i, name in enumerate("RGB")}
    with atomic_path(path) as temporary:
        write_channels(temporary, channels, {"chromaticities": COLORSPACES[colorspace], **named})


def map_attributes(path: str | os.PathLike[str]) -> dict[str, str]:
    """Return the attributes that were given to write_exr or write_hdr; empty without a valid header."""
    with suppress(InputError), open_regular(path, InputError) as stream:
        start = stream.read(HDR_HEADER_BYTES)
        return read_comments(start, ATTRIBUTE) if start.startswith(HDR_MAGIC) else exr_attributes(stream, ATTRIBUTE)
    return {}


def decode_hdr(data: bytes, name: str, max_pixels: int) -> np.ndarray:
    """Decode a whole .hdr file to radiance [H, W, 3] float32, upright, in Rec. 709, divided by EXPOSURE and COLORCORR.

    Raises:
        InvalidEnvironment: damaged, too large, or of the run-length encoding of the 1980s.
    """
    header = read_header(data, name, max_pixels)
    plain = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {header.height} +X {header.width}\n".encode()
    try:
        with open_image(plain + data[header.at :], "hdr") as image:
            radiance = read_pixels(image, range(3)) / header.exposure.astype(np.float32)
    except ValueError as error:
        text = f"expected {header.height} whole rows of RGBE, got fewer; copy or export it again"
        raise InvalidEnvironment(text, source=name) from error
    return to_rec709(np.ascontiguousarray(header.upright(radiance)), header.primaries, name, InvalidEnvironment)

"""OpenEXR pictures: their headers, parsed here before the library opens the file, and their pixels.

Limits cover everything that the library would decode: all parts, all channels. It gets only the attributes that it
needs, since others may be compressed, or hold text of any encoding.
OpenEXR file layout: openexr.com, "OpenEXR File Layout".
"""

from __future__ import annotations

import io
import os
import struct
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np
import OpenEXR

from anyprobe.core.color import REC709_CHROMATICITIES, rec709_from_rgb, xyz_from_rgb
from anyprobe.errors import InputError
from anyprobe.files.paths import read_regular

EXR_MAGIC = b"\x76\x2f\x31\x01"

HEADER_BYTES = 1 << 24
"""Largest header [bytes] that is read; a manifest of object names takes a few megabytes."""

MAX_CHANNELS = 1024
MAX_PARTS = 256
MOST_SIDE_PX = 65_535

MULTIPART, DEEP = 0x1000, 0x800
"""Flags of the version field."""

NEEDED = {
    *("channels", "compression", "dataWindow", "displayWindow", "lineOrder", "pixelAspectRatio"),
    *("screenWindowCenter", "screenWindowWidth", "tiles", "name", "type", "version", "chunkCount"),
}
"""Attributes without which the pixels cannot be decoded."""

CHUNK_ROWS = (1, 1, 1, 16, 32, 16, 32, 32, 32, 256)
"""Rows of a chunk by number of compression: none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB."""

LEAST_ASPECT = 0.25
"""Smallest pixel aspect ratio, and inverse of the largest, that is corrected to square pixels."""

WHOLE_LAYERS = ("combined", "beauty", "rgba", "composite")
"""Lower-case names of layers that hold the whole picture, in files of Blender and other renderers."""

FILLER = 13
"""Size [bytes] of an empty string attribute named x."""

quiet: Callable[[], AbstractContextManager] = nullcontext
"""Context of calls of the library, which prints about damaged files; a program that owns its process may replace it."""

_Window = tuple[np.ndarray, np.ndarray]
"""x, y of the first pixel, and of the one after the last, int64."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ExrHeader:
    """Header of a file.

    Attributes:
        display, data: windows of the first part.
        attributes: raw values of the first part by name: type, bytes.
        decoded: number of pixels of all parts, counted once for every four channels, since all are decoded.
        plain: the header's bytes with only the NEEDED attributes, at their original length.
    """

    display: _Window
    data: _Window
    attributes: Mapping[str, tuple[bytes, bytes]]
    decoded: int
    plain: bytes


def parse_header(data: bytes) -> ExrHeader:
    """Parse the header in a file's first bytes; ValueError if it is damaged, or of a deep picture."""
    if data[:4] != EXR_MAGIC or len(data) < 8:
        raise ValueError("not an OpenEXR file")
    flags = int.from_bytes(data[4:8], "little")
    at, parts, plain = 8, [], [data[:8]]
    while True:
        attributes, end = _parse_part(data, at)
        if flags & MULTIPART and not attributes:
            plain.append(b"\0")
            break
        kind = attributes.get("type", (b"", b""))[1]
        if flags & DEEP or kind.startswith(b"deep"):
            raise ValueError("a deep picture")
        plain.append(_without_rest(data[at:end], attributes))
        parts.append(attributes)
        at = end
        if not flags & MULTIPART:
            break
        if len(parts) > MAX_PARTS:
            raise ValueError("too many parts")
    if not parts:
        raise ValueError("no parts")
    return ExrHeader(
        display=_window(parts[0], "displayWindow"),
        data=_window(parts[0], "dataWindow"),
        attributes=parts[0],
        decoded=sum(map(_count_pixels, parts)),
        plain=b"".join(plain),
    )


def _parse_part(data: bytes, at: int) -> tuple[dict[str, tuple[bytes, bytes]], int]:
    """Parse the part that begins at a byte: its attributes, name to type and bytes, and the next part's start."""
    found: dict[str, tuple[bytes, bytes]] = {}
    while True:
        if at >= min(len(data), HEADER_BYTES):
            raise ValueError("a header without an end")
        name, at = _name(data, at)
        if not name:
            return found, at
        kind, at = _name(data, at)
        size = int.from_bytes(data[at : at + 4], "little", signed=True)
        at += 4
        if size < 0 or at + size > len(data):
            raise ValueError("a truncated header")
        found[name.decode("latin-1")] = kind, data[at : at + size]
        at += size


def _name(data: bytes, at: int) -> tuple[bytes, int]:
    """Return the zero-terminated string at a byte, and where the next value begins."""
    end = data.find(b"\0", at, at + 256)
    if end < 0:
        raise ValueError("a name without an end")
    return data[at:end], end + 1


def _without_rest(part: bytes, attributes: Mapping[str, tuple[bytes, bytes]]) -> bytes:
    """Return a part's header with only the NEEDED attributes, padded to its length, since offsets follow."""
    kept = b"".join(
        name.encode("latin-1") + b"\0" + kind + b"\0" + struct.pack("<i", len(value)) + value
        for name, (kind, value) in attributes.items()
        if name in NEEDED
    )
    room = len(part) - 1 - len(kept)
    if room == 0:
        return kept + b"\0"
    if room < FILLER:
        return part
    return kept + b"x\0string\0" + struct.pack("<i", room - FILLER) + b" " * (room - FILLER) + b"\0"


def _window(attributes: Mapping[str, tuple[bytes, bytes]], name: str) -> _Window:
    kind, value = attributes.get(name, (b"", b""))
    if kind != b"box2i" or len(value) != 16:
        raise ValueError(f"no {name}")
    corners = np.frombuffer(value, "<i4").astype(np.int64)
    low, high = corners[:2], corners[2:] + 1
    if (high <= low).any():
        raise ValueError(f"an empty {name}")
    return low, high


def _count_pixels(attributes: Mapping[str, tuple[bytes, bytes]]) -> int:
    """Count the pixels of one part, see ExrHeader.decoded."""
    value = attributes.get("channels", (b"", b""))[1]
    count, at = 0, 0
    while at < len(value) - 1:
        name, at = _name(value, at)
        at += 16  # type, linearity, sampling
        count += bool(name)
    if not 0 < count <= MAX_CHANNELS:
        raise ValueError("no channels, or too many")
    windows = (_window(attributes, name) for name in ("displayWindow", "dataWindow"))
    return max(int(np.prod(high - low)) for low, high in windows) * -(-count // 4)


def _check_complete(data: bytes, header: ExrHeader) -> None:
    """Raise ValueError if a chunk of rows ends beyond the file; parts and tiles are left to the library."""
    kind = header.attributes.get("compression", (b"", b"\xff"))[1]
    if data[5] & (MULTIPART | 0x200) >> 8 or not kind or kind[0] >= len(CHUNK_ROWS):
        return
    rows = int(header.data[1][1] - header.data[0][1])
    first, count = len(header.plain), -(-rows // CHUNK_ROWS[kind[0]])
    offsets = np.frombuffer(data[first : first + 8 * count], "<u8") if len(data) >= first + 8 * count else [0]
    for at in map(int, offsets):
        if not first < at <= len(data) - 8 or at + 8 + int.from_bytes(data[at + 4 : at + 8], "little") > len(data):
            raise ValueError("a truncated file")


def exr_pixels(data: bytes) -> int:
    """Return the number of pixels that a file would be decoded to, see ExrHeader.decoded; 0 without a valid header."""
    try:
        return parse_header(data).decoded
    except ValueError:
        return 0


def exr_attributes(data: bytes, prefix: str) -> dict[str, str]:
    """Return the text attributes with this prefix, by the rest of their names; empty without a valid header."""
    try:
        found = parse_header(data).attributes
    except ValueError:
        return {}
    return {
        name.removeprefix(prefix): value.decode("utf-8", "replace")
        for name, (kind, value) in found.items()
        if name.startswith(prefix) and kind == b"string"
    }


def read_channels(
    source: str | os.PathLike[str] | bytes, name: str, fault: type[InputError], max_pixels: int
) -> tuple[ExrHeader, dict[str, np.ndarray]]:
    """Read the header and every channel of the first part by name, [H, W] of the data window, as they are stored.

    Args:
        source: a path, or the file's bytes.
        fault: class of the error to raise.
        max_pixels: largest ExrHeader.decoded, checked before pixels are decoded.
    """
    try:
        data = source if isinstance(source, bytes) else read_regular(source, name, fault)
        header = parse_header(data)
    except ValueError as error:
        if isinstance(error, fault):
            raise
        is_deep = "deep" in str(error)
        got = "a deep one; save it flat" if is_deep else f"a damaged or empty file ({error}); export it again"
        raise fault(f"expected a flat OpenEXR picture, got {got}", source=name) from error
    width, height = np.maximum(header.display[1] - header.display[0], header.data[1] - header.data[0]).tolist()
    if header.decoded > max_pixels:
        raise fault(
            f"expected at most {max_pixels / 1e6:.0f} million pixels in all parts and layers, "
            f"got {width} x {height} and {header.decoded / 1e6:.0f} million; shrink it first",
            source=name,
        )
    if max(width, height) > MOST_SIDE_PX:
        raise fault(
            f"expected sides of at most {MOST_SIDE_PX} pixels, got {width} x {height}; shrink it first", source=name
        )
    try:
        _check_complete(data, header)
        stream = io.BytesIO(header.plain + data[len(header.plain) :])
        with quiet(), OpenEXR.File(stream, separate_channels=True, num_threads=0) as file:
            return header, {key: channel.pixels for key, channel in file.channels().items()}
    except (RuntimeError, ValueError, KeyError, TypeError, OSError, MemoryError) as error:
        raise fault("expected an OpenEXR picture, got a damaged or empty file; export it again", source=name) from error


def read_exr(
    source: str | os.PathLike[str] | bytes, name: str, fault: type[InputError], max_pixels: int, *, rec709: bool = False
) -> np.ndarray:
    """Read the colour of an .exr: R, G, B, or Y, or Y, RY, BY, with A if present; else those of a layer, LAYER.R.

    A data window smaller than the display window is padded with black. Pixels that are not square are resampled to more
    or fewer columns.

    Args:
        source, fault, max_pixels: see read_channels.
        rec709: convert light of other chromaticities to linear Rec. 709; else return the numbers as stored.
    Returns:
        [H, W, 3] or [H, W, 4] float32: colour is premultiplied by A.
    """
    header, found = read_channels(source, name, fault, max_pixels)
    kind, value = header.attributes.get("chromaticities", (b"", b""))
    stored = np.frombuffer(value, "<f4").tolist() if (kind, len(value)) == (b"chromaticities", 32) else []
    if not {*"RGBY"} & found.keys():
        found |= _of_layer(found)
    if not {*"RGB"} & found.keys() and {"Y", "RY", "BY"} <= found.keys():
        found |= _from_chroma(found, stored)
    order = "RGB" if all(key in found for key in "RGB") else "YYY"
    layers = [found.get(key) for key in order]
    if found.get("A") is not None:
        layers.append(found["A"])
    shape = tuple((header.data[1] - header.data[0]).tolist()[::-1])
    if any(layer is None or layer.shape != shape for layer in layers):
        listed = ", ".join(sorted(found)[:20]) or "none"
        raise fault(f"expected channels R, G, B or Y of full size, got {listed}; save a flat RGB picture", source=name)
    pixels = np.empty((*shape, len(layers)), dtype=np.float32)
    for i, layer in enumerate(layers):
        pixels[..., i] = layer
    if rec709 and kind:
        pixels[..., :3] = to_rec709(pixels[..., :3], stored, name, fault)
    return square_pixels(in_display(pixels, header), header, max_pixels)


def _of_layer(found: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return R, G, B and perhaps A of the layer of WHOLE_LAYERS, else of the only layer; empty where neither exists."""
    layers = [key[:-2] for key in found if key.endswith(".R") and {f"{key[:-1]}G", f"{key[:-1]}B"} <= found.keys()]
    whole = [layer for layer in layers if layer.rpartition(".")[2].lower() in WHOLE_LAYERS] or layers
    if len(whole) != 1:
        return {}
    return {name: found[f"{whole[0]}.{name}"] for name in "RGBA" if f"{whole[0]}.{name}" in found}


def _from_chroma(found: Mapping[str, np.ndarray], chromaticities: Sequence[float]) -> dict[str, np.ndarray]:
    """Convert luminance and chroma to R, G and B: RY = (R - Y) / Y and BY = (B - Y) / Y, of full or half size.

    The weights of Y follow from the chromaticities. Empty where these are impossible or the sizes do not match.
    """
    y = found["Y"].astype(np.float32)
    try:
        weights = xyz_from_rgb(chromaticities or REC709_CHROMATICITIES)[1]
    except ValueError:
        return {}
    chroma = []
    for name in ("RY", "BY"):
        values = found[name].astype(np.float32)
        for axis in (0, 1):
            if values.shape[axis] != y.shape[axis]:
                if values.shape[axis] != -(-y.shape[axis] // 2):
                    return {}
                values = _interpolated(values, np.arange(y.shape[axis]) / 2, axis)
        chroma.append((values + 1) * y)
    r, b = chroma
    return {"R": r, "G": (y - weights[0] * r - weights[2] * b) / np.float32(weights[1]), "B": b}


def _interpolated(values: np.ndarray, positions: np.ndarray, axis: int) -> np.ndarray:
    """Interpolate linearly along an axis, at positions in pixels from the first one's centre."""
    positions = np.clip(positions, 0, values.shape[axis] - 1)
    low = positions.astype(int)
    high = np.minimum(low + 1, values.shape[axis] - 1)
    share = (positions - low).astype(np.float32).reshape([-1 if k == axis else 1 for k in range(values.ndim)])
    return np.take(values, low, axis) * (1 - share) + np.take(values, high, axis) * share


def square_pixels(pixels: np.ndarray, header: ExrHeader, max_pixels: int, *, nearest: bool = False) -> np.ndarray:
    """Resample the columns of pixels [H, W, ...] so that they are square; unchanged where the ratio is implausible.

    Averaged or interpolated; with nearest, the nearest pixel is taken.
    """
    kind, value = header.attributes.get("pixelAspectRatio", (b"", b""))
    aspect = struct.unpack("<f", value)[0] if (kind, len(value)) == (b"float", 4) else 1.0
    width = pixels.shape[1]
    if not LEAST_ASPECT <= aspect <= 1 / LEAST_ASPECT or round(width * aspect) in (0, width):
        return pixels
    columns = round(width * aspect)
    if columns * len(pixels) > max_pixels:
        return pixels
    edges = np.arange(columns + 1) * width / columns
    if nearest:
        return pixels[:, ((edges[:-1] + edges[1:]) / 2).astype(int)]
    if aspect > 1:
        return _interpolated(pixels, (edges[:-1] + edges[1:]) / 2 - 0.5, 1)
    sums = np.concatenate(
        [np.zeros_like(pixels[:, :1], np.float64), np.cumsum(pixels, axis=1, dtype=np.float64)], axis=1
    )
    return (np.diff(_interpolated(sums, edges, 1), axis=1) * (columns / width)).astype(pixels.dtype)


def in_display(pixels: np.ndarray, header: ExrHeader) -> np.ndarray:
    """Place pixels [H, W, ...] of the data window in the display window: overscan is cropped, missing data is zero."""
    (low, high), (data_low, data_high) = header.display, header.data
    if (low == data_low).all() and (high == data_high).all():
        return pixels
    canvas = np.zeros((*(high - low).tolist()[::-1], *pixels.shape[2:]), dtype=pixels.dtype)
    (x0, y0), (x1, y1) = np.maximum(low, data_low), np.minimum(high, data_high)
    if x1 > x0 and y1 > y0:
        inside = pixels[y0 - data_low[1] : y1 - data_low[1], x0 - data_low[0] : x1 - data_low[0]]
        canvas[y0 - low[1] : y1 - low[1], x0 - low[0] : x1 - low[0]] = inside
    return canvas


def to_rec709(rgb: np.ndarray, chromaticities: Sequence[float], name: str, fault: type[InputError]) -> np.ndarray:
    """Convert linear colours [..., 3] to Rec. 709; no channel falls below 0 or the colour's own smallest."""
    try:
        matrix = rec709_from_rgb(chromaticities)
    except (TypeError, ValueError) as error:
        raise fault(
            "expected chromaticities, x, y of red, green, blue and of a white between them, "
            f"got {' '.join(str(chromaticities).split())[:120]} ({error}); save it as linear Rec. 709",
            source=name,
        ) from error
    if np.array_equal(matrix, np.eye(3)):
        return rgb
    with np.errstate(invalid="ignore", over="ignore"):  # the caller refuses infinity
        converted = rgb @ matrix.T.astype(np.float32)
    return np.maximum(converted, np.minimum(rgb.min(axis=-1, keepdims=True), 0.0))

"""Radiance maps on disk: Radiance .hdr (RGBE) and OpenEXR .exr.

Both hold linear Rec. 709 radiance, latitude-longitude, row 0 up, H x 2H.
"""

from __future__ import annotations

import io
import os
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError, InvalidEnvironment, OutputError
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import check_radiance

MAX_MAP_PIXELS = 16384 * 8192
"""Largest map that is decoded; the header is looked at first."""

HALF_MAX = 65504.0
"""Largest finite half; what lies above would become infinity."""

RGBE_MAX = 255.0 * 2.0**119
"""Largest value of a shared-exponent pixel: mantissa 255, exponent byte 255."""

REC709_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x, y of red, green, blue and white (D65)."""

RLE_WIDTHS = range(8, 32768)
"""Widths that the new run-length coding can hold; others are written flat."""

MIN_RUN = 4
"""Shorter repetitions cost more as runs than inside a literal."""

HEADER_BYTES = 1 << 16
"""The header of a .hdr ends within these."""

HDR_MAGIC = b"#?"
KINDS = {
    HDR_MAGIC: ".hdr",
    b"\x76\x2f\x31\x01": ".exr",
    b"\x89PNG": "PNG",
    b"\xff\xd8\xff": "JPEG",
}
"""First bytes of files that are mistaken for one another."""

_QUIET = threading.Lock()
_RESOLUTION = re.compile(rb"-Y (\d+) \+X (\d+)")


def read_radiance(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a .hdr or .exr map.

    Returns:
        [H, 2H, 3] float32, linear, >= 0.
    Raises:
        InvalidEnvironment: the file is absent, damaged, not HDR or not H x 2H.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in (".hdr", ".exr"):
        raise InvalidEnvironment(
            f"{path.name}: expected a map in .hdr or .exr, got {suffix or 'no suffix'}; "
            "a picture of 8 or 16 bits does not hold radiance"
        )
    if not path.is_file():
        found = "a folder" if path.is_dir() else "no such file"
        raise InvalidEnvironment(f"{path}: expected a radiance map, got {found}; check the path")
    try:
        with path.open("rb") as stream:
            start = stream.read(HEADER_BYTES)
            _check_kind(start, suffix, path.name)
            if suffix == ".hdr":
                header = _read_header(start, path.name)
                return check_radiance(_decode_hdr(start + stream.read(), header, path.name), path.name)
    except OSError as error:
        raise InvalidEnvironment(
            f"{path}: cannot be read ({error.strerror}); check the permissions"
        ) from error
    rgba = read_exr(path, path.name, InvalidEnvironment, MAX_MAP_PIXELS)
    return check_radiance(rgba[..., :3], path.name)


def write_hdr(path: str | os.PathLike[str], radiance: np.ndarray) -> None:
    """Write a map [H, 2H, 3] as Radiance RGBE, new run-length coding, atomically.

    Each pixel keeps 8 bits of its largest channel: the error is at most 1/255 of it.
    """
    write_hdr_picture(path, check_radiance(radiance))


def write_hdr_picture(path: str | os.PathLike[str], picture: np.ndarray) -> None:
    """The same for a picture of any shape [H, W, 3], finite and >= 0: the face of a cube, say."""
    height, width = picture.shape[:2]
    rgbe = _float_to_rgbe(picture)
    header = f"#?RADIANCE\nSOFTWARE=anyprobe\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    pieces = [header]
    if width in RLE_WIDTHS:
        start = bytes((2, 2, width >> 8, width & 255))
        for row in np.ascontiguousarray(np.moveaxis(rgbe, 2, 1)):  # [4, W]: one channel after the other
            pieces.append(start)
            pieces.extend(_encode_runs(channel) for channel in row)
    else:
        pieces.append(rgbe.tobytes())
    with atomic_path(path) as temporary:
        temporary.write_bytes(b"".join(pieces))


def write_exr(
    path: str | os.PathLike[str],
    radiance: np.ndarray,
    *,
    half: bool = True,
    attributes: Mapping[str, str] | None = None,
) -> float:
    """Write a map [H, 2H, 3] as OpenEXR with envmap and chromaticities, atomically.

    Args:
        half: 16-bit floats, clamped at 65504; else 32-bit, exact.
        attributes: stored in the header as strings named "anyprobe:" + key.
    Returns:
        Share of the energy, the sum of L dOmega over the channels, lost to the
        clamp: 0 when nothing was clipped.
    """
    radiance = check_radiance(radiance)
    clipped_share = 0.0
    pixels = radiance
    if half:
        clamped = np.minimum(radiance, np.float32(HALF_MAX))
        weights = pixel_solid_angles(radiance.shape[0]).astype(np.float64)[:, :, None]
        energy = float((radiance * weights).sum())
        if energy > 0.0:
            clipped_share = float(((radiance - clamped) * weights).sum()) / energy
        pixels = clamped.astype(np.float16)
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "envmap": OpenEXR.ENVMAP_LATLONG,
        "chromaticities": REC709_CHROMATICITIES,
    }
    header |= {f"anyprobe:{key}": str(value) for key, value in (attributes or {}).items()}
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate("RGB")}
    with atomic_path(path) as temporary:
        try:
            OpenEXR.File(header, channels).write(str(temporary))
            # a disk that fills up at the last few kilobytes is not reported: see whether they are there
            read_exr(temporary, temporary.name, InvalidEnvironment, radiance.size)
        except InvalidEnvironment as error:
            raise OutputError(
                f"{path}: cannot be written (the file came out cut); free some space"
            ) from error
        except RuntimeError as error:  # its only report of a full disk or a closed folder
            reason = " ".join(str(error).replace(str(temporary), str(path)).split())
            raise OutputError(f"{path}: cannot be written ({reason})") from error
    return clipped_share


def read_exr(path: str | os.PathLike[str], name: str, fault: type[InputError], max_pixels: int) -> np.ndarray:
    """Read the colour of an .exr: channels R, G, B and perhaps A, or Y.

    A data window smaller than the display window is set into it, black around.

    Args:
        fault: class of the error to raise.
        max_pixels: refused above, before the pixels are decoded.
    Returns:
        [H, W, 3] or [H, W, 4] float32 as stored: colour is premultiplied by A.
    """
    try:
        with _quietly():
            with OpenEXR.File(str(path), header_only=True) as file:
                header = dict(file.header())  # emptied when the file closes
            low, high = (np.asarray(v, dtype=np.int64) for v in header["displayWindow"])
            data_low, data_high = (np.asarray(v, dtype=np.int64) for v in header["dataWindow"])
            width, height = (high - low + 1).tolist()
            data_width, data_height = (data_high - data_low + 1).tolist()
            if max(width * height, data_width * data_height) > max_pixels:
                raise fault(
                    f"{name}: expected at most {max_pixels / 1e6:.0f} million pixels, "
                    f"got {max(width, data_width)} x {max(height, data_height)}; shrink it first"
                )
            with OpenEXR.File(str(path), separate_channels=True) as file:
                found = {key: channel.pixels for key, channel in file.channels().items()}
    except (RuntimeError, ValueError, KeyError, TypeError) as error:
        if isinstance(error, fault):
            raise
        raise fault(
            f"{name}: expected an OpenEXR picture, got a damaged or empty file; save it again"
        ) from error
    order = "RGB" if all(key in found for key in "RGB") else "YYY"
    layers = [found.get(key) for key in order]
    if found.get("A") is not None:
        layers.append(found["A"])
    shape = (data_height, data_width)
    if any(layer is None or layer.shape != shape for layer in layers):
        listed = ", ".join(sorted(found)) or "none"
        raise fault(
            f"{name}: expected channels R, G, B or Y of full size, got {listed}; save a flat RGB picture"
        )
    pixels = np.stack(layers, axis=-1).astype(np.float32)
    if (low == data_low).all() and (high == data_high).all():
        return pixels
    canvas = np.zeros((height, width, pixels.shape[2]), dtype=np.float32)
    x0, y0 = np.maximum(low, data_low)
    x1, y1 = np.minimum(high, data_high) + 1
    if x1 > x0 and y1 > y0:
        inside = pixels[y0 - data_low[1] : y1 - data_low[1], x0 - data_low[0] : x1 - data_low[0]]
        canvas[y0 - low[1] : y1 - low[1], x0 - low[0] : x1 - low[0]] = inside
    return canvas


def exr_pixels(path: str | os.PathLike[str]) -> int:
    """The larger of a header's two windows, width times height; 0 where there is no such header."""
    try:
        with _quietly(), OpenEXR.File(str(path), header_only=True) as file:
            header = file.header()
            windows = [np.asarray(header[name], dtype=np.int64) for name in ("displayWindow", "dataWindow")]
            return max(int(np.prod(high - low + 1)) for low, high in windows)
    except (RuntimeError, ValueError, KeyError, TypeError):
        return 0


@contextmanager
def _quietly() -> Iterator[None]:
    """Without what OpenEXR prints of damaged files. One thread at a time: stdout is the whole process's."""
    with _QUIET, redirect_stdout(io.StringIO()):
        yield


def hdr_pixels(data: bytes) -> int:
    """Width times height of a .hdr by its first bytes; 0 where they do not tell."""
    size = _RESOLUTION.search(data[:HEADER_BYTES])
    return 0 if size is None else int(size[1]) * int(size[2])


def _float_to_rgbe(radiance: np.ndarray) -> np.ndarray:
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


def _rgbe_to_float(rgbe: np.ndarray) -> np.ndarray:
    """[H, W, 4] uint8 to [H, W, 3] float32; exponent byte 0 is black."""
    scale = np.ldexp(np.float32(1.0), rgbe[..., 3].astype(np.int32) - 136)
    return rgbe[..., :3] * np.where(rgbe[..., 3] == 0, np.float32(0.0), scale)[..., None]


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


@dataclass(frozen=True, kw_only=True, slots=True)
class _Header:
    """What a .hdr says before its pixels, which begin at byte `at`."""

    height: int
    width: int
    exposure: float
    at: int


def _check_kind(start: bytes, suffix: str, name: str) -> None:
    """Refuse a file whose first bytes are those of another format than its suffix."""
    wanted = "a Radiance .hdr file" if suffix == ".hdr" else "an OpenEXR .exr file"
    if not start:
        raise InvalidEnvironment(f"{name}: expected {wanted}, got a damaged one of 0 bytes; fetch it again")
    kind = next((kind for magic, kind in KINDS.items() if start.startswith(magic)), suffix)
    if kind != suffix:
        advice = (
            f"name it {kind}" if kind.startswith(".") else "8 bits do not hold radiance, take .hdr or .exr"
        )
        raise InvalidEnvironment(f"{name}: expected {wanted}, got {kind}; {advice}")


def _read_header(data: bytes, name: str) -> _Header:
    """The header of a .hdr from the file's first bytes."""
    header, blank, body = data.partition(b"\n\n")
    if not data.startswith(HDR_MAGIC) or not blank:
        raise InvalidEnvironment(
            f"{name}: expected a Radiance .hdr file, got other or no data; save it again"
        )
    exposure = 1.0
    for line in header.split(b"\n"):
        key, _, value = line.partition(b"=")
        if key.strip() == b"FORMAT" and value.strip() != b"32-bit_rle_rgbe":
            raise InvalidEnvironment(
                f"{name}: expected FORMAT=32-bit_rle_rgbe, got {value.strip().decode('ascii', 'replace')}; "
                "save it as RGBE"
            )
        if key.strip() == b"EXPOSURE":  # cumulative: each line tells a factor already multiplied in
            try:
                exposure *= float(value)
            except ValueError:
                exposure = 0.0
    if not (np.isfinite(exposure) and exposure > 0.0):
        raise InvalidEnvironment(f"{name}: expected EXPOSURE to be a number > 0; repair the header")
    line, _, pixels = body.partition(b"\n")
    size = _RESOLUTION.fullmatch(line.strip())
    if size is None:
        raise InvalidEnvironment(
            f"{name}: expected the size as -Y H +X W, got {line[:40].decode('ascii', 'replace')!r}; "
            "save it upright"
        )
    height, width = int(size[1]), int(size[2])
    if not 0 < height * width <= MAX_MAP_PIXELS:
        raise InvalidEnvironment(
            f"{name}: expected at most {MAX_MAP_PIXELS / 1e6:.0f} million pixels, "
            f"got {width} x {height}; shrink it first"
        )
    return _Header(height=height, width=width, exposure=exposure, at=len(data) - len(pixels))


def _decode_hdr(data: bytes, header: _Header, name: str) -> np.ndarray:
    """A whole .hdr file to radiance [H, W, 3] float32, EXPOSURE divided out."""
    rows = _decode_rows(data[header.at :], header.height, header.width, name)
    return _rgbe_to_float(rows) / np.float32(header.exposure)


def _decode_rows(data: bytes, height: int, width: int, name: str) -> np.ndarray:
    """Scanlines, run-length coded or flat, to [H, W, 4] uint8."""
    damaged = InvalidEnvironment(f"{name}: expected {height} whole rows of RGBE, got fewer; fetch it again")
    rows = np.empty((height, width, 4), dtype=np.uint8)
    start = bytes((2, 2, width >> 8 & 255, width & 255))
    at = 0
    for y in range(height):
        if width not in RLE_WIDTHS or data[at : at + 4] != start:
            flat = data[at : at + 4 * width]
            if len(flat) < 4 * width:
                raise damaged
            rows[y] = np.frombuffer(flat, dtype=np.uint8).reshape(width, 4)
            if (rows[y, :, :3] == 1).all(axis=1).any():  # no mantissas, but a repeat mark of the 1980s
                raise InvalidEnvironment(
                    f"{name}: expected new run-length coding or none, got the old; save again"
                )
            at += 4 * width
            continue
        at += 4
        for channel in range(4):
            row = bytearray()
            while len(row) < width:
                if at + 1 >= len(data):
                    raise damaged
                count = data[at]
                if count > 128:
                    row += data[at + 1 : at + 2] * (count - 128)
                    at += 2
                else:
                    row += data[at + 1 : at + 1 + count]
                    at += 1 + count
                    if count == 0 or at > len(data):
                        raise damaged
            if len(row) != width:
                raise damaged
            rows[y, :, channel] = np.frombuffer(row, dtype=np.uint8)
    return rows

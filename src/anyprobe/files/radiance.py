"""Radiance maps on disk: Radiance .hdr (RGBE) and OpenEXR .exr.

Both hold linear radiance, latitude-longitude, row 0 up, H x 2H; ours in Rec. 709 primaries.
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from anyprobe.core.color import REC709_CHROMATICITIES, rec709_from_rgb
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError, InvalidEnvironment, OutputError
from anyprobe.files.atomic import atomic_path
from anyprobe.files.plain_path import utf8_path
from anyprobe.files.rgbe import (
    HDR_MAGIC,
    RESOLUTION,
    comments,
    decode_row,
    encode_rows,
    float_to_rgbe,
    read_comments,
    read_header,
    rgbe_to_float,
)
from anyprobe.light.environment import check_radiance

MAX_MAP_PIXELS = 16384 * 8192
"""Largest map that is decoded; the header is looked at first."""

HALF_MAX = 65504.0
"""Largest finite half; what lies above would become infinity."""

HALF_MIN = 2.0**-14
"""Smallest half of full precision; what lies below loses digits, and is 0 from 3e-8 on."""

ATTRIBUTE = "anyprobe:"
"""What the names of our own strings in an .exr's header begin with."""

HEADER_BYTES = 1 << 16
"""The header of a .hdr ends within these."""

KINDS = {
    HDR_MAGIC: ".hdr",
    b"\x76\x2f\x31\x01": ".exr",
    b"\x89PNG": "PNG",
    b"\xff\xd8\xff": "JPEG",
}
"""First bytes of files that are mistaken for one another."""

_QUIET = threading.Lock()


def read_radiance(path: str | os.PathLike[str]) -> np.ndarray:
    """Read a .hdr or .exr map.

    Other primaries that the file names (an .exr's chromaticities, a .hdr's PRIMARIES) are turned
    to Rec. 709, their white to its own; a colour outside of Rec. 709 is cut at 0.

    Returns:
        [H, 2H, 3] float32, linear Rec. 709, >= 0.
    Raises:
        InvalidEnvironment: the file is absent, damaged, not HDR, not H x 2H or of impossible primaries.
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
                read_header(start, path.name, MAX_MAP_PIXELS)  # before all of it is read
                return check_radiance(decode_hdr(start + stream.read(), path.name, MAX_MAP_PIXELS), path.name)
    except OSError as error:
        raise InvalidEnvironment(
            f"{path}: cannot be read ({error.strerror}); check the permissions"
        ) from error
    rgba = read_exr(path, path.name, InvalidEnvironment, MAX_MAP_PIXELS, rec709=True)
    return check_radiance(rgba[..., :3], path.name)


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
    """The same for a picture of any shape [H, W, 3], finite and >= 0: the face of a cube, say."""
    height, width = picture.shape[:2]
    header = (
        f"#?RADIANCE\nSOFTWARE=anyprobe\n{comments(attributes or {}, ATTRIBUTE)}FORMAT=32-bit_rle_rgbe\n\n"
        f"-Y {height} +X {width}\n"
    ).encode()
    pieces = [header, *encode_rows(float_to_rgbe(picture))]
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

    envmap says latitude-longitude and no more: OpenEXR would have +Z in the centre column, our map has
    what its "anyprobe:frame" says (docs/conventions.md).

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
    header |= {f"{ATTRIBUTE}{key}": str(value) for key, value in (attributes or {}).items()}
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate("RGB")}
    with atomic_path(path) as temporary, utf8_path(temporary) as plain:
        try:
            OpenEXR.File(header, channels).write(plain)
            # a disk that fills up at the last few kilobytes is not reported: see whether they are there
            read_exr(temporary, temporary.name, InvalidEnvironment, radiance.size)
        except InvalidEnvironment as error:
            raise OutputError(
                f"{path}: cannot be written (the file came out cut); free some space"
            ) from error
        except RuntimeError as error:  # its only report of a full disk or a closed folder
            reason = " ".join(str(error).replace(plain, str(path)).split())
            raise OutputError(f"{path}: cannot be written ({reason})") from error
    return clipped_share


def read_exr(
    path: str | os.PathLike[str],
    name: str,
    fault: type[InputError],
    max_pixels: int,
    *,
    rec709: bool = False,
) -> np.ndarray:
    """Read the colour of an .exr: channels R, G, B and perhaps A, or Y.

    A data window smaller than the display window is set into it, black around.

    Args:
        fault: class of the error to raise.
        max_pixels: refused above, before the pixels are decoded.
        rec709: turn light of other chromaticities to linear Rec. 709; else the numbers as stored.
    Returns:
        [H, W, 3] or [H, W, 4] float32: colour is premultiplied by A.
    """
    try:
        with _quietly():
            header = _exr_header(path)
            low, high = (np.asarray(v, dtype=np.int64) for v in header["displayWindow"])
            data_low, data_high = (np.asarray(v, dtype=np.int64) for v in header["dataWindow"])
            width, height = (high - low + 1).tolist()
            data_width, data_height = (data_high - data_low + 1).tolist()
            if max(width * height, data_width * data_height) > max_pixels:
                raise fault(
                    f"{name}: expected at most {max_pixels / 1e6:.0f} million pixels, "
                    f"got {max(width, data_width)} x {max(height, data_height)}; shrink it first"
                )
            with utf8_path(path) as plain, OpenEXR.File(plain, separate_channels=True) as file:
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
    if rec709 and "chromaticities" in header:
        pixels[..., :3] = _to_rec709(pixels[..., :3], header["chromaticities"], name, fault)
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
    """The larger of a header's two windows, width times height; 0 where there is no such header.

    More than four channels count as more pixels, since all of them are decoded.
    """
    try:
        with _quietly():
            header = _exr_header(path)
        windows = [np.asarray(header[name], dtype=np.int64) for name in ("displayWindow", "dataWindow")]
        pixels = max(int(np.prod(high - low + 1)) for low, high in windows)
        return pixels * max(1, -(-len(header["channels"]) // 4))
    except (RuntimeError, ValueError, KeyError, TypeError):
        return 0


def map_attributes(path: str | os.PathLike[str]) -> dict[str, str]:
    """The attributes that write_exr or write_hdr was given; none where there is no such header."""
    try:
        with open(path, "rb") as stream:
            start = stream.read(HEADER_BYTES)
    except OSError:
        return {}
    return read_comments(start, ATTRIBUTE) if start.startswith(HDR_MAGIC) else exr_attributes(path)


def exr_attributes(path: str | os.PathLike[str]) -> dict[str, str]:
    """The attributes that write_exr was given; none where there is no such header."""
    try:
        with _quietly():
            header = _exr_header(path)
    except (RuntimeError, ValueError, TypeError):
        return {}
    ours = {key.removeprefix(ATTRIBUTE): v for key, v in header.items() if key.startswith(ATTRIBUTE)}
    return {key: value for key, value in ours.items() if isinstance(value, str)}


def _exr_header(path: str | os.PathLike[str]) -> dict[str, Any]:
    with utf8_path(path) as plain, OpenEXR.File(plain, header_only=True) as file:
        return dict(file.header())  # emptied when the file closes


@contextmanager
def _quietly() -> Iterator[None]:
    """Without what OpenEXR prints of damaged files. One thread at a time: stdout is the whole process's."""
    with _QUIET, redirect_stdout(io.StringIO()):
        yield


def hdr_pixels(data: bytes) -> int:
    """Width times height of a .hdr by its first bytes; 0 where they do not tell."""
    size = RESOLUTION.search(data[:HEADER_BYTES])
    return 0 if size is None else int(size[1]) * int(size[2])


def _to_rec709(
    rgb: np.ndarray, chromaticities: Sequence[float], name: str, fault: type[InputError]
) -> np.ndarray:
    """Linear colours [..., 3] in Rec. 709; none falls below 0 that did not before."""
    try:
        matrix = rec709_from_rgb(chromaticities)
    except (TypeError, ValueError) as error:
        raise fault(
            f"{name}: expected x, y of red, green, blue and of a white between them, "
            f"got {' '.join(str(chromaticities).split())} ({error}); save it as linear Rec. 709"
        ) from error
    if np.array_equal(matrix, np.eye(3)):
        return rgb
    with np.errstate(invalid="ignore", over="ignore"):  # infinity is the caller's to refuse
        turned = rgb @ matrix.T.astype(np.float32)
    return np.maximum(turned, np.minimum(rgb.min(axis=-1, keepdims=True), 0.0))


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


def decode_hdr(data: bytes, name: str, max_pixels: int) -> np.ndarray:
    """A whole .hdr file to radiance [H, W, 3] float32, EXPOSURE divided out, Rec. 709; or InvalidEnvironment."""
    header = read_header(data, name, max_pixels)
    rows = _decode_rows(data[header.at :], header.height, header.width, name)
    radiance = rgbe_to_float(rows) / np.float32(header.exposure)
    return _to_rec709(radiance, header.primaries, name, InvalidEnvironment)


def _decode_rows(data: bytes, height: int, width: int, name: str) -> np.ndarray:
    """All rows, [H, W, 4] uint8."""
    rows = np.empty((height, width, 4), dtype=np.uint8)
    at = 0
    try:
        for y in range(height):
            rows[y], at = decode_row(data, at, width)
    except EOFError as error:
        raise InvalidEnvironment(
            f"{name}: expected {height} whole rows of RGBE, got fewer; fetch it again"
        ) from error
    except ValueError as error:
        raise InvalidEnvironment(
            f"{name}: expected new run-length coding or none, got the old; save again"
        ) from error
    return rows

"""Linear radiance on disk: Radiance .hdr (RGBE) and OpenEXR .exr, environment maps and pictures of any shape.

A map is latitude-longitude, row 0 up, H x 2H; ours in Rec. 709 primaries.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from anyprobe.core.color import COLORSPACES, REC709_CHROMATICITIES, SAME_CHROMATICITIES, from_rec709, rec709_from_rgb
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import open_regular, read_rest
from anyprobe.light.environment import check_radiance
from anyprobe.maps.exr import EXR_MAGIC, exr_attributes, open_exr, read_exr, to_rec709, write_channels
from anyprobe.maps.image_io import encode_image, open_image, read_pixels
from anyprobe.maps.rgbe import HDR_HEADER_BYTES, HDR_MAGIC, comments, read_comments, read_header, rounded_up

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
    if not isinstance(source, str | os.PathLike | bytes):
        return None
    try:
        data, name = _bytes_of(source, (EXR_MAGIC, HDR_MAGIC))
    except InputError:  # read_image reports it
        return None
    if data.startswith(EXR_MAGIC):
        pixels = read_exr(data, name, InputError, max_pixels, rec709=True)
    elif data.startswith(HDR_MAGIC):
        pixels = decode_hdr(data, name, max_pixels)
    else:
        return None
    if not np.isfinite(pixels).all():
        raise InputError("expected finite radiance, got NaN or infinity; repair the picture first", source=name)
    cover = np.clip(pixels[..., 3:], 0.0, 1.0) if pixels.shape[2] == 4 else np.ones_like(pixels[..., :1])
    return np.concatenate([np.maximum(pixels[..., :3], 0.0) * (cover > 0), cover], axis=-1)


def _bytes_of(source: str | os.PathLike[str] | bytes, starts: tuple[bytes, ...]) -> tuple[bytes, str]:
    """Return a source's bytes, of a file that begins otherwise only the first few, and its name for messages."""
    if isinstance(source, bytes):
        return source, "bytes"
    with open_regular(source, InputError) as stream:
        data = stream.read(len(EXR_MAGIC))
        return data + (read_rest(stream) if data.startswith(starts) else b""), Path(source).name


def opaque_linear(source: Path | bytes, colorspace: str, max_pixels: int) -> np.ndarray | None:
    """Read the colours of an opaque .exr in one of COLORSPACES, negative ones kept; None for any other picture.

    Returns:
        [H, W, 3] float32: the file's own numbers where it has that colour space.
    Raises:
        InputError: damaged, too large.
    """
    data, name = _bytes_of(source, (EXR_MAGIC,))
    if not data.startswith(EXR_MAGIC):
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
    try:
        with open_regular(path, InputError) as stream:
            start = stream.read(HDR_HEADER_BYTES)
            return read_comments(start, ATTRIBUTE) if start.startswith(HDR_MAGIC) else exr_attributes(stream, ATTRIBUTE)
    except InputError:
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
            radiance = read_pixels(image, range(3)) / np.array(header.exposure, np.float32)
    except ValueError as error:
        text = f"expected {header.height} whole rows of RGBE, got fewer; copy or export it again"
        raise InvalidEnvironment(text, source=name) from error
    return to_rec709(np.ascontiguousarray(header.upright(radiance)), header.primaries, name, InvalidEnvironment)

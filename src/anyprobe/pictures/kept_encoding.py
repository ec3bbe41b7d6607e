"""Pictures written in a photo's own encoding: its 16 bits and its ICC profile, in PNG and TIFF.

Pillow cannot write colour of 16 bits; both formats are simple enough to write here.
"""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from anyprobe.files.atomic import atomic_path
from anyprobe.pictures.color_encoding import ColorEncoding, is_srgb, srgb_to_linear
from anyprobe.pictures.deep_pixels import BITS_PER_SAMPLE, stored_layout
from anyprobe.pictures.embedded_color import PNG_START
from anyprobe.pictures.icc import encoding_of

TIFF_SUFFIXES = (".tif", ".tiff")

CURVE = 4096
"""Number of steps of the table that inverts a profile's curve."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Stored:
    """Encoding of a photo's file.

    Attributes:
        deep: whether it has 16 bits.
        profile: ICC profile, empty where it has none or one that is not kept.
        encoding: of the profile; None for sRGB.
        lost: whether it has a profile that is not kept.
    """

    deep: bool = False
    profile: bytes = b""
    encoding: ColorEncoding | None = None
    lost: bool = False

    @property
    def plain(self) -> bool:
        """Whether it is 8 bits of sRGB without a profile."""
        return not self.deep and not self.profile


def stored_as(source: Path | bytes) -> Stored:
    """Return a picture's encoding: the bits of a PNG or TIFF, and of any picture an RGB profile of curves."""
    try:
        with Image.open(io.BytesIO(source) if isinstance(source, bytes) else source) as image:
            profile, kind = image.info.get("icc_profile") or b"", image.format
            bits = max(image.tag_v2.get(BITS_PER_SAMPLE, (8,))) if isinstance(image, TiffImageFile) else 8
            mode, deep = image.mode, bits == 16 or (kind == "PNG" and ";16" in stored_layout(image))
    except (OSError, ValueError, SyntaxError, TypeError, IndexError, Image.DecompressionBombError):
        return Stored()
    if not profile or mode == "CMYK":
        return Stored(deep=deep, lost=bool(profile))
    encoding = encoding_of(profile) if profile[16:20] == b"RGB " else None
    if encoding is None or encoding.is_hdr:
        return Stored(deep=deep, lost=True)
    return Stored(deep=deep, profile=profile, encoding=None if is_srgb(encoding) else encoding)


def write_as(path: Path, rgb: np.ndarray, stored: Stored) -> None:
    """Write sRGB display values [H, W, 3] in [0, 1] as PNG or TIFF, atomically."""
    values = np.clip(rgb if stored.encoding is None else _coded(rgb, stored.encoding), 0.0, 1.0)
    tiff = path.suffix.lower() in TIFF_SUFFIXES
    if stored.deep:
        pixels = np.round(values * 0xFFFF).astype(np.uint16)
        data = _deep_tiff(pixels, stored.profile) if tiff else _deep_png(pixels, stored.profile)
    else:
        stream = io.BytesIO()
        settings = {"icc_profile": stored.profile} if stored.profile else {}
        picture = Image.fromarray(np.round(values * 0xFF).astype(np.uint8))
        picture.save(stream, format="TIFF" if tiff else "PNG", **settings)
        data = stream.getvalue()
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def _coded(rgb: np.ndarray, encoding: ColorEncoding) -> np.ndarray:
    """Convert display values [H, W, 3] to an encoding's code values."""
    linear = srgb_to_linear(rgb) @ np.linalg.inv(encoding.matrix).T
    ramp = np.linspace(0.0, 1.0, CURVE + 1) ** 2  # finer where it is dark
    curves = encoding.decode(ramp[:, None].repeat(3, axis=1).astype(np.float32))
    return np.stack([np.interp(linear[..., k], curves[:, k], ramp) for k in range(3)], axis=-1)


def _deep_png(pixels: np.ndarray, profile: bytes) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    height, width = pixels.shape[:2]
    rows = pixels.astype(">u2").reshape(height, -1).view(np.uint8)
    filtered = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1)
    named = chunk(b"iCCP", b"photo\0\0" + zlib.compress(profile)) if profile else b""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0))
    return PNG_START + header + named + chunk(b"IDAT", zlib.compress(filtered.data, 3)) + chunk(b"IEND", b"")


def _deep_tiff(pixels: np.ndarray, profile: bytes) -> bytes:
    """Return a TIFF 6.0 of one strip, Deflate, of pixels [H, W, 3] uint16."""
    height, width = pixels.shape[:2]
    strip = zlib.compress(np.ascontiguousarray(pixels, "<u2").data, 3)
    strip += b"\0" * (len(strip) % 2)
    short, long, undefined = 3, 4, 7
    bits_at = 8 + len(strip)
    profile_at = bits_at + 6
    end = profile_at + len(profile) + len(profile) % 2
    entries = [
        (256, long, 1, width),
        (257, long, 1, height),
        (258, short, 3, bits_at),
        (259, short, 1, 8),
        (262, short, 1, 2),
        (273, long, 1, 8),
        (277, short, 1, 3),
        (278, long, 1, height),
        (279, long, 1, len(strip)),
        *([(34675, undefined, len(profile), profile_at)] if profile else []),
    ]
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries) + bytes(4)
    body = strip + struct.pack("<HHH", 16, 16, 16) + profile + b"\0" * (len(profile) % 2)
    return b"II*\0" + struct.pack("<I", end) + body + directory

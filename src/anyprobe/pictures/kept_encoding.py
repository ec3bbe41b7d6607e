"""Pictures written in a photo's own encoding: its 16 bits and its ICC profile, in PNG and TIFF."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from PIL.TiffImagePlugin import TiffImageFile

from anyprobe.files.atomic import atomic_path
from anyprobe.maps.image_io import encode_image
from anyprobe.pictures.color_encoding import ColorEncoding, is_srgb, srgb_to_linear
from anyprobe.pictures.deep_pixels import stored_layout
from anyprobe.pictures.icc import encoding_of

TIFF_SUFFIXES = (".tif", ".tiff")

BITS_PER_SAMPLE = 258
"""Tag of TIFF 6.0."""

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
        header = {"compression": "zip", "DateTime": "", **({"ICCProfile": stored.profile} if stored.profile else {})}
        data = encode_image(pixels, "tiff" if tiff else "png", header)
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

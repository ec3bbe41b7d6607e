"""Photos on disk or in memory to display values, and previews back to PNG.

Whatever comes (palette, CMYK, 16 bits, rotated by EXIF, wide-gamut, float EXR)
leaves as upright sRGB in [0, 1]; what cannot be a photo is refused in one line.
"""

from __future__ import annotations

import io
import os
import struct
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import ExifTags, Image, ImageCms, ImageOps

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.errors import InvalidPhoto
from anyprobe.files.atomic import atomic_path
from anyprobe.files.exr import EXR_MAGIC, read_exr
from anyprobe.files.headers import MAX_PIXELS, UnknownPicture, check_size, exif_exposure, exif_fov_deg, open_picture
from anyprobe.files.paths import open_regular

ImageSource = str | os.PathLike[str] | bytes | Image.Image | np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Pixels:
    """A picture as it is displayed.

    Attributes:
        rgb: [H, W, 3] float32, display values (sRGB primaries, camera-coded) in [0, 1]; a read-only view of one
            channel where the picture is grey.
        alpha: [H, W] float32 in [0, 1], not premultiplied into rgb; None where all is opaque.
        long_fov_deg: field of view of the longer side from EXIF, or None.
        exposure: how much light the photo took, from EXIF, in seconds x ISO / f-number^2, or None.
        name: what messages call the picture.
        warnings: one line each, for the user.
    """

    rgb: np.ndarray
    alpha: np.ndarray | None
    long_fov_deg: float | None
    name: str
    warnings: tuple[str, ...] = ()
    exposure: float | None = None


def read_image(source: ImageSource, name: str | None = None) -> Pixels:
    """Read a photo from a path, bytes, a Pillow image or an array.

    Arrays are [H, W], [H, W, 1], [H, W, 3] or [H, W, 4]: uint8, uint16, or float display values in [0, 1]. An .exr
    holds linear radiance and goes through the camera's response. Of an animation the first frame counts.

    Raises:
        InvalidPhoto: not an image, damaged, too small, too large, NaN.
        MissingExtra: a HEIC photo without its reader installed.
    """
    if isinstance(source, np.ndarray):
        return _from_array(source, name or "array")
    if isinstance(source, Image.Image):
        return _from_pillow(source, name or Path(getattr(source, "filename", "") or "image").name)
    if isinstance(source, (bytes, bytearray, memoryview)):
        data = bytes(source)
        return _from_stream(io.BytesIO(data), len(data), name or "bytes")
    if not isinstance(source, (str, os.PathLike)):
        raise InvalidPhoto(
            f"{name or 'photo'}: expected a path, bytes, a Pillow image or an array, "
            f"got {type(source).__name__}; convert it"
        )
    path = Path(source)
    with open_regular(path, InvalidPhoto, "an image file") as stream:
        return _from_stream(stream, os.fstat(stream.fileno()).st_size, name or path.name or str(path))


USUAL_PNG, FAST_PNG, MANY_VALUES = 6, 1, 24_000_000
"""Compression of a PNG, and of one of so many values: a third of the time for a tenth more bytes."""
STRIP_ROWS = 64
"""Rows of a large picture that are converted at a time."""


def write_png(path: str | os.PathLike[str], rgb: np.ndarray) -> None:
    """Write [H, W], [H, W, 3] or [H, W, 4] as PNG: uint8, or float display values in [0, 1]."""
    image = np.asarray(rgb)
    if image.dtype != np.uint8:
        image = picture_bytes(image)
    with atomic_path(path) as temporary:
        level = FAST_PNG if image.size > MANY_VALUES else USUAL_PNG
        Image.fromarray(np.ascontiguousarray(image)).save(temporary, format="PNG", compress_level=level)


def png_bytes(picture: np.ndarray, **settings: Any) -> bytes:
    """uint8 [H, W], [H, W, 3] or [H, W, 4] as PNG; settings: Pillow's."""
    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(stream, format="PNG", **settings)
    return stream.getvalue()


def picture_bytes(image: np.ndarray) -> np.ndarray:
    """to_bytes, a few rows at a time where there are many values, which would not fit the processor's caches."""
    if image.size <= MANY_VALUES:
        return to_bytes(image)
    result = np.empty(image.shape, np.uint8)

    def convert(top: int) -> None:
        result[top : top + STRIP_ROWS] = to_bytes(image[top : top + STRIP_ROWS])

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(convert, range(0, len(image), STRIP_ROWS)))
    return result


def _from_stream(stream: BinaryIO, num_bytes: int, name: str) -> Pixels:
    """Decode an open file or buffer, by what its first bytes say."""
    head = stream.read(len(EXR_MAGIC))
    stream.seek(0)
    if not head:
        raise InvalidPhoto(f"{name}: expected an image, got an empty file; copy or save it again")
    if head == EXR_MAGIC:
        return _from_exr(stream.read(num_bytes), name)
    try:
        image = open_picture(stream, name)
    except UnknownPicture as error:
        raise InvalidPhoto(
            f"{name}: expected an image (JPEG, PNG, WebP, TIFF, EXR, ...), "
            f"got {num_bytes} bytes of something else; convert it to PNG or JPEG"
        ) from error
    with image:
        return _from_pillow(image, name)


def _from_pillow(image: Image.Image, name: str) -> Pixels:
    """Turn upright, take the transparency off, bring the colour to sRGB."""
    check_size(*image.size, name)
    try:
        # not n_frames, which walks through all of them; a phone's MPO holds a photo and its thumbnail or depth
        animated = image.format != "MPO" and getattr(image, "is_animated", False)
        image.load()
        long_fov_deg, exposure = exif_fov_deg(image), exif_exposure(image)
        image = _upright(image)
        alpha = None
        if image.has_transparency_data and not image.mode.startswith("I"):  # 16 bits have no RGBA
            image = image.convert("RGBA")
            alpha = np.asarray(image.getchannel("A"))
            image = image.convert("RGB")
        values = _color_values(image)
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InvalidPhoto(
            f"{name}: expected a whole image, got a damaged or unusual one ({reason}); save it again as PNG or JPEG"
        ) from error
    del image  # its pixels; they are in values now
    pixels = _from_array(values, name)
    if alpha is not None and (alpha < 255).any():
        pixels = replace(pixels, alpha=np.divide(alpha, np.float32(255.0), dtype=np.float32))
    notes = (f"{name}: expected one picture, got several frames or pages; the first is used",)
    return replace(pixels, long_fov_deg=long_fov_deg, warnings=notes if animated else (), exposure=exposure)


def _upright(image: Image.Image) -> Image.Image:
    """Turned as its EXIF asks; as it is where that asks nothing or is damaged."""
    try:
        if image.getexif().get(ExifTags.Base.Orientation, 1) == 1:
            return image  # which exif_transpose would copy
        return ImageOps.exif_transpose(image)
    except (ValueError, KeyError, TypeError, SyntaxError, struct.error, OSError, Warning):
        return image


def _color_values(image: Image.Image) -> np.ndarray:
    """An opaque Pillow image to an array that _from_array takes."""
    if image.mode.startswith("I;16") or image.mode == "I":  # older readers give 16 bits as I
        values = np.asarray(image)
        if values.min() < 0 or values.max() > 65535:
            raise ValueError("whole numbers outside 0 to 65535")
        return values.astype(np.uint16)
    if image.mode == "F" or (image.mode == "L" and not image.info.get("icc_profile")):
        return np.asarray(image)
    if image.mode not in ("L", "RGB", "CMYK"):
        image = image.convert("RGB")
    return np.asarray(_to_srgb(image))


def _to_srgb(image: Image.Image) -> Image.Image:
    """Apply the embedded colour profile; a damaged or unfitting one is ignored."""
    icc_profile = image.info.get("icc_profile")
    if icc_profile:
        try:
            embedded = ImageCms.ImageCmsProfile(io.BytesIO(icc_profile))
            if "srgb" not in ImageCms.getProfileDescription(embedded).lower():
                image = ImageCms.profileToProfile(
                    image,
                    embedded,
                    ImageCms.createProfile("sRGB"),
                    renderingIntent=ImageCms.Intent.RELATIVE_COLORIMETRIC,
                    outputMode="RGB",
                )
        except (ImageCms.PyCMSError, OSError, ValueError):
            pass  # the colours are then read as sRGB, as most viewers do
    return image if image.mode == "RGB" else image.convert("RGB")  # which would copy it


def _from_exr(data: bytes, name: str) -> Pixels:
    """Linear radiance, premultiplied by A, to display values."""
    pixels = read_exr(data, name, InvalidPhoto, MAX_PIXELS, rec709=True)
    check_size(pixels.shape[1], pixels.shape[0], name)
    if not np.isfinite(pixels).all():
        raise InvalidPhoto(f"{name}: expected finite radiance, got NaN or infinity; repair the picture first")
    radiance = np.maximum(pixels[..., :3], 0.0)
    if pixels.shape[2] == 4:
        alpha = np.clip(pixels[..., 3:], 0.0, 1.0)
        straight = radiance / np.where(alpha > 0.0, np.maximum(alpha, 1e-4), 1.0)  # 1e-4: no overflow
        return _from_array(np.concatenate([response(straight), alpha], axis=-1), name)
    return _from_array(response(radiance), name)


def _from_array(values: np.ndarray, name: str) -> Pixels:
    """Check and scale an array to float32 in [0, 1]."""
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim != 3 or values.shape[2] not in (1, 3, 4):
        raise InvalidPhoto(
            f"{name}: expected [height, width] with 1, 3 or 4 channels, got shape {values.shape}; put the channels last"
        )
    check_size(values.shape[1], values.shape[0], name)
    if values.dtype.kind == "u" and values.dtype.itemsize <= 2:
        display = np.divide(values, np.float32(np.iinfo(values.dtype).max), dtype=np.float32)
    elif np.issubdtype(values.dtype, np.floating):
        low, high = float(values.min()), float(values.max())
        if not (low >= -1e-4 and high <= 1.0 + 1e-4):  # 1e-4: rounding of a resize; NaN fails too
            raise InvalidPhoto(
                f"{name}: expected float display values from 0 to 1, got {low:.3g} to {high:.3g}; "
                "scale them, or save linear radiance as .exr"
            )
        display = values.astype(np.float32)
        np.clip(display, 0.0, 1.0, out=display)
    else:
        raise InvalidPhoto(f"{name}: expected uint8, uint16 or float values, got {values.dtype}; convert it")
    alpha = None
    if display.shape[2] == 4 and (display[..., 3] < 1.0).any():
        alpha = np.ascontiguousarray(display[..., 3])
    if display.shape[2] == 4:
        display = display[..., :3].copy()
    rgb = np.broadcast_to(display, (*display.shape[:2], 3)) if display.shape[2] == 1 else display
    return Pixels(rgb=rgb, alpha=alpha, long_fov_deg=None, name=name)

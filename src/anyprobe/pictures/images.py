"""Photos from disk or memory as display values, and pictures written as PNG.

Every kind (palette, CMYK, 16 bits, rotated by EXIF, wide-gamut, HDR, RAW, float EXR) becomes upright sRGB in [0, 1];
anything that cannot be a photo raises an error of one line.
"""

import io
import os
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.errors import InvalidEnvironment, InvalidPhoto
from anyprobe.files.atomic import atomic_path
from anyprobe.files.paths import open_regular
from anyprobe.maps.exr import EXR_MAGIC, exr_attributes, read_exr
from anyprobe.maps.radiance import ATTRIBUTE, HDR_HEADER_BYTES, HDR_MAGIC, decode_hdr, read_comments
from anyprobe.notices import Notice
from anyprobe.pictures import deep_pixels, headers
from anyprobe.pictures.color_encoding import is_linear
from anyprobe.pictures.deep_pixels import DeepPicture, straight, turned_upright
from anyprobe.pictures.embedded_color import declared_encoding, encoding_of, to_srgb
from anyprobe.pictures.gain_map import UNREAD, gain_map_of, misses_gain_map
from anyprobe.pictures.headers import UnknownPicture, check_size, exif_exposure, exif_fov_deg, open_picture

ImageSource = str | os.PathLike[str] | bytes | Image.Image | np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Pixels:
    """A picture as it is displayed.

    Attributes:
        rgb: [H, W, 3] float32, display values (sRGB primaries, camera-coded) in [0, 1]; a read-only view of one
            channel where the picture is grey.
        alpha: [H, W] float32 in [0, 1], not premultiplied into rgb; None where all is opaque.
        long_fov_deg: field of view of the longer side from EXIF, or None.
        exposure: from EXIF, seconds x ISO / f-number^2, or None.
        posture_deg: camera pitch downwards and roll, where the camera noted them (iPhones), or None.
        name: what messages call the picture.
        warnings: one line each, for the user.
        radiance: [H, W, 3] float32, linear Rec. 709 in the photo's exposure units (white at 1), where the picture holds
            light above white: OpenEXR, .hdr, TIFF of floats, PQ, HLG, a gain map. None for any other.
    """

    rgb: np.ndarray
    alpha: np.ndarray | None
    long_fov_deg: float | None
    name: str
    warnings: tuple[str, ...] = ()
    exposure: float | None = None
    posture_deg: tuple[float, float] | None = None
    radiance: np.ndarray | None = None


def read_image(source: ImageSource, name: str | None = None, *, as_data: bool = False) -> Pixels:
    """Read a photo from a path, bytes, a Pillow image or an array.

    Arrays are [H, W], [H, W, 1], [H, W, 3] or [H, W, 4]: uint8, uint16, or float display values in [0, 1]. Linear
    radiance (.exr, .hdr, a TIFF of floats without a profile, RAW) goes through the camera's response. Of an animation
    the first frame is read.

    Args:
        as_data: keep the stored values and ignore the file's colour encoding, for normals and masks.
    Raises:
        InvalidPhoto: not an image, damaged, too small, too large, NaN.
        MissingExtra: a HEIC or RAW photo without its reader installed.
    """
    if isinstance(source, np.ndarray):
        return _from_array(source, name or "array")
    if isinstance(source, Image.Image):
        name = name or Path(getattr(source, "filename", "") or "image").name
        return _from_pillow(source, name, None, as_data)
    if isinstance(source, (bytes, bytearray, memoryview)):
        data = bytes(source)
        return _from_stream(io.BytesIO(data), len(data), name or "bytes", as_data)
    if not isinstance(source, (str, os.PathLike)):
        text = f"expected a path, bytes, a Pillow image or an array, got {type(source).__name__}; convert it"
        raise InvalidPhoto(text, source=name or "photo")
    path = Path(source)
    with open_regular(source, InvalidPhoto, "an image file") as stream:
        size = os.fstat(stream.fileno()).st_size
        return _from_stream(stream, size, name or path.name or str(path), as_data, path.name)


USUAL_PNG, FAST_PNG, MANY_VALUES = 6, 1, 24_000_000
"""Compression levels of a PNG, and of one of more than MANY_VALUES: a third of the time for a tenth more bytes."""
ALL_AROUND = (
    "a panorama of all around, not a photo by one lens; cut the part with the object out, as a rectilinear view"
)

TAKEN_FOR_LINEAR = (
    "a picture of floats without a colour profile is taken for linear radiance; if it holds display values, embed an "
    "sRGB profile"
)


def write_png(path: str | os.PathLike[str], rgb: np.ndarray) -> None:
    """Write [H, W], [H, W, 3] or [H, W, 4] as PNG: uint8, or float display values in [0, 1]."""
    image = np.asarray(rgb)
    if image.dtype != np.uint8:
        image = to_bytes(image)
    with atomic_path(path) as temporary:
        level = FAST_PNG if image.size > MANY_VALUES else USUAL_PNG
        Image.fromarray(np.ascontiguousarray(image)).save(temporary, format="PNG", compress_level=level)


def png_bytes(picture: np.ndarray, **settings: Any) -> bytes:
    """Encode uint8 [H, W], [H, W, 3] or [H, W, 4] as PNG; settings are Pillow's."""
    stream = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(picture)).save(stream, format="PNG", **settings)
    return stream.getvalue()


def _from_stream(stream: BinaryIO, num_bytes: int, name: str, as_data: bool, file_name: str = "") -> Pixels:
    """Decode an open file or buffer, whose first bytes decide how."""
    head = stream.read(64)
    if not head:
        raise InvalidPhoto("expected an image, got an empty file; copy or save it again", source=name)
    if head.startswith(deep_pixels.TIFF_STARTS):
        head += stream.read(deep_pixels.HEAD_BYTES)
    stream.seek(0)
    if head.startswith(EXR_MAGIC):
        data = stream.read(num_bytes)
        _refuse_own_map(exr_attributes(data, ATTRIBUTE), name, as_data)
        return _from_linear(read_exr(data, name, InvalidPhoto, headers.MAX_PIXELS, rec709=True), name)
    if head.startswith(HDR_MAGIC):
        data = stream.read(num_bytes)
        _refuse_own_map(read_comments(data[:HDR_HEADER_BYTES], ATTRIBUTE), name, as_data)
        try:
            return _from_linear(decode_hdr(data, name, headers.MAX_PIXELS), name)
        except InvalidEnvironment as error:
            raise InvalidPhoto(error, code="invalid-image") from error
    if deep_pixels.is_raw(head, file_name):
        return _from_raw(stream, num_bytes, name)
    deep = deep_pixels.read_deep(stream, head, name)
    if deep is not None and deep.values.dtype.kind == "f":
        return _from_floats(deep, name, as_data)
    try:
        image = open_picture(stream, name)
    except UnknownPicture as error:
        if deep is not None:
            return _from_pillow(deep.header(), name, stream, as_data, deep)
        expected = "expected an image (JPEG, PNG, WebP, TIFF, HEIC, AVIF, EXR, RAW, ...), got"
        kind, remedy = headers.kind_of(head, num_bytes)
        raise InvalidPhoto(f"{expected} {kind}", source=name, remedy=remedy) from error
    with image:
        return _from_pillow(image, name, stream, as_data, deep)


def _refuse_own_map(attributes: dict[str, str], name: str, as_data: bool) -> None:
    """Raise InvalidPhoto for a map or panorama that anyprobe wrote, by the attributes of its header."""
    if "frame" in attributes and not as_data:
        text = "expected a photo, got an environment map that anyprobe wrote; give the photo that it was estimated from"
        raise InvalidPhoto(text, source=name)


def _from_pillow(
    image: Image.Image, name: str, stream: BinaryIO | None, as_data: bool, found: DeepPicture | None = None
) -> Pixels:
    """Turn upright, separate the transparency, convert the colour to sRGB.

    Args:
        stream: the open file of the image, for what Pillow does not return; None where there is none.
        found: its pixels, where another reader has them; of the image then only the header counts.
    """
    if found is None:
        check_size(*image.size, name)
    try:
        # not n_frames, which reads all of them; a phone's MPO holds a photo and its thumbnail or depth
        animated = image.format != "MPO" and getattr(image, "is_animated", False)
        encoding, profile, notes = (None, b"", ()) if as_data else declared_encoding(image, stream)
        deep: np.ndarray | None = None
        picture: Image.Image | np.ndarray
        if found is not None:
            deep = straight(found.values) if found.premultiplied and found.values.shape[2] in (2, 4) else found.values
        elif stream is not None:
            deep = deep_pixels.read_sixteen_bits(image, stream, name)
            if encoding is not None and encoding.is_hdr and image.format == "HEIF":
                deep = deep_pixels.heif_sixteen_bits(stream)
        if deep is None:
            image.load()
        long_fov_deg, exposure = exif_fov_deg(image), exif_exposure(image)
        orientation, posture_deg = headers.orientation_of(image), headers.apple_posture_deg(image)
        if deep is not None:
            alpha = deep[..., -1] if deep.shape[2] in (2, 4) else None
            picture = np.ascontiguousarray(deep[..., 0] if deep.shape[2] < 3 else deep[..., :3])
        else:
            picture, alpha = _opaque(image)
        display, radiance, doubts = to_srgb(picture, encoding, profile)
        gain_map = None if as_data or radiance is not None else gain_map_of(image, stream)
    except InvalidPhoto:
        raise
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InvalidPhoto(
            f"expected a complete image, got a damaged or unusual one ({reason}); copy it again, or open and save "
            "it in another program",
            source=name,
        ) from error
    del picture, deep  # free their memory: the pixels are in display
    pixels = _from_array(turned_upright(display, orientation), name)
    if alpha is not None and (alpha < np.iinfo(alpha.dtype).max).any():
        alpha = turned_upright(alpha, orientation)
        pixels = replace(pixels, alpha=np.divide(alpha, np.float32(np.iinfo(alpha.dtype).max), dtype=np.float32))
    radiance = None if radiance is None else turned_upright(radiance, orientation)
    missed = not as_data and radiance is None and gain_map is None and misses_gain_map(image, stream, pixels.rgb)
    is_all_around = not as_data and "equirectangular" in str(image.info.get("xmp"))
    image_format = image.format
    del image
    if missed:
        notes += (UNREAD,)
    if gain_map is not None:
        radiance = gain_map.radiance(pixels.rgb, orientation)
    notes = tuple(Notice(note, code="colors", source=name) for note in (*notes, *doubts))
    if is_all_around:
        notes += (Notice(ALL_AROUND, code="environment-map", source=name),)
    if animated:
        used = "the main one" if image_format == "HEIF" else "the first"
        text = f"expected one picture, got several frames or pages; {used} is used"
        notes += (Notice(text, code="several-pictures", source=name),)
    return replace(
        pixels, long_fov_deg=long_fov_deg, warnings=notes, exposure=exposure, posture_deg=posture_deg, radiance=radiance
    )


def _opaque(image: Image.Image) -> tuple[Image.Image | np.ndarray, np.ndarray | None]:
    """Return a picture without its transparency (L, RGB or CMYK; or values of 16 bits or floats), and alpha or None."""
    alpha = None
    if image.mode == "LA":
        return image.getchannel("L"), np.asarray(image.getchannel("A"))
    if image.has_transparency_data and not image.mode.startswith("I"):  # 16 bits have no RGBA
        image = image.convert("RGBA")
        alpha = np.asarray(image.getchannel("A"))
        image = image.convert("RGB")
    if image.mode.startswith("I;16") or image.mode == "I":  # older readers give 16 bits as I
        values = np.asarray(image)
        if values.min() < 0 or values.max() > 65535:
            raise ValueError("integers outside 0 to 65535")
        return values.astype(np.uint16), alpha
    if image.mode == "F":
        return np.asarray(image), alpha
    return image if image.mode in ("L", "RGB", "CMYK") else image.convert("RGB"), alpha


def _from_raw(stream: BinaryIO, num_bytes: int, name: str) -> Pixels:
    radiance, notes = deep_pixels.develop(stream.read(num_bytes), name)
    stream.seek(0)
    warnings = tuple(Notice(note, code="raw", source=name) for note in notes)
    pixels = replace(_from_linear(radiance, name), warnings=warnings, radiance=None)  # the sensor clips at white
    with suppress(UnknownPicture, InvalidPhoto), open_picture(stream, name) as preview:  # the preview has the EXIF
        return _with_exif(pixels, preview)
    return pixels


def _with_exif(pixels: Pixels, image: Image.Image) -> Pixels:
    return replace(pixels, long_fov_deg=exif_fov_deg(image), exposure=exif_exposure(image))


def _from_floats(found: DeepPicture, name: str, as_data: bool) -> Pixels:
    """Convert floats: linear radiance unless their profile has a curve; values above 1 are above white."""
    header = found.header()
    values, channels = turned_upright(found.values, headers.orientation_of(header)), found.values.shape[2]
    alpha = values[..., -1:] if channels in (2, 4) else values[..., :0]
    color = np.repeat(values[..., :1], 3, axis=-1) if channels < 3 else values[..., :3]
    encoding = encoding_of(found.profile) if found.profile else None
    if as_data:
        return _with_exif(_from_array(np.concatenate([color, alpha], axis=-1), name), header)
    if encoding is None or is_linear(encoding):
        linear = color if encoding is None else encoding.linear(color)
        weight = 1.0 if found.premultiplied or not alpha.size else alpha
        pixels = _from_linear(np.concatenate([linear * weight, alpha], axis=-1), name)
        doubt = found.profile == b"" and pixels.radiance is None
        notes = (Notice(TAKEN_FOR_LINEAR, code="colors", source=name),) if doubt else ()
        return _with_exif(replace(pixels, warnings=notes), header)
    _check_finite(values, name)
    display, radiance, _ = to_srgb(color, replace(encoding, is_hdr=bool(color.max() > 1.0)))
    pixels = _from_array(np.concatenate([np.clip(display, 0.0, 1.0), alpha.clip(0.0, 1.0)], axis=-1), name)
    return _with_exif(replace(pixels, radiance=radiance), header)


def _check_finite(pixels: np.ndarray, name: str) -> None:
    if not np.isfinite(pixels).all():
        raise InvalidPhoto("expected finite radiance, got NaN or infinity; repair the picture first", source=name)


def _from_linear(linear: np.ndarray, name: str) -> Pixels:
    """Convert linear radiance [H, W, 3 or 4], premultiplied by A, to display values; keep it if it exceeds white."""
    check_size(linear.shape[1], linear.shape[0], name)
    _check_finite(linear, name)
    radiance = np.maximum(linear[..., :3], 0.0)
    if linear.shape[2] == 4:
        alpha = np.clip(linear[..., 3:], 0.0, 1.0)
        radiance = radiance / np.where(alpha > 0.0, np.maximum(alpha, 1e-4), 1.0)  # 1e-4: no overflow
        pixels = _from_array(np.concatenate([response(radiance), alpha], axis=-1), name)
    else:
        pixels = _from_array(response(radiance), name)
    return replace(pixels, radiance=radiance if radiance.max() > 1.0 else None)


def _from_array(values: np.ndarray, name: str) -> Pixels:
    """Check and scale an array to float32 in [0, 1]."""
    values = np.asarray(values)
    if values.ndim == 2:
        values = values[..., None]
    if values.ndim != 3 or values.shape[2] not in (1, 3, 4):
        text = f"expected [height, width] with 1, 3 or 4 channels, got shape {values.shape}; put the channels last"
        raise InvalidPhoto(text, source=name)
    check_size(values.shape[1], values.shape[0], name)
    if values.dtype.kind == "u" and values.dtype.itemsize <= 2:
        display = np.divide(values, np.float32(np.iinfo(values.dtype).max), dtype=np.float32)
    elif np.issubdtype(values.dtype, np.floating):
        low, high = float(values.min()), float(values.max())
        if not (np.isfinite(low) and np.isfinite(high)):
            count = int(np.count_nonzero(~np.isfinite(values)))
            text = f"expected float display values from 0 to 1, got NaN or infinity in {count} of them; replace them"
            raise InvalidPhoto(text, source=name)
        if not (low >= -1e-4 and high <= 1.0 + 1e-4):  # 1e-4: rounding of a resize
            raise InvalidPhoto(
                f"expected float display values from 0 to 1, got {low:.3g} to {high:.3g}; "
                "scale them, or save linear radiance as .exr",
                source=name,
            )
        display = values.astype(np.float32)
        np.clip(display, 0.0, 1.0, out=display)
    else:
        raise InvalidPhoto(f"expected uint8, uint16 or float values, got {values.dtype}; convert it", source=name)
    alpha = None
    if display.shape[2] == 4 and (display[..., 3] < 1.0).any():
        alpha = np.ascontiguousarray(display[..., 3])
    if display.shape[2] == 4:
        display = display[..., :3].copy()
    rgb = np.broadcast_to(display, (*display.shape[:2], 3)) if display.shape[2] == 1 else display
    return Pixels(rgb=rgb, alpha=alpha, long_fov_deg=None, name=name)

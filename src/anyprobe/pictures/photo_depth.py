"""Depth maps in a photo's file, as phones write them for portraits.

- HEIC: an auxiliary picture with depth representation information (ITU-T H.265, G.14.2.6); Apple writes disparity.
- Apple's JPEG: a picture behind the first, whose XMP describes its values.
- GDepth: a picture in the XMP of a JPEG (developers.google.com/depthmap-metadata).
- Dynamic Depth 1.0: a picture in the container behind a JPEG.
"""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, BinaryIO
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from anyprobe.errors import InvalidMask
from anyprobe.notices import leave_out
from anyprobe.pictures.headers import open_picture
from anyprobe.pictures.jpeg_parts import XMP, app_segments, jpeg_end, jpeg_pictures

if TYPE_CHECKING:
    from jaxtyping import Float

EXTENDED_XMP = b"http://ns.adobe.com/xmp/extension/\0"
MOST_BYTES, MOST_XMP_BYTES = 1 << 28, 1 << 26
"""Largest size of a file, and of all its XMP [bytes]."""
MOST_PIXELS = 25_000_000
"""Largest number of pixels of a depth map; phones write less than a million."""

_APPLE = "http://ns.apple.com/pixeldatainfo/1.0/"
_GDEPTH = "http://ns.google.com/photos/1.0/depthmap/"
_DYNAMIC = "http://ns.google.com/photos/dd/1.0/depthmap/"
_ITEMS = ("http://ns.google.com/photos/dd/1.0/item/", "http://ns.google.com/photos/1.0/container/item/")

_INVERSE_Z, _DISPARITY, _Z = 0, 1, 2
"""Codes of H.265 for the quantity that a depth picture's values are linear in."""

_Properties = Mapping[str, str]
"""Properties of one element of XMP, by name."""


class _Unusable(ValueError):
    """A depth map is there and cannot be used; the message follows "got"."""


def photo_depth(image: Image.Image, stream: BinaryIO | None, name: str) -> Float[np.ndarray, "h w"] | None:
    """Return depth along the camera's axis in the file's own unit (Apple's: metres), zero where none was measured.

    It is oriented as the picture is stored, not turned by EXIF, and has a size of its own.

    Args:
        image: opened picture.
        stream: its open file; None where there is none: then only depth of a HEIC is found.
    Returns:
        [h, w] float32; None where the file has none.
    Raises:
        InvalidMask: the depth map is damaged or cannot be used.
    """
    try:
        if image.format == "HEIF":
            return _of_heic(image)
        if stream is None or image.format not in ("JPEG", "MPO"):
            return None
        stream.seek(0)
        data = stream.read(MOST_BYTES)
        documents = list(_documents(data))
        readers: tuple[Callable[[], np.ndarray | None], ...] = (
            lambda: _of_dynamic_depth(data, documents),
            lambda: _of_gdepth(documents),
            lambda: _of_apple_jpeg(data),
        )
        return next((depth for read in readers if (depth := read()) is not None), None)
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        reason = str(error) if isinstance(error, _Unusable) else "a damaged one"
        raise InvalidMask(
            f"expected a usable depth map in the photo's file, got {reason}; give it as a picture",
            subject="depth",
            source=name,
            remedy=leave_out("depth"),
        ) from error


def _of_heic(image: Image.Image) -> np.ndarray | None:
    """Return the depth of a HEIC's auxiliary picture."""
    found = (image.info.get("depth_images") or [None])[0]
    if found is None:
        return None
    metadata: Mapping[str, Any] = found.info.get("metadata") or {}
    kind = metadata.get("representation_type")
    if found.size[0] * found.size[1] > MOST_PIXELS:
        raise _Unusable(f"one of {found.size[0]} x {found.size[1]} pixels")
    if kind == _DISPARITY and {"d_min", "d_max"} <= metadata.keys():
        low, high = metadata["d_min"], metadata["d_max"]
    elif kind in (_INVERSE_Z, _Z) and {"z_near", "z_far"} <= metadata.keys():
        low, high = metadata["z_near"], metadata["z_far"]
        _check_range(low, high)
        low, high = (low, high) if kind == _Z else (1.0 / high, 1.0 / low)
    else:
        raise _Unusable("one whose values are of unknown meaning")
    return _depth(_levels(found.to_pillow()), low, high, inverse=kind != _Z)


def _of_apple_jpeg(data: bytes) -> np.ndarray | None:
    """Return the depth of a picture behind the first that has Apple's XMP of its own."""
    for number, picture in enumerate(jpeg_pictures(data)):
        for xmp in app_segments(picture) if number else ():
            documents = _parsed(xmp[len(XMP) :]) if xmp.startswith(XMP) else ()
            for properties in (found for document in documents for found in _properties(document, _APPLE)):
                kind = properties.get("AuxiliaryImageType", "").lower()
                if kind not in ("disparity", "depth"):
                    continue
                first, last = _number(properties, "IntMinValue", 0.0), _number(properties, "IntMaxValue", 255.0)
                if first >= last:
                    raise _Unusable(f"one of values from {first:g} to {last:g}")
                levels = (255.0 * _levels(_opened(picture)) - first) / (last - first)
                low, high = _number(properties, "FloatMinValue"), _number(properties, "FloatMaxValue")
                return _depth(levels, low, high, inverse=kind == "disparity")
    return None


def _of_gdepth(documents: list[ElementTree.Element]) -> np.ndarray | None:
    """Return the depth of a picture in XMP; its properties may be spread over several documents."""
    merged: dict[str, str] = {}
    for document in documents:
        for properties in _properties(document, _GDEPTH):
            merged |= properties
    if "Data" not in merged:
        return None
    return _ranged(_levels(_opened(base64.b64decode(merged["Data"]))), merged)


def _of_dynamic_depth(data: bytes, documents: list[ElementTree.Element]) -> np.ndarray | None:
    """Return the depth of an item in the container that begins where the first JPEG ends."""
    maps = [properties for document in documents for properties in _properties(document, _DYNAMIC)]
    if not maps:
        return None
    found = next((one for one in maps if one.get("ItemSemantic", "Depth") == "Depth"), None)
    if found is None:
        raise _Unusable(f"one of kind {maps[0]['ItemSemantic'].lower()}")
    at = jpeg_end(data)
    listed = (items for document in documents for name in _ITEMS if (items := list(_properties(document, name))))
    for number, item in enumerate(next(listed, [])):
        size = int(item.get("Length", 0)) if number else 0
        named = item.get("DataURI", "") == found.get("DepthURI", "") != "" or item.get("Semantic") == "Depth"
        if number and named:
            return _ranged(_levels(_opened(data[at : at + size])), found)
        at += max(size, 0) + max(int(item.get("Padding", 0)), 0)
    raise _Unusable("one that is missing from its container")


def _ranged(levels: np.ndarray, properties: _Properties) -> np.ndarray:
    """Convert levels to depth by Google's Format, Near, Far and Units."""
    near, far = _number(properties, "Near"), _number(properties, "Far")
    kind = properties.get("Format", "RangeInverse")
    _check_range(near, far)
    if properties.get("MeasureType", "OpticalAxis") != "OpticalAxis":
        raise _Unusable("one along the rays, not along the camera's axis")
    if kind not in ("RangeInverse", "RangeLinear"):
        raise _Unusable(f"one of format {kind[:40]}")
    inverse = kind == "RangeInverse"
    low, high = (1.0 / near, 1.0 / far) if inverse else (near, far)
    return _depth(levels, low, high, inverse=inverse != (properties.get("Units") == "Diopters"))


def _check_range(near: float, far: float) -> None:
    if not 0.0 < near < far < math.inf:
        raise _Unusable(f"one from {near:g} to {far:g}")


def _depth(levels: np.ndarray, low: float, high: float, *, inverse: bool) -> np.ndarray:
    """Map levels in [0, 1] to depth from low to high, or to its inverse; zero where the result is not positive."""
    if not (math.isfinite(low) and math.isfinite(high) and low < high or inverse and 0.0 < high < low < math.inf):
        raise _Unusable(f"one of values from {low:g} to {high:g}")
    values = low + (high - low) * levels
    measured = values > 0.0
    found = np.where(measured, values, 1.0)
    return np.where(measured, 1.0 / found if inverse else found, 0.0).astype(np.float32)


def _opened(data: bytes) -> Image.Image:
    """Open a depth map's JPEG or PNG."""
    picture = open_picture(io.BytesIO(data))
    if picture.format not in ("JPEG", "MPO", "PNG"):
        raise _Unusable(f"one as {picture.format}")
    if picture.width * picture.height > MOST_PIXELS:
        raise _Unusable(f"one of {picture.width} x {picture.height} pixels")
    return picture


def _levels(picture: Image.Image) -> np.ndarray:
    """Return values [h, w] in [0, 1]: the grey, or the first channel."""
    if picture.mode.startswith("I"):
        return np.asarray(picture, np.float64) / 65535.0
    grey = picture if picture.mode == "L" else picture.convert("RGB").getchannel(0)
    return np.asarray(grey, np.float64) / 255.0


def _documents(data: bytes) -> Iterator[ElementTree.Element]:
    """Yield the XMP about depth of a file's first JPEG, and its extended XMP, joined."""
    extended: dict[bytes, list[tuple[int, bytes]]] = {}
    size = 0
    for segment in app_segments(data):
        if segment.startswith(XMP):
            yield from _parsed(segment[len(XMP) :])
        elif segment.startswith(EXTENDED_XMP):
            at = len(EXTENDED_XMP)
            place = int.from_bytes(segment[at + 36 : at + 40], "big")
            extended.setdefault(segment[at : at + 32], []).append((place, segment[at + 40 :]))
            size += len(segment)
            if size > MOST_XMP_BYTES:
                raise _Unusable(f"XMP of more than {MOST_XMP_BYTES >> 20} MiB")
    for parts in extended.values():
        yield from _parsed(b"".join(part for _, part in sorted(parts)))


def _parsed(xmp: bytes) -> Iterator[ElementTree.Element]:
    """Yield the XMP's document, if it is about depth."""
    if not any(name.encode() in xmp for name in (_APPLE, _GDEPTH, _DYNAMIC, *_ITEMS)):
        return
    if b"<!DOCTYPE" in xmp or b"<!ENTITY" in xmp:
        raise _Unusable("XMP that defines entities")
    yield ElementTree.fromstring(xmp[xmp.find(b"<") : xmp.rfind(b">") + 1])


def _properties(document: ElementTree.Element, namespace: str) -> Iterator[dict[str, str]]:
    """Yield attributes and text children in this namespace of each element that has any, in order."""
    head = f"{{{namespace}}}"
    for element in document.iter():
        found = {key[len(head) :]: value for key, value in element.items() if key.startswith(head)}
        found |= {
            part.tag[len(head) :]: (part.text or "").strip() for part in element if str(part.tag).startswith(head)
        }
        if found:
            yield found


def _number(properties: _Properties, name: str, default: float = math.nan) -> float:
    value = float(properties.get(name, default))
    if math.isnan(value):
        raise _Unusable(f"one without {name}")
    return value

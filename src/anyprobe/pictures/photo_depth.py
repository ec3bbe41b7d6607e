"""Depth that a photo's file carries beside its picture, as phones write it for portraits.

- HEIC: an auxiliary picture with depth representation information (ITU-T H.265, G.14.2.6); Apple writes disparity.
- Apple's JPEG: a picture behind the first, whose XMP says what its values mean.
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
from anyprobe.pictures.headers import open_picture
from anyprobe.pictures.jpeg_parts import XMP, app_segments, jpeg_end, jpeg_pictures

if TYPE_CHECKING:
    from jaxtyping import Float

EXTENDED_XMP = b"http://ns.adobe.com/xmp/extension/\0"
MOST_BYTES, MOST_XMP_BYTES = 1 << 28, 1 << 26
"""Largest file, and all of its XMP."""
MOST_PIXELS = 25_000_000
"""Phones write less than one million."""

_APPLE = "http://ns.apple.com/pixeldatainfo/1.0/"
_GDEPTH = "http://ns.google.com/photos/1.0/depthmap/"
_DYNAMIC = "http://ns.google.com/photos/dd/1.0/depthmap/"
_ITEMS = ("http://ns.google.com/photos/dd/1.0/item/", "http://ns.google.com/photos/1.0/container/item/")

_INVERSE_Z, _DISPARITY, _Z = 0, 1, 2
"""How H.265 calls what a depth picture's values are linear in."""

_Said = Mapping[str, str]
"""Properties of one element of XMP, by name."""


class _Unread(ValueError):
    """Depth that is there and cannot be used; the text follows "got"."""


def photo_depth(image: Image.Image, stream: BinaryIO | None, name: str) -> Float[np.ndarray, "h w"] | None:
    """Depth along the camera's axis in the file's own unit (Apple's: metres), float32, zero where none was measured.

    It lies as the picture is stored, not upright by EXIF, at a size of its own.

    Args:
        image: whose header is read.
        stream: its open file; None where there is none, and then depth of a HEIC alone is found.
    Returns:
        None where the file carries none.
    Raises:
        InvalidMask: one line on what is damaged or cannot be used.
    """
    try:
        if image.format == "HEIF":
            return _of_heic(image)
        if stream is None or image.format not in ("JPEG", "MPO"):
            return None
        stream.seek(0)
        data = stream.read(MOST_BYTES)
        said = list(_documents(data))
        ways: tuple[Callable[[], np.ndarray | None], ...] = (
            lambda: _of_dynamic_depth(data, said),
            lambda: _of_gdepth(said),
            lambda: _of_apple_jpeg(data),
        )
        return next((depth for way in ways if (depth := way()) is not None), None)
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        reason = str(error) if isinstance(error, _Unread) else "a damaged one"
        raise InvalidMask(
            f"expected a depth map that can be used in the file, got {reason}; leave depth out, or give it as "
            "a picture",
            source=name,
        ) from error


def _of_heic(image: Image.Image) -> np.ndarray | None:
    """Return an auxiliary picture of a HEIC."""
    found = (image.info.get("depth_images") or [None])[0]
    if found is None:
        return None
    said: Mapping[str, Any] = found.info.get("metadata") or {}
    kind = said.get("representation_type")
    if found.size[0] * found.size[1] > MOST_PIXELS:
        raise _Unread(f"one of {found.size[0]} x {found.size[1]} pixels")
    if kind == _DISPARITY and {"d_min", "d_max"} <= said.keys():
        low, high = said["d_min"], said["d_max"]
    elif kind in (_INVERSE_Z, _Z) and {"z_near", "z_far"} <= said.keys():
        low, high = said["z_near"], said["z_far"]
        _check_range(low, high)
        low, high = (low, high) if kind == _Z else (1.0 / high, 1.0 / low)
    else:
        raise _Unread("one that does not say what its values mean")
    return _depth(_levels(found.to_pillow()), low, high, inverse=kind != _Z)


def _of_apple_jpeg(data: bytes) -> np.ndarray | None:
    """Return a picture behind the first, with Apple's XMP of its own."""
    for number, picture in enumerate(jpeg_pictures(data)):
        for xmp in app_segments(picture) if number else ():
            documents = _parsed(xmp[len(XMP) :]) if xmp.startswith(XMP) else ()
            for said in (said for document in documents for said in _properties(document, _APPLE)):
                kind = said.get("AuxiliaryImageType", "").lower()
                if kind not in ("disparity", "depth"):
                    continue
                first, last = _number(said, "IntMinValue", 0.0), _number(said, "IntMaxValue", 255.0)
                if first >= last:
                    raise _Unread(f"one of values from {first:g} to {last:g}")
                levels = (255.0 * _levels(_opened(picture)) - first) / (last - first)
                low, high = _number(said, "FloatMinValue"), _number(said, "FloatMaxValue")
                return _depth(levels, low, high, inverse=kind == "disparity")
    return None


def _of_gdepth(documents: list[ElementTree.Element]) -> np.ndarray | None:
    """Return a picture in XMP; what it means may stand in another part of the XMP."""
    said: dict[str, str] = {}
    for document in documents:
        for properties in _properties(document, _GDEPTH):
            said |= properties
    if "Data" not in said:
        return None
    return _ranged(_levels(_opened(base64.b64decode(said["Data"]))), said)


def _of_dynamic_depth(data: bytes, documents: list[ElementTree.Element]) -> np.ndarray | None:
    """Return an item of the container that begins where the first JPEG ends."""
    maps = [said for document in documents for said in _properties(document, _DYNAMIC)]
    if not maps:
        return None
    found = next((said for said in maps if said.get("ItemSemantic", "Depth") == "Depth"), None)
    if found is None:
        raise _Unread(f"one of the object's {maps[0]['ItemSemantic'].lower()} in its place")
    at = jpeg_end(data)
    listed = (items for document in documents for name in _ITEMS if (items := list(_properties(document, name))))
    for number, item in enumerate(next(listed, [])):
        size = int(item.get("Length", 0)) if number else 0
        named = item.get("DataURI", "") == found.get("DepthURI", "") != "" or item.get("Semantic") == "Depth"
        if number and named:
            return _ranged(_levels(_opened(data[at : at + size])), found)
        at += max(size, 0) + max(int(item.get("Padding", 0)), 0)
    raise _Unread("one that its container does not hold")


def _ranged(levels: np.ndarray, said: _Said) -> np.ndarray:
    """Depth by Google's Format, Near, Far and Units."""
    near, far, kind = _number(said, "Near"), _number(said, "Far"), said.get("Format", "RangeInverse")
    _check_range(near, far)
    if said.get("MeasureType", "OpticalAxis") != "OpticalAxis":
        raise _Unread("one along the rays, not along the camera's axis")
    if kind not in ("RangeInverse", "RangeLinear"):
        raise _Unread(f"one of the format {kind[:40]}")
    inverse = kind == "RangeInverse"
    low, high = (1.0 / near, 1.0 / far) if inverse else (near, far)
    return _depth(levels, low, high, inverse=inverse != (said.get("Units") == "Diopters"))


def _check_range(near: float, far: float) -> None:
    if not 0.0 < near < far < math.inf:
        raise _Unread(f"one from {near:g} to {far:g}")


def _depth(levels: np.ndarray, low: float, high: float, *, inverse: bool) -> np.ndarray:
    """Depth of levels in [0, 1] from low to high of it, or of its inverse; zero where that is not above zero."""
    if not (math.isfinite(low) and math.isfinite(high) and low < high or inverse and 0.0 < high < low < math.inf):
        raise _Unread(f"one of values from {low:g} to {high:g}")
    values = low + (high - low) * levels
    measured = values > 0.0
    found = np.where(measured, values, 1.0)
    return np.where(measured, 1.0 / found if inverse else found, 0.0).astype(np.float32)


def _opened(data: bytes) -> Image.Image:
    """Return a depth map's JPEG or PNG."""
    picture = open_picture(io.BytesIO(data))
    if picture.format not in ("JPEG", "MPO", "PNG"):
        raise _Unread(f"one as {picture.format}")
    if picture.width * picture.height > MOST_PIXELS:
        raise _Unread(f"one of {picture.width} x {picture.height} pixels")
    return picture


def _levels(picture: Image.Image) -> np.ndarray:
    """[h, w] in [0, 1]: its grey, or of colours the first."""
    if picture.mode.startswith("I"):
        return np.asarray(picture, np.float64) / 65535.0
    grey = picture if picture.mode == "L" else picture.convert("RGB").getchannel(0)
    return np.asarray(grey, np.float64) / 255.0


def _documents(data: bytes) -> Iterator[ElementTree.Element]:
    """XMP about depth of a file's first JPEG, and its extended XMP put together."""
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
                raise _Unread(f"XMP of more than {MOST_XMP_BYTES >> 20} MiB")
    for parts in extended.values():
        yield from _parsed(b"".join(part for _, part in sorted(parts)))


def _parsed(xmp: bytes) -> Iterator[ElementTree.Element]:
    """Its document; none where it says nothing of depth."""
    if not any(name.encode() in xmp for name in (_APPLE, _GDEPTH, _DYNAMIC, *_ITEMS)):
        return
    if b"<!DOCTYPE" in xmp or b"<!ENTITY" in xmp:
        raise _Unread("XMP that defines entities")
    yield ElementTree.fromstring(xmp[xmp.find(b"<") : xmp.rfind(b">") + 1])


def _properties(document: ElementTree.Element, namespace: str) -> Iterator[dict[str, str]]:
    """Yield attributes and text children in this namespace of each element that has any, in order."""
    head = f"{{{namespace}}}"
    for element in document.iter():
        found = {key[len(head) :]: value for key, value in element.items() if key.startswith(head)}
        found |= {one.tag[len(head) :]: (one.text or "").strip() for one in element if str(one.tag).startswith(head)}
        if found:
            yield found


def _number(said: _Said, name: str, default: float = math.nan) -> float:
    value = float(said.get(name, default))
    if math.isnan(value):
        raise _Unread(f"one that does not say its {name}")
    return value

"""Gain maps: what a photo for ordinary screens holds beside its picture to show highlights on brighter ones.

Ultra HDR (Android: XMP of the namespace hdrgm) and ISO 21496-1, in a second JPEG behind the first; ISO's holds

    log2 (HDR + o_h) / (SDR + o_s) = min + (max - min) g^(1 / gamma)

of linear light, with g in [0, 1] of the map's pixels; of a HEIC or AVIF as an item of its own. Apple's, there or beside
the picture of a HEIC, see apple_gain.
"""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from anyprobe.pictures.apple_gain import apple_headroom, rec709_to_linear
from anyprobe.pictures.color_encoding import STRIP_PIXELS, srgb_to_linear
from anyprobe.pictures.headers import open_picture
from anyprobe.pictures.heif_boxes import find_tone_map
from anyprobe.pictures.jpeg_parts import XMP, app_segments, jpeg_pictures
from anyprobe.pictures.raw import HEAD_BYTES

ISO = b"urn:iso:std:iso:ts:21496:-1\0"

MARKS = (b"hdrgm", b"ts:21496")
"""Marks in the first segments of a JPEG with a gain map of the first two kinds."""
MOST_BYTES = 1 << 28
MAX_MAP_PIXELS = 50_000_000
ANOTHER_SHAPE = 0.1
"""By which a map's width over height may differ from its picture's, share of it; one that is turned differs more."""
MOST_STOPS = 16.0

COMMON_DENOMINATOR, MULTICHANNEL = 0x08, 0x80
"""Flags of ISO 21496-1."""

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, kw_only=True, slots=True)
class GainMap:
    """image: the map. brighter: from linear light of the picture [h, w, 3] and the map's values [h, w, 1 or 3] in
    [0, 1] to the light that is meant."""

    image: Image.Image
    brighter: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def radiance(self, display: np.ndarray, turn: Image.Transpose | None = None) -> np.ndarray:
        """Linear Rec. 709 radiance [H, W, 3] float32 of the picture's sRGB [H, W, 3] in [0, 1].

        turn: that brings the map upright, as the picture is.
        """
        image = self.image if turn is None else self.image.transpose(turn)
        height, width = display.shape[:2]
        result = np.empty(display.shape, np.float32)
        step = max(1, STRIP_PIXELS // width)
        for top in range(0, height, step):
            rows = min(step, height - top)
            box = (0.0, top * image.height / height, float(image.width), (top + rows) * image.height / height)
            part = np.asarray(image.resize((width, rows), Image.Resampling.BILINEAR, box=box), np.float32) / 255.0
            base = srgb_to_linear(display[top : top + rows])
            result[top : top + rows] = self.brighter(base, part.reshape(rows, width, -1))
        return np.maximum(result, 0.0)


def gain_map_of(image: Image.Image, stream: BinaryIO | None) -> GainMap | None:
    """Return the gain map of a JPEG or HEIC whose open file is stream; None where it has none that can be read."""
    if stream is None or image.format not in ("JPEG", "MPO", "HEIF", "AVIF"):
        return None
    stream.seek(0)
    if image.format in ("HEIF", "AVIF"):
        return _of_tone_map(image, stream) or _of_heif(image, stream)
    head = stream.read(HEAD_BYTES)
    if any(mark in head for mark in MARKS):
        return find_gain_map(head + stream.read(MOST_BYTES))
    return _of_apple_jpeg(image, head + stream.read(MOST_BYTES)) if image.format == "MPO" else None


def _of_tone_map(image: Image.Image, stream: BinaryIO) -> GainMap | None:
    """Return the gain map of an item of ISO 21496-1."""
    data = stream.read(MOST_BYTES)
    stream.seek(0)
    if b"tmap" not in data[:BRAND_BYTES]:
        return None
    try:
        found = find_tone_map(data)
        numbers = None if found is None else _of_iso(found.said)
        if found is None or numbers is None:
            return None
        with open_picture(io.BytesIO(found.alone)) as picture:
            if picture.width * picture.height > MAX_MAP_PIXELS or _is_turned(picture.size, image.size):
                return None
            return _checked(picture.convert("L" if picture.mode == "L" else "RGB"), *numbers)
    except Exception:  # decoders raise whatever the bad bytes lead them to
        return None


def _is_turned(gain: tuple[int, int], picture: tuple[int, int]) -> bool:
    return abs(gain[0] / gain[1] / (picture[0] / picture[1]) - 1.0) > ANOTHER_SHAPE


def _of_heif(image: Image.Image, stream: BinaryIO) -> GainMap | None:
    numbers = [each for kind, each in image.info.get("aux", {}).items() if _APPLE.search(str(kind).encode())]
    headroom = apple_headroom(image, image.info.get("xmp") or b"") if numbers and numbers[0] else None
    if headroom is None:
        return None
    import pillow_heif

    try:
        found = pillow_heif.open_heif(stream)[0].get_aux_image(numbers[0][0])
        if found.size[0] * found.size[1] > MAX_MAP_PIXELS or _is_turned(found.size, image.size):
            return None
        return _apples(found.to_pillow(), headroom)
    except Exception:  # decoders raise whatever the bad bytes lead them to
        return None


def _of_apple_jpeg(image: Image.Image, data: bytes) -> GainMap | None:
    for number, picture in enumerate(jpeg_pictures(data)):
        said = [one for one in app_segments(picture) if one.startswith(XMP) and _APPLE.search(one)] if number else []
        headroom = apple_headroom(image, said[0]) if said else None
        if headroom is not None:
            try:
                return _apples(_decoded(picture), headroom)
            except ValueError:
                return None
    return None


def _apples(image: Image.Image, headroom: float) -> GainMap:
    def brighter(base: np.ndarray, gain: np.ndarray) -> np.ndarray:
        return base * (1.0 + (headroom - 1.0) * rec709_to_linear(gain))

    return GainMap(image=image.convert("L"), brighter=brighter)


def find_gain_map(data: bytes) -> GainMap | None:
    """Return the gain map of a JPEG by Ultra HDR or ISO; None where it has none that brightens, or a damaged one."""
    for number, picture in enumerate(jpeg_pictures(data)):
        if number == 0:
            continue
        for said in app_segments(picture):
            try:
                numbers = _of_iso(said[len(ISO) :]) if said.startswith(ISO) else _of_xmp(said)
                found = None if numbers is None else _checked(_decoded(picture), *numbers)
            except (struct.error, ValueError, ZeroDivisionError):
                continue
            if found is not None:
                return found
    return None


UNREAD = "its gain map is not read, so that highlights end at white; save it as Ultra HDR, PQ or EXR to have them"
_CLIPPED, MUCH = 0.99, 0.005
"""Display value from which on a pixel is white, and share of these from which on a gain map is missed."""
BRAND_BYTES = 4096
_APPLE = re.compile(rb"hdrgainmap", re.IGNORECASE)


def misses_gain_map(image: Image.Image, stream: BinaryIO | None, display: np.ndarray) -> bool:
    """Return whether a picture [H, W, 3] without radiance is white in places and its file holds a gain map that could
    not be read: Apple's without its headroom, say."""
    if stream is None or image.format not in ("MPO", "HEIF", "AVIF"):
        return False
    if (display.max(axis=-1) >= _CLIPPED).mean() < MUCH:
        return False
    if any(_APPLE.search(str(kind).encode()) for kind in image.info.get("aux", ())):
        return True
    stream.seek(0)
    if image.format == "MPO":
        return _APPLE.search(stream.read(MOST_BYTES)) is not None
    return b"tmap" in stream.read(BRAND_BYTES)


def _checked(image: Image.Image, *numbers: np.ndarray) -> GainMap | None:
    """Return a map of numbers that can be meant; ValueError for others."""
    low, high, gamma, base_offset, offset = (np.broadcast_to(np.asarray(one, np.float32), 3) for one in numbers)
    usual = np.abs([low, high]).max() <= MOST_STOPS and (gamma > 0.01).all() and (gamma < 100.0).all()
    if not usual or not (np.abs([base_offset, offset]) <= 1.0).all() or (high < low).any():
        raise ValueError

    def brighter(base: np.ndarray, gain: np.ndarray) -> np.ndarray:
        return (base + base_offset) * np.exp2(low + (high - low) * gain ** (1.0 / gamma)) - offset

    return GainMap(image=image, brighter=brighter)


def _decoded(picture: bytes) -> Image.Image:
    """Return a map's JPEG, L or RGB; ValueError where it is damaged or too large."""
    try:
        stored = JpegImageFile(io.BytesIO(picture), "")
        if stored.width * stored.height > MAX_MAP_PIXELS:
            raise ValueError
        return stored.convert("L" if stored.mode == "L" else "RGB")
    except Exception as error:  # decoders raise whatever the bad bytes lead them to
        raise ValueError from error


def _of_iso(data: bytes) -> tuple[np.ndarray, ...] | None:
    """Minimum, maximum, gamma and both offsets of ISO 21496-1's metadata; None of a picture that is brighter itself."""
    if len(data) <= 5:  # the version alone, in the first picture
        return None
    flags, at = data[4], 5
    channels = 3 if flags & MULTICHANNEL else 1
    if flags & COMMON_DENOMINATOR:
        (below,) = struct.unpack_from(">I", data, at)
        base, other, *values = np.array(struct.unpack_from(">II" + "iiIii" * channels, data, at + 4)) / below
    else:
        pairs = struct.unpack_from(">IIII" + "iIiIIIiIiI" * channels, data, at)
        base, other, *values = np.array(pairs[0::2]) / np.array(pairs[1::2])
    if base >= other or not np.isfinite(values).all():
        return None
    return tuple(np.array(values).reshape(channels, 5).T)


def _of_xmp(data: bytes) -> tuple[np.ndarray, ...] | None:
    """Return the same of Ultra HDR's XMP."""
    text = data.decode("utf-8", "replace")
    if not data.startswith(XMP) or "hdrgm:GainMapMax" not in text or 'BaseRenditionIsHDR="True"' in text:
        return None

    def read(name: str, default: float) -> np.ndarray:
        found = re.search(rf'hdrgm:{name}\s*=\s*"([^"]*)"|<hdrgm:{name}>(.*?)</hdrgm:{name}>', text, re.DOTALL)
        if found is None:
            return np.array([default])
        inside = found[1] or " ".join(re.findall(r"<rdf:li[^>]*>([^<]*)</rdf:li>", found[2] or "")) or found[2] or ""
        values = [float(number) for number in _NUMBER.findall(inside)]
        if len(values) not in (1, 3):
            raise ValueError(name)
        return np.array(values)

    names = (("GainMapMin", 0.0), ("GainMapMax", 1.0), ("Gamma", 1.0), ("OffsetSDR", 1 / 64), ("OffsetHDR", 1 / 64))
    return tuple(read(*pair) for pair in names)

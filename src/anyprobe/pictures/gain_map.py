"""Gain maps: a second picture in a photo's file that restores its highlights on HDR screens.

Ultra HDR (Android: XMP of the namespace hdrgm) and ISO 21496-1, in a second JPEG behind the first. They mean

    log2 (HDR + o_h) / (SDR + o_s) = min + (max - min) g^(1 / gamma)

in linear light, with g in [0, 1] of the map's pixels. A HEIC holds ISO's as an item. Apple's maps, in JPEG and HEIC,
mean the picture's light times 1 + (headroom - 1) g, with g the map's values decoded by Rec. 709's curve ("Applying
Apple HDR effect to your photos", developer.apple.com); the camera notes the headroom.

Ultra HDR is written too, in Android's XMP (hdrgm 1.0), with o_h = o_s = min = 0, gamma = 1 and SDR = min(HDR, 1) in
sRGB, channel by channel. The second picture follows the first; CIPA's multi-picture segment has its offset. Photos are
read by `gain_map_of`, exports written by `write_ultra_hdr`.
"""

import io
import re
import struct
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image
from PIL.JpegImagePlugin import JpegImageFile

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import atomic_path
from anyprobe.pictures.color_encoding import STRIP_PIXELS, linear_to_srgb, srgb_to_linear
from anyprobe.pictures.deep_pixels import HEAD_BYTES, turned_upright
from anyprobe.pictures.file_parts import XMP, find_tone_map, jpeg_pictures
from anyprobe.pictures.headers import apple_numbers, open_picture

ISO = b"urn:iso:std:iso:ts:21496:-1\0"

MARKS = (b"hdrgm", b"ts:21496")
"""Bytes that occur in the first segments of a JPEG with a gain map of Ultra HDR or ISO."""
MOST_BYTES = 1 << 28
MAX_MAP_PIXELS = 50_000_000
ASPECT_TOLERANCE = 0.1
"""Largest relative difference between the aspect ratios of a map and its picture; a map that is turned differs more."""
MOST_STOPS = 16.0
"""Largest gain [stops], in either direction, that is believed, and that is written; more is clipped."""

COMMON_DENOMINATOR, MULTICHANNEL = 0x08, 0x80
"""Flags of ISO 21496-1."""

_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


@dataclass(frozen=True, kw_only=True, slots=True)
class GainMap:
    """A gain map: its picture, and a function from linear light of the base picture [h, w, 3] and the map's values
    [h, w, 1 or 3] in [0, 1] to HDR light [h, w, 3]."""

    image: Image.Image
    apply: Callable[[np.ndarray, np.ndarray], np.ndarray]

    def radiance(self, display: np.ndarray, orientation: int = 1) -> np.ndarray:
        """Compute linear Rec. 709 radiance [H, W, 3] float32 from the base picture's sRGB [H, W, 3] in [0, 1].

        orientation: of EXIF, from which the map is turned upright; the picture is upright already.
        """
        image = Image.fromarray(turned_upright(np.asarray(self.image), orientation))
        height, width = display.shape[:2]
        result = np.empty(display.shape, np.float32)
        step = max(1, STRIP_PIXELS // width)
        for top in range(0, height, step):
            rows = min(step, height - top)
            box = (0.0, top * image.height / height, float(image.width), (top + rows) * image.height / height)
            part = np.asarray(image.resize((width, rows), Image.Resampling.BILINEAR, box=box), np.float32) / 255.0
            base = srgb_to_linear(display[top : top + rows])
            result[top : top + rows] = self.apply(base, part.reshape(rows, width, -1))
        return np.maximum(result, 0.0)


def gain_map_of(image: Image.Image, stream: BinaryIO | None) -> GainMap | None:
    """Return the gain map of a JPEG or HEIC whose open file is stream; None where it has none that can be read."""
    if stream is None:
        return None
    for read in {"JPEG": (_of_jpeg,), "MPO": (_of_jpeg,), "HEIF": (_of_tone_map, _of_heif)}.get(image.format or "", ()):
        stream.seek(0)
        with suppress(Exception):  # decoders raise whatever the bad bytes lead them to
            if (found := read(image, stream)) is not None:
                return found
    return None


def _of_jpeg(image: Image.Image, stream: BinaryIO) -> GainMap | None:
    """Return a gain map of Ultra HDR or ISO, else Apple's."""
    head = stream.read(HEAD_BYTES)
    if any(mark in head for mark in MARKS):
        return find_gain_map(head + stream.read(MOST_BYTES))
    pictures = jpeg_pictures(head + stream.read(MOST_BYTES)) if image.format == "MPO" else iter(())
    for picture in islice(pictures, 1, None):
        xmp = [part for part in _segments(picture) if part.startswith(XMP) and _APPLE.search(part)]
        if (headroom := apple_headroom(image, xmp[0]) if xmp else None) is not None:
            return _apple_map(_decoded(picture), headroom)
    return None


def _of_tone_map(image: Image.Image, stream: BinaryIO) -> GainMap | None:
    """Return the gain map of an item of ISO 21496-1."""
    data = stream.read(MOST_BYTES)
    found = find_tone_map(data) if b"tmap" in data[:BRAND_BYTES] else None
    numbers = None if found is None else _of_iso(found[0])
    if found is None or numbers is None:
        return None
    with open_picture(io.BytesIO(found[1])) as picture:
        if not _fits(picture.size, image.size):
            return None
        return _checked(picture.convert("L" if picture.mode == "L" else "RGB"), *numbers)


def _fits(gain: tuple[int, int], picture: tuple[int, int]) -> bool:
    is_alike = abs(gain[0] / gain[1] / (picture[0] / picture[1]) - 1.0) <= ASPECT_TOLERANCE
    return is_alike and gain[0] * gain[1] <= MAX_MAP_PIXELS


def _of_heif(image: Image.Image, stream: BinaryIO) -> GainMap | None:
    items = [ids for kind, ids in image.info.get("aux", {}).items() if _APPLE.search(str(kind).encode())]
    headroom = apple_headroom(image, image.info.get("xmp") or b"") if items and items[0] else None
    if headroom is None:
        return None
    import pillow_heif

    found = pillow_heif.open_heif(stream)[0].get_aux_image(items[0][0])
    return _apple_map(found.to_pillow(), headroom) if _fits(found.size, image.size) else None


def _segments(picture: bytes) -> list[bytes]:
    """Return the contents of a JPEG's application segments; none of a damaged one."""
    with suppress(Exception):  # decoders raise whatever the bad bytes lead them to
        return [content for _, content in JpegImageFile(io.BytesIO(picture), "").applist]
    return []


def _apple_map(image: Image.Image, headroom: float) -> GainMap:
    def apply(base: np.ndarray, gain: np.ndarray) -> np.ndarray:
        linear = np.where(gain < 0.081, gain / 4.5, ((gain + 0.099) / 1.099) ** (1 / 0.45))  # of ITU-R BT.709
        return base * (1.0 + (headroom - 1.0) * linear)

    return GainMap(image=image.convert("L"), apply=apply)


def find_gain_map(data: bytes) -> GainMap | None:
    """Return the Ultra HDR or ISO gain map of a JPEG; None where it has none, one that darkens, or a damaged one."""
    for picture in islice(jpeg_pictures(data), 1, None):
        for segment in _segments(picture):
            with suppress(Exception):  # decoders raise whatever the bad bytes lead them to
                numbers = _of_iso(segment[len(ISO) :]) if segment.startswith(ISO) else _of_xmp(segment)
                if numbers is not None:
                    return _checked(_decoded(picture), *numbers)
    return None


UNREAD = "its gain map cannot be read, so its highlights end at white; save it as Ultra HDR, PQ or OpenEXR to keep them"
_CLIPPED, MUCH_CLIPPED = 0.99, 0.005
"""Smallest display value of a clipped pixel, and share of such pixels from which a missing gain map matters."""
BRAND_BYTES = 4096
"""Number of bytes at the start of a HEIC or AVIF that list its brands."""
_APPLE = re.compile(rb"hdrgainmap", re.IGNORECASE)


def misses_gain_map(image: Image.Image, stream: BinaryIO | None, display: np.ndarray) -> bool:
    """Return whether a picture [H, W, 3] has clipped highlights and its file a gain map that could not be read, such as
    Apple's without its headroom."""
    if stream is None or image.format not in ("MPO", "HEIF", "AVIF"):
        return False
    if (display.max(axis=-1) >= _CLIPPED).mean() < MUCH_CLIPPED:
        return False
    if any(_APPLE.search(str(kind).encode()) for kind in image.info.get("aux", ())):
        return True
    stream.seek(0)
    if image.format == "MPO":
        return _APPLE.search(stream.read(MOST_BYTES)) is not None
    return b"tmap" in stream.read(BRAND_BYTES)


def _checked(image: Image.Image, *numbers: np.ndarray) -> GainMap:
    """Return the map with these parameters, see _of_iso; ValueError where they are implausible."""
    low, high, gamma, base_offset, offset = (np.broadcast_to(np.asarray(number, np.float32), 3) for number in numbers)
    plausible = np.abs([low, high]).max() <= MOST_STOPS and (gamma > 0.01).all() and (gamma < 100.0).all()
    if not plausible or not (np.abs([base_offset, offset]) <= 1.0).all() or (high < low).any():
        raise ValueError

    def apply(base: np.ndarray, gain: np.ndarray) -> np.ndarray:
        return (base + base_offset) * np.exp2(low + (high - low) * gain ** (1.0 / gamma)) - offset

    return GainMap(image=image, apply=apply)


def _decoded(picture: bytes) -> Image.Image:
    """Decode a map's JPEG to L or RGB; ValueError where it is too large."""
    stored = JpegImageFile(io.BytesIO(picture), "")
    if stored.width * stored.height > MAX_MAP_PIXELS:
        raise ValueError
    return stored.convert("L" if stored.mode == "L" else "RGB")


def _of_iso(data: bytes) -> tuple[np.ndarray, ...] | None:
    """Return minimum, maximum, gamma, and the offsets of the base and HDR pictures, [1 or 3] each, of ISO 21496-1.

    None where the base picture is the HDR one.
    """
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
    """Return the same from Ultra HDR's XMP."""
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


_HEADROOM, _GAIN = 33, 48
"""Tags of Apple's maker note."""
MOST_HEADROOM = 256.0
"""Largest headroom; a larger one is clipped."""
_XMP_HEADROOM = re.compile(rb"HDRGainMapHeadroom(?:=\"|>)\s*([0-9]+(?:\.[0-9]*)?)")


def apple_headroom(image: Image.Image, xmp: bytes = b"") -> float | None:
    """Return the brightest white over the screen's white, from XMP, else from the maker note in EXIF; None if neither
    has it.

    xmp: of the map, where it has any.
    """
    if (stated := _XMP_HEADROOM.search(xmp)) is not None:
        return float(np.clip(float(stated[1]), 1.0, MOST_HEADROOM))
    numbers = apple_numbers(image)
    if not {_HEADROOM, _GAIN} <= numbers.keys():
        return None
    (gain, *_), (headroom, *_) = numbers[_GAIN], numbers[_HEADROOM]
    if headroom < 1.0:
        stops = 1.8 - 20.0 * gain if gain <= 0.01 else 1.601 - 0.101 * gain
    else:
        stops = 3.0 - 70.0 * gain if gain <= 0.01 else 2.303 - 0.303 * gain
    return float(np.clip(2.0**stops, 1.0, MOST_HEADROOM))


QUALITY, GAIN_QUALITY = 95, 98
"""Qualities of both JPEG pictures."""
LEAST_STOPS = 1.0
_RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
_NAMES = (
    'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" xmlns:Container="http://ns.google.com/photos/1.0/container/" '
    'xmlns:Item="http://ns.google.com/photos/1.0/container/item/"'
)


def write_ultra_hdr(path: str | Path, radiance: np.ndarray) -> float:
    """Write linear light [H, W, 3] as an Ultra HDR JPEG, atomically.

    Returns:
        The largest radiance that it holds.
    Raises:
        OutputError: it cannot be written.
    """
    white = float(2.0 ** np.clip(np.log2(max(float(radiance.max()), 1e-6)), LEAST_STOPS, MOST_STOPS))
    stops = float(np.log2(white))
    gain = np.log2(np.clip(radiance, 1.0, white)) / stops
    base = _jpeg(linear_to_srgb(np.clip(radiance, 0.0, 1.0)), QUALITY)
    behind = _with_segments(_jpeg(gain, GAIN_QUALITY), [(0xE1, XMP + _gain_xmp(stops))])
    directory = XMP + _container_xmp(len(behind))
    length = len(_with_segments(base, [(0xE1, directory), (0xE2, _pictures(0, 0, 0))]))
    tiff = 2 + (2 + 2 + len(directory)) + 2 + 2 + 4  # where the multi-picture segment's offsets count from
    data = _with_segments(base, [(0xE1, directory), (0xE2, _pictures(length, len(behind), length - tiff))])
    with atomic_path(path) as temporary:
        temporary.write_bytes(data + behind)
    return white


def _jpeg(display: np.ndarray, quality: int) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(to_bytes(display)).save(stream, "JPEG", quality=quality, subsampling=0)
    return stream.getvalue()


def _with_segments(picture: bytes, segments: list[tuple[int, bytes]]) -> bytes:
    """Insert application segments behind a JPEG's start marker."""
    parts = [struct.pack(">BBH", 0xFF, kind, 2 + len(body)) + body for kind, body in segments]
    return picture[:2] + b"".join(parts) + picture[2:]


def _gain_xmp(stops: float) -> bytes:
    said = 'Version="1.0" BaseRenditionIsHDR="False" GainMapMin="0" GainMapMax="{0:.6f}" Gamma="1" OffsetSDR="0" '
    said += 'OffsetHDR="0" HDRCapacityMin="0" HDRCapacityMax="{0:.6f}"'
    return _xmp(" ".join(f"hdrgm:{one}" for one in said.format(stops).split()), "")


def _container_xmp(length: int) -> bytes:
    items = (("Primary", ""), ("GainMap", f' Item:Length="{length}"'))
    kinds = (f'Item:Semantic="{name}" Item:Mime="image/jpeg"{more}' for name, more in items)
    listed = "".join(f'<rdf:li rdf:parseType="Resource"><Container:Item {kind}/></rdf:li>' for kind in kinds)
    directory = f"<Container:Directory><rdf:Seq>{listed}</rdf:Seq></Container:Directory>"
    return _xmp('hdrgm:Version="1.0"', directory)


def _xmp(attributes: str, inside: str) -> bytes:
    about = f'<rdf:Description rdf:about="" xmlns:rdf="{_RDF}" {_NAMES} {attributes}>{inside}</rdf:Description>'
    return f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="{_RDF}">{about}</rdf:RDF></x:xmpmeta>'.encode()


def _pictures(primary: int, gain: int, offset: int) -> bytes:
    """Return CIPA DC-007's segment for two pictures: sizes in bytes, and the offset of the second."""
    entry = struct.Struct("<IIIHH")
    head = b"MPF\0" + struct.pack("<2sHIH", b"II", 42, 8, 3)
    fields = struct.pack("<HHI4s", 0xB000, 7, 4, b"0100") + struct.pack("<HHII", 0xB001, 4, 1, 2)
    fields += struct.pack("<HHII", 0xB002, 7, 2 * entry.size, 50) + struct.pack("<I", 0)
    return head + fields + entry.pack(0x030000, primary, 0, 0, 0) + entry.pack(0, gain, offset, 0, 0)

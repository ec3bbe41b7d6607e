"""Ultra HDR: a JPEG that every program shows, followed by the gain map that makes it HDR (Android's XMP, hdrgm 1.0).

    log2 (L / SDR) = g max

with L linear light, SDR = min(L, 1) in sRGB, and g in [0, 1] of the gain map's pixels, channel by channel. The second
picture follows the first; CIPA's multi-picture segment has its offset.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np
from PIL import Image

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import atomic_path
from anyprobe.pictures.color_encoding import linear_to_srgb
from anyprobe.pictures.file_parts import XMP
from anyprobe.pictures.gain_map import MOST_STOPS

QUALITY, GAIN_QUALITY = 95, 98
"""Qualities of both JPEG pictures."""
LEAST_STOPS = 1.0
_NAMES = (
    'xmlns:x="adobe:ns:meta/"',
    'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"',
    'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/"',
    'xmlns:Container="http://ns.google.com/photos/1.0/container/"',
    'xmlns:Item="http://ns.google.com/photos/1.0/container/item/"',
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
    attributes = {
        "Version": "1.0",
        "BaseRenditionIsHDR": "False",
        "GainMapMin": "0",
        "GainMapMax": f"{stops:.6f}",
        "Gamma": "1",
        "OffsetSDR": "0",
        "OffsetHDR": "0",
        "HDRCapacityMin": "0",
        "HDRCapacityMax": f"{stops:.6f}",
    }
    return _xmp(" ".join(f'hdrgm:{name}="{value}"' for name, value in attributes.items()), "")


def _container_xmp(length: int) -> bytes:
    items = (("Primary", ""), ("GainMap", f' Item:Length="{length}"'))
    kinds = (f'Item:Semantic="{name}" Item:Mime="image/jpeg"{more}' for name, more in items)
    listed = "".join(f'<rdf:li rdf:parseType="Resource"><Container:Item {kind}/></rdf:li>' for kind in kinds)
    directory = f"<Container:Directory><rdf:Seq>{listed}</rdf:Seq></Container:Directory>"
    return _xmp('hdrgm:Version="1.0"', directory)


def _xmp(attributes: str, inside: str) -> bytes:
    names = " ".join(_NAMES[1:])
    text = (
        f'<x:xmpmeta {_NAMES[0]}><rdf:RDF {_NAMES[1]}><rdf:Description rdf:about="" {names} {attributes}>{inside}'
        "</rdf:Description></rdf:RDF></x:xmpmeta>"
    )
    return text.encode()


def _pictures(primary: int, gain: int, offset: int) -> bytes:
    """Return CIPA DC-007's segment for two pictures: sizes in bytes, and the offset of the second."""
    entry = struct.Struct("<IIIHH")
    head = b"MPF\0" + struct.pack("<2sHIH", b"II", 42, 8, 3)
    fields = struct.pack("<HHI4s", 0xB000, 7, 4, b"0100") + struct.pack("<HHII", 0xB001, 4, 1, 2)
    fields += struct.pack("<HHII", 0xB002, 7, 2 * entry.size, 50) + struct.pack("<I", 0)
    return head + fields + entry.pack(0x030000, primary, 0, 0, 0) + entry.pack(0, gain, offset, 0, 0)

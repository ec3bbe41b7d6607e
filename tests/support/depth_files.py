"""Photos that carry depth, as phones write them: levels in [0, 1] beside display values [H, W, 3]."""

from __future__ import annotations

import base64
import io
import math
import struct

import numpy as np
from PIL import Image
from support.picture_files import eight, png, sixteen

XMP = b"http://ns.adobe.com/xap/1.0/\0"
GUID = b"0123456789ABCDEF0123456789ABCDEF"
INVERSE_Z, DISPARITY, Z, OTHER_DISPARITY = range(4)
"""Representations of depth by H.265."""


def said(properties: dict[str, str], prefix: str, uri: str, *, nested: bool = False) -> bytes:
    """XMP of these properties, as attributes or as elements."""
    inner = "".join(f"<{prefix}:{key}>{value}</{prefix}:{key}>" for key, value in properties.items()) if nested else ""
    own = "" if nested else "".join(f' {prefix}:{key}="{value}"' for key, value in properties.items())
    return (
        '<?xpacket begin="" id="W5M0"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="" xmlns:{prefix}="{uri}"{own}>{inner}</rdf:Description></rdf:RDF></x:xmpmeta>'
        '<?xpacket end="w"?>'
    ).encode()


def with_segments(data: bytes, *contents: bytes) -> bytes:
    """A JPEG with these APP1 segments before its others."""
    made = b"".join(b"\xff\xe1" + struct.pack(">H", len(content) + 2) + content for content in contents)
    return data[:2] + made + data[2:]


def turned(data: bytes, orientation: int) -> bytes:
    """A JPEG with EXIF's orientation."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    return with_segments(data, exif.tobytes())


def jpeg(values: np.ndarray) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(eight(values)).save(stream, "JPEG", quality=100, subsampling=0)
    return stream.getvalue()


def heic_with_depth(base: np.ndarray, levels: np.ndarray, kind: int | None, low: float = 0, high: float = 0) -> bytes:
    """low, high: disparity's; of the others, where the picture's range is nearest and farthest. kind: None: not said.

    Levels [H, W] are written as alpha, whose kind is changed then.
    """
    import pillow_heif

    stream, pixels = io.BytesIO(), eight(np.dstack([base, levels]))
    picture = pillow_heif.from_bytes(mode="RGBA", size=pixels.shape[1::-1], data=pixels.tobytes())
    picture.save(stream, quality=-1, chroma=444)
    data = bytearray(stream.getvalue())
    old, more = b"urn:mpeg:hevc:2015:auxid:1\0", b"" if kind is None else _representation(kind, low, high)
    at = data.index(old)
    for box in (b"meta", b"iprp", b"ipco", b"auxC"):  # around it
        place = data.index(box) - 4
        data[place : place + 4] = struct.pack(">I", struct.unpack_from(">I", data, place)[0] + len(more))
    place = data.index(b"iloc") + 8
    assert (data[place - 4], bytes(data[place : place + 2])) == (0, b"\x44\x40")  # version 0, offsets of 4 bytes
    for k in range(struct.unpack_from(">H", data, place + 2)[0]):
        item = place + 4 + k * 18 + 4
        data[item : item + 4] = struct.pack(">I", struct.unpack_from(">I", data, item)[0] + len(more))
    data[at : at + len(old)] = old.replace(b":1\0", b":2\0") + more
    return bytes(data)


def _representation(kind: int, low: float, high: float) -> bytes:
    """H.265's depth representation information as SEI of an auxC box: G.14.2.6."""

    def golomb(value: int) -> str:
        text = f"{value + 1:b}"
        return "0" * (len(text) - 1) + text

    def number(value: float) -> str:
        fraction, exponent = math.frexp(abs(value))  # [0.5, 1)
        mantissa = round((2 * fraction - 1) * 2**20)
        return f"{int(value < 0)}{exponent - 1 + 31:07b}{20 - 1:05b}{mantissa:020b}"

    of_disparity = kind in (DISPARITY, OTHER_DISPARITY)
    bits = ("0011" if of_disparity else "1100") + golomb(kind) + (golomb(0) if of_disparity else "")
    bits += number(low) + number(high) + ("" if kind != OTHER_DISPARITY else golomb(0) + golomb(0))
    bits += "1" + "0" * (-(len(bits) + 1) % 8)
    content = int(bits, 2).to_bytes(len(bits) // 8, "big")
    unit = b"\x4e\x01\xb1" + bytes((len(content),)) + content + b"\x80"
    return struct.pack(">II", len(unit) + 4, len(unit)) + unit


def apple_portrait(base: np.ndarray, levels: np.ndarray, **properties: str) -> bytes:
    """A JPEG with the depth as its second picture, and in that Apple's XMP."""
    stream = io.BytesIO()
    small = Image.fromarray(eight(levels))
    Image.fromarray(eight(base)).save(stream, "MPO", save_all=True, append_images=[small], quality=100, subsampling=0)
    data = stream.getvalue()
    at = data.rindex(b"\xff\xd8\xff")
    xmp = said(properties, "apdi", "http://ns.apple.com/pixeldatainfo/1.0/", nested=True)
    return data[:at] + with_segments(data[at:], XMP + xmp)


def gdepth_jpeg(base: np.ndarray, levels: np.ndarray, *, parts: int = 0, **properties: str) -> bytes:
    """parts: of extended XMP, last first, that hold the picture; 0: all in one segment."""
    uri = "http://ns.google.com/photos/1.0/depthmap/"
    picture = base64.b64encode(png(sixteen(levels))).decode()
    if not parts:
        return with_segments(jpeg(base), XMP + said({**properties, "Data": picture}, "GDepth", uri))
    whole = said({"Data": picture}, "GDepth", uri)
    size = -(-len(whole) // parts)
    pieces = [
        b"http://ns.adobe.com/xmp/extension/\0" + GUID + struct.pack(">II", len(whole), at) + whole[at : at + size]
        for at in reversed(range(0, len(whole), size))
    ]
    return with_segments(jpeg(base), XMP + said(properties, "GDepth", uri), *pieces)


def dynamic_depth_jpeg(base: np.ndarray, levels: np.ndarray, *, by_semantic: bool = False, **properties: str) -> bytes:
    """Dynamic Depth 1.0: the original photo and the depth map behind the picture; by_semantic: items name their use."""
    original, depth = jpeg(base / 2), jpeg(levels)
    items = ""
    for mime, size, uri, use in (
        ("image/jpeg", 0, "primary_image", "Primary"),
        ("image/jpeg", len(original), "android/original_image", "Original"),
        ("image/jpeg", len(depth), "android/depthmap", "Depth"),
    ):
        name = f'Item:Semantic="{use}"' if by_semantic else f'Item:DataURI="{uri}"'
        items += f'<rdf:li><Container:Item Item:Mime="{mime}" Item:Length="{size}" {name}/></rdf:li>'
    own = "".join(f' DepthMap:{key}="{value}"' for key, value in properties.items())
    uri = "" if by_semantic else ' DepthMap:DepthURI="android/depthmap"'
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        '<rdf:Description xmlns:Item="http://ns.google.com/photos/dd/1.0/item/" '
        'xmlns:Container="http://ns.google.com/photos/dd/1.0/container/" '
        'xmlns:Camera="http://ns.google.com/photos/dd/1.0/camera/" '
        'xmlns:DepthMap="http://ns.google.com/photos/dd/1.0/depthmap/" rdf:about="">'
        f"<Container:Directory><rdf:Seq>{items}</rdf:Seq></Container:Directory>"
        f"<Camera:DepthMap{uri}{own}/></rdf:Description></rdf:RDF></x:xmpmeta>"
    ).encode()
    return with_segments(jpeg(base), XMP + xmp) + original + depth + b"trailing bytes"

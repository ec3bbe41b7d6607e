"""Files made to harm a reader: they are small, or short, and ask for much."""

from __future__ import annotations

import io
import json
import struct

import numpy as np
import OpenEXR
from PIL import Image


def multipart_exr(first: int, second: int, comment: bytes = b"") -> bytes:
    """Two parts of one display window: a square of `first` pixels, and a data window of `second`."""
    window = (np.array([0, 0], np.int32), np.full(2, first - 1, np.int32))
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "displayWindow": window}
    parts = []
    for name, side in (("a", first), ("b", second)):
        channels = {channel: np.ones((side, side), np.float16) for channel in "RGB"}
        parts.append(OpenEXR.Part(dict(header), channels, name))
    stream = io.BytesIO()
    OpenEXR.File(parts).write(stream)
    return stream.getvalue() + comment


def hidden_hdr(height: int, width: int) -> bytes:
    """A black map whose comment claims another size."""
    start = bytes((2, 2, width >> 8, width & 255))
    runs = b"".join(bytes((128 + n, 0)) for n in [127] * (width // 127) + [width % 127] if n)
    header = f"#?RADIANCE\n# -Y 8 +X 16\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    return header.encode() + (start + runs * 4) * height


def endless_tiff(directories: int) -> bytes:
    """A small picture, and after it a chain of directories of one page each."""
    pixels = bytes(64 * 64)
    entries = [(256, 3, 1, 64), (257, 3, 1, 64), (258, 3, 1, 8), (259, 3, 1, 1), (262, 3, 1, 1)]
    entries += [(273, 4, 1, 8), (277, 3, 1, 1), (278, 3, 1, 64), (279, 4, 1, len(pixels))]
    body = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    size = 2 + len(body) + 4
    first = 8 + len(pixels)
    chain = b"".join(
        struct.pack("<H", len(entries)) + body + struct.pack("<I", first + (k + 1) * size if k + 1 < directories else 0)
        for k in range(directories)
    )
    return b"II*\0" + struct.pack("<I", first) + pixels + chain


def endless_gif(frames: int) -> bytes:
    """So many frames of one pixel after a first of 64 x 64."""
    stream = io.BytesIO()
    Image.new("L", (64, 64)).save(stream, format="GIF")
    data = stream.getvalue()[:-1]
    frame = b"!\xf9\x04\0\0\0\0\0" + b",\0\0\0\0\x01\0\x01\0\0" + b"\x02\x02D\x01\0"
    return data + frame * frames + b";"


def endless_jpeg(scans: int, side: int = 64) -> bytes:
    """A progressive JPEG whose last scan comes again and again."""
    stream = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8)
    Image.fromarray(noise).resize((side, side)).save(stream, format="JPEG", progressive=True, quality=30)
    data = stream.getvalue()
    last = data.rindex(b"\xff\xda")
    tables = data.rfind(b"\xff\xc4", 0, last)  # the scan's own Huffman table goes with it
    return data[:-2] + data[tables:-2] * scans + b"\xff\xd9"


def instanced_glb(nodes: int, count: int = 3, uri: str | None = None) -> bytes:
    """One triangle in so many places; count: corners that it claims; uri: where its numbers are said to be."""
    numbers = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    scene = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(nodes))}],
        "nodes": [{"mesh": 0, "translation": [k % 100, k // 100, 0]} for k in range(nodes)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(numbers)}],
        "buffers": [{"byteLength": len(numbers)} | ({} if uri is None else {"uri": uri})],
    }
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(numbers), b"BIN\0") + numbers
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

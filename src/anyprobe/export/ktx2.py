"""KTX 2.0: a cube of half floats with mips. No package at hand writes one.

Khronos' KTX File Format Specification 2.0; its data format descriptor is that of the Khronos Data
Format Specification 1.3.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMAT_R16G16B16A16_SFLOAT = 97
HEADER_BYTES = 80
LEVEL_ALIGNMENT = 8
"""Least common multiple of 4 and the texel's 8 bytes."""


def write_ktx2_cube(path: Path, levels: list[np.ndarray]) -> None:
    """Write mips [6, S, S, 4] float16, the largest first, faces +X -X +Y -Y +Z -Z, row 0 on top."""
    size = levels[0].shape[1]
    descriptor = _descriptor()
    values = _key_values({"KTXorientation": b"rd\0", "KTXwriter": b"anyprobe\0"})
    descriptor_at = HEADER_BYTES + 24 * len(levels)
    values_at = descriptor_at + len(descriptor)
    body = bytearray(descriptor + values)
    index = []
    for level in reversed(levels):  # the smallest lies first, so that a reader can begin with it
        body += b"\0" * (-(descriptor_at + len(body)) % LEVEL_ALIGNMENT)
        data = level.astype("<f2").tobytes()
        index.append(struct.pack("<3Q", descriptor_at + len(body), len(data), len(data)))
        body += data
    header = IDENTIFIER + struct.pack(
        "<9I", VK_FORMAT_R16G16B16A16_SFLOAT, 2, size, size, 0, 0, 6, len(levels), 0
    )
    header += struct.pack("<4I2Q", descriptor_at, len(descriptor), values_at, len(values), 0, 0)
    path.write_bytes(header + b"".join(reversed(index)) + bytes(body))


def _descriptor() -> bytes:
    """Linear Rec. 709 RGBA, four signed 16-bit floats."""
    samples = b"".join(
        struct.pack("<HBB4B2I", 16 * i, 15, 0xC0 | channel, 0, 0, 0, 0, 0xBF800000, 0x3F800000)
        for i, channel in enumerate((0, 1, 2, 15))  # 0xC0: float, signed; the bounds are -1.0 and 1.0
    )
    # model RGBSDA, primaries BT.709, transfer linear, straight alpha; 1 x 1 texels of 8 bytes
    block = struct.pack("<4B4B8B", 1, 1, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0) + samples
    block = struct.pack("<IHH", 0, 2, len(block) + 8) + block
    return struct.pack("<I", len(block) + 4) + block


def _key_values(values: dict[str, bytes]) -> bytes:
    """Pairs in order of their keys, each padded to 4 bytes."""
    out = bytearray()
    for key in sorted(values):
        pair = key.encode() + b"\0" + values[key]
        out += struct.pack("<I", len(pair)) + pair
        out += b"\0" * (-len(out) % 4)
    return bytes(out)

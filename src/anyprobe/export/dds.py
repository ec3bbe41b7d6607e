"""DDS: a cube with mips under Direct3D's DX10 header. No package at hand writes one."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

DXGI_R16G16B16A16_FLOAT = 10
DXGI_BC6H_UF16 = 95

_FLAGS = 0x1 | 0x2 | 0x4 | 0x1000 | 0x20000  # caps, height, width, pixel format, mip count
_PITCH, _LINEAR_SIZE = 0x8, 0x80000
_FOURCC = 0x4
_CAPS = 0x8 | 0x1000 | 0x400000  # complex, texture, mipmap
_CUBE_ALL_FACES = 0xFE00
_TEXTURE_2D, _MISC_CUBE, _OPAQUE = 3, 0x4, 3


def write_dds_cube(path: Path, size: int, levels: list[np.ndarray], dxgi_format: int) -> None:
    """Write mips, the largest first, as every face's whole chain in turn: +X -X +Y -Y +Z -Z.

    Args:
        size: side of the largest face.
        levels: [6, ...] arrays of the format's own numbers: [6, S, S, 4] float16 for
            DXGI_R16G16B16A16_FLOAT, [6, blocks, 16] uint8 for DXGI_BC6H_UF16.
    """
    packed = dxgi_format == DXGI_BC6H_UF16
    pitch = levels[0][0].nbytes if packed else size * 8
    header = struct.pack(
        "<7I44x", 124, _FLAGS | (_LINEAR_SIZE if packed else _PITCH), size, size, pitch, 0, len(levels)
    )
    header += struct.pack("<2I4s20x", 32, _FOURCC, b"DX10")
    header += struct.pack("<5I", _CAPS, _CUBE_ALL_FACES, 0, 0, 0)
    header += struct.pack("<5I", dxgi_format, _TEXTURE_2D, _MISC_CUBE, 1, _OPAQUE)
    faces = [level[face].tobytes() for face in range(6) for level in levels]
    path.write_bytes(b"DDS " + header + b"".join(faces))

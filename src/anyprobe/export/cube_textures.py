"""Cube maps as files: six .hdr faces, one .ktx2, or one .dds.

Faces are +X, -X, +Y, -Y, +Z, -Z and addressed as OpenGL, Direct3D, KTX2 and DDS do: row 0 first in
file, t down, with c the direction of the lookup:

    face     +X   -X   +Y   -Y   +Z   -Z
    2s - 1   -z   +z   +x   +x   +x   -x     each over the face's own |component|
    2t - 1   -y   -y   +z   -z   -y   -y

That layout is left-handed: seen from inside, a face shows the expected picture only if c is our
direction with x negated. three.js, which negates x for every cube it loads, and all programs
that keep left-handed cubes in a right-handed world then show our light as it is.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.export.exported_light import ExportedLight, template
from anyprobe.maps.radiance import HALF_MAX, write_hdr_picture

if TYPE_CHECKING:
    from jaxtyping import Float, Float16, UInt8

FACES = ("px", "nx", "py", "ny", "pz", "nz")

C_FROM_OURS = np.array([-1.0, 1.0, 1.0])
"""c = (-x, y, z)."""

SUPERSAMPLE = 4
"""Samples of the map along each side of a texel; dense enough not to miss an emitter of one pixel."""

SAMPLES_AT_ONCE = 1 << 18
"""Number of samples of the map at once, some 300 bytes each."""


def face_directions(size: int) -> Float[np.ndarray, "6 S S 3"]:
    """Return unit directions c of the texels' centres, [6, S, S, 3]."""
    return np.stack([_directions(face, slice(None), size) for face in range(6)])


def face_size(height: int) -> int:
    """Return the side of the faces for a map of this height: the next power of two, 1024 at most."""
    return min(1024, 1 << max(0, (height - 1).bit_length()))


def cube_faces(radiance: Float[np.ndarray, "H 2*H 3"], size: int) -> Float[np.ndarray, "6 S S 3"]:
    """Resample a map [H, 2H, 3] to six faces [6, S, S, 3] float32, every texel an average over its square."""
    faces = np.empty((6, size, size, 3), np.float32)
    rows = max(1, SAMPLES_AT_ONCE // (SUPERSAMPLE**2 * size))
    for face in range(6):
        for top in range(0, size, rows):
            strip = slice(top * SUPERSAMPLE, (top + rows) * SUPERSAMPLE)
            directions = _directions(face, strip, size * SUPERSAMPLE) * C_FROM_OURS
            values = bilinear(radiance, direction_to_uv(directions))
            squares = values.reshape(-1, SUPERSAMPLE, size, SUPERSAMPLE, 3)
            faces[face, top : top + rows] = squares.mean(axis=(1, 3))
    return faces


def _directions(face: int, rows: slice, size: int) -> np.ndarray:
    """Return face_directions of some rows of one face, [R, S, 3]."""
    a = (np.arange(size) + 0.5) / size * 2 - 1
    s, t = np.meshgrid(a, a[rows])
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    c = np.stack(faces[face], axis=-1)
    return c / np.linalg.norm(c, axis=-1, keepdims=True)


def box_mips(faces: Float[np.ndarray, "6 S S 3"]) -> list[np.ndarray]:
    """Average the faces [6, S, S, 3] down to 1 x 1, level by level; S a power of two."""
    levels = [faces]
    while levels[-1].shape[1] > 1:
        half = levels[-1].shape[1] // 2
        levels.append(levels[-1].reshape(6, half, 2, half, 2, 3).mean(axis=(2, 4)))
    return levels


HALF_LEAST = 2.0**-25
"""Largest magnitude that a half float rounds to 0."""


def clipped_share(faces: Float[np.ndarray, "6 S S 3"], limit: float) -> float:
    """Return the share of the energy of faces [6, S, S, 3], by solid angle, above limit or rounded to 0 by half
    floats."""
    size = faces.shape[1]
    a = (np.arange(size) + 0.5) / size * 2 - 1
    weights = (1 + a[:, None] ** 2 + a**2) ** -1.5
    energy = float((faces * weights[None, :, :, None]).sum())
    beyond = np.maximum(faces - limit, 0) + np.where(faces < HALF_LEAST, faces, 0)
    lost = float((beyond * weights[None, :, :, None]).sum())
    return lost / energy if energy > 0 else 0.0


def to_half_rgba(faces: Float[np.ndarray, "6 S S 3"], limit: float) -> Float16[np.ndarray, "6 S S 4"]:
    """Convert [6, S, S, 3] to [6, S, S, 4] float16, clamped, alpha 1."""
    rgba = np.ones((*faces.shape[:3], 4), np.float16)
    rgba[..., :3] = np.minimum(faces, limit)
    return rgba


IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMAT_R16G16B16A16_SFLOAT = 97
_HEADER_BYTES = 80
LEVEL_ALIGNMENT = 8
"""Alignment of levels [bytes]: least common multiple of 4 and the texel's 8."""


def write_ktx2_cube(path: Path, levels: list[np.ndarray]) -> None:
    """Write mips [6, S, S, 4] float16, the largest first, faces +X -X +Y -Y +Z -Z, row 0 on top."""
    size = levels[0].shape[1]
    descriptor = _descriptor()
    values = _key_values({"KTXorientation": b"rd\0", "KTXwriter": b"anyprobe\0"})
    descriptor_at = _HEADER_BYTES + 24 * len(levels)
    values_at = descriptor_at + len(descriptor)
    body = bytearray(descriptor + values)
    index = []
    for level in reversed(levels):  # the smallest lies first, so that a reader can begin with it
        body += b"\0" * (-(descriptor_at + len(body)) % LEVEL_ALIGNMENT)
        data = level.astype("<f2").tobytes()
        index.append(struct.pack("<3Q", descriptor_at + len(body), len(data), len(data)))
        body += data
    header = IDENTIFIER + struct.pack("<9I", VK_FORMAT_R16G16B16A16_SFLOAT, 2, size, size, 0, 0, 6, len(levels), 0)
    header += struct.pack("<4I2Q", descriptor_at, len(descriptor), values_at, len(values), 0, 0)
    path.write_bytes(header + b"".join(reversed(index)) + bytes(body))


def _descriptor() -> bytes:
    """Return the data format descriptor: linear Rec. 709 RGBA, four signed 16-bit floats."""
    samples = b"".join(
        struct.pack("<HBB4B2I", 16 * i, 15, 0xC0 | channel, 0, 0, 0, 0, 0xBF800000, 0x3F800000)
        for i, channel in enumerate((0, 1, 2, 15))  # 0xC0: float, signed; the bounds are -1.0 and 1.0
    )
    # model RGBSDA, primaries BT.709, transfer linear, straight alpha; 1 x 1 texels of 8 bytes
    block = struct.pack("<4B4B8B", 1, 1, 1, 0, 0, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0) + samples
    block = struct.pack("<IHH", 0, 2, len(block) + 8) + block
    return struct.pack("<I", len(block) + 4) + block


def _key_values(values: dict[str, bytes]) -> bytes:
    """Encode key-value pairs in order of their keys, each padded to 4 bytes."""
    out = bytearray()
    for key in sorted(values):
        pair = key.encode() + b"\0" + values[key]
        out += struct.pack("<I", len(pair)) + pair
        out += b"\0" * (-len(out) % 4)
    return bytes(out)


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


BC6H_MAX = 65504.0
BLOCKS = 1 << 12
"""Blocks encoded at once, some 10 kB each."""

_MODE = 0b00011
WEIGHTS = np.array([0, 4, 9, 13, 17, 21, 26, 30, 34, 38, 43, 47, 51, 55, 60, 64])
"""Weights of the second endpoint in sixty-fourths, from the format's definition."""


def encode_bc6h(faces: Float[np.ndarray, "6 S S 3"]) -> UInt8[np.ndarray, "6 blocks 16"]:
    """Encode faces [6, S, S, 3] >= 0 as blocks [6, ceil(S/4)^2, 16] uint8, row by row.

    A face smaller than a block is repeated to fill it.
    """
    size = faces.shape[1]
    if size % 4:
        repeats = -(-4 // size)
        faces, size = np.tile(faces, (1, repeats, repeats, 1))[:, :4, :4], 4
    side = size // 4
    texels = faces.reshape(6, side, 4, side, 4, 3).transpose(0, 1, 3, 2, 4, 5).reshape(-1, 16, 3)
    parts = [_encode(texels[at : at + BLOCKS]) for at in range(0, len(texels), BLOCKS)]
    return np.concatenate(parts).reshape(6, side * side, 16)


def _encode(texels: np.ndarray) -> np.ndarray:
    """Encode texels [B, 16, 3] as blocks [B, 16] uint8."""
    halves = np.clip(texels, 0.0, BC6H_MAX).astype(np.float16).view(np.uint16).astype(np.float64)
    values = halves * 64.0 / 31.0  # the scale that endpoints are unpacked to
    first, second = _endpoints(values)
    index = _nearest(values, first, second)
    first, second = _refined(values, index, first, second)
    index = _nearest(values, first, second)
    swap = index[:, 0] >= 8  # the first texel's index has three bits
    first[swap], second[swap] = second[swap].copy(), first[swap].copy()
    index[swap] = 15 - index[swap]
    blocks = [_pack(*block) for block in zip(first.tolist(), second.tolist(), index.tolist(), strict=True)]
    return np.frombuffer(b"".join(blocks), np.uint8).reshape(-1, 16)


def unpack_endpoint(code: np.ndarray) -> np.ndarray:
    """Unpack 10-bit codes to 16 bits as the format defines."""
    code = np.asarray(code)
    return np.where(code == 0, 0, np.where(code == 1023, 0xFFFF, ((code << 16) + 0x8000) >> 10))


def _codes(values: np.ndarray) -> np.ndarray:
    """Return the 10-bit codes whose unpacked values lie nearest."""
    return np.clip(np.floor(values / 64.0), 0, 1023).astype(np.int64)


def _endpoints(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the ends of the texels' spread along their main axis: [B, 16, 3] -> codes [B, 3], [B, 3]."""
    mean = values.mean(axis=1, keepdims=True)
    spread = values - mean
    _, axes = np.linalg.eigh(np.einsum("bic,bid->bcd", spread, spread))
    axis = axes[:, :, -1]
    along = np.einsum("bic,bc->bi", spread, axis)
    low, high = along.min(axis=1)[:, None], along.max(axis=1)[:, None]
    return _codes(mean[:, 0] + low * axis), _codes(mean[:, 0] + high * axis)


def _palette(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the 16 colours between two endpoints, [B, 16, 3], as the format mixes them."""
    a, b = unpack_endpoint(first)[:, None], unpack_endpoint(second)[:, None]
    weights = WEIGHTS[None, :, None]
    return (a * (64 - weights) + b * weights + 32) >> 6


def _nearest(values: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the palette index of every texel, [B, 16]."""
    distance = values[:, :, None, :] - _palette(first, second)[:, None]
    return np.argmin((distance**2).sum(axis=-1), axis=-1)


def _refined(
    values: np.ndarray, index: np.ndarray, first: np.ndarray, second: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Fit endpoints to the texels at their palette indices, by least squares."""
    w = WEIGHTS[index] / 64.0
    aa, ab, bb = ((1 - w) ** 2).sum(1), (w * (1 - w)).sum(1), (w**2).sum(1)
    determinant = aa * bb - ab**2
    is_solvable = determinant > 1e-6  # else all texels share an index
    a = np.einsum("bi,bic->bc", 1 - w, values)
    b = np.einsum("bi,bic->bc", w, values)
    scale = np.where(is_solvable, determinant, 1.0)[:, None]
    better_first = _codes((a * bb[:, None] - b * ab[:, None]) / scale)
    better_second = _codes((b * aa[:, None] - a * ab[:, None]) / scale)
    return np.where(is_solvable[:, None], better_first, first), np.where(is_solvable[:, None], better_second, second)


def _pack(first: list[int], second: list[int], index: list[int]) -> bytes:
    """Pack one block: mode, r g b of the first endpoint, of the second, then 3 + 15 x 4 bits of indices."""
    bits, at = _MODE, 5
    for code in (*first, *second):
        bits |= code << at
        at += 10
    for place, width in zip(index, (3, *[4] * 15), strict=True):
        bits |= place << at
        at += width
    return bits.to_bytes(16, "little")


ADDRESSING = {
    "order": "+X -X +Y -Y +Z -Z, row 0 first, as OpenGL, Direct3D, KTX2 and DDS address faces",
    "sample": "(-x, y, z): the direction to ask the cube for, from one in this export's frame; three.js does so",
}


def write_faces(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>_px.hdr ... <name>_nz.hdr, each the picture as seen from inside."""
    faces = cube_faces(light.radiance, face_size(light.radiance.shape[0]))
    for face, pixels in zip(FACES, faces, strict=True):
        write_hdr_picture(folder / f"{light.name}_{face}.hdr", pixels)
    return {"cube": {**ADDRESSING, "size": faces.shape[1], "mips": 1}}


def write_ktx2(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.ktx2, half floats with all mips, and <name>.js, which loads it into three.js as a cube."""
    levels = _levels(light)
    write_ktx2_cube(folder / f"{light.name}.ktx2", [to_half_rgba(level, HALF_MAX) for level in levels])
    (folder / f"{light.name}.js").write_text(template("ktx2.js", light), encoding="utf-8")
    return _cube(levels, clipped_share(levels[0], HALF_MAX))


def write_dds(light: ExportedLight, folder: Path) -> Mapping[str, Any]:
    """Write <name>.dds, half floats, <name>_bc6h.dds, an eighth of its size, and <name>.js for three.js.

    Both have all mips. three.js r187's DDSLoader reads the compressed one only.
    """
    levels = _levels(light)
    halves = [to_half_rgba(level, HALF_MAX) for level in levels]
    write_dds_cube(folder / f"{light.name}.dds", halves[0].shape[1], halves, DXGI_R16G16B16A16_FLOAT)
    blocks = [encode_bc6h(level) for level in levels]
    write_dds_cube(folder / f"{light.name}_bc6h.dds", halves[0].shape[1], blocks, DXGI_BC6H_UF16)
    (folder / f"{light.name}.js").write_text(template("dds.js", light), encoding="utf-8")
    return _cube(levels, clipped_share(levels[0], min(HALF_MAX, BC6H_MAX)))


def _levels(light: ExportedLight) -> list:
    return box_mips(cube_faces(light.radiance, face_size(light.radiance.shape[0])))


def _cube(levels: list, clipped: float) -> dict[str, Any]:
    return {
        "clipped_energy": clipped,
        "cube": {**ADDRESSING, "size": levels[0].shape[1], "mips": len(levels), "filter": "box"},
    }

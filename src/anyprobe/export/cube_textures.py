"""Cube maps as files: six .hdr faces, or one .ktx2.

Faces are +X, -X, +Y, -Y, +Z, -Z and addressed as OpenGL, Direct3D and KTX2 do: row 0 first in
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
from typing import Any

import numpy as np

from anyprobe.core import Float
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.export.exported_light import ExportedLight, share_beyond, template
from anyprobe.maps.radiance import HALF_MAX, write_hdr_picture

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
            values = bilinear(radiance, direction_to_uv(_directions(face, strip, size * SUPERSAMPLE) * C_FROM_OURS))
            faces[face, top : top + rows] = values.reshape(-1, SUPERSAMPLE, size, SUPERSAMPLE, 3).mean(axis=(1, 3))
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


IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
VK_FORMAT_R16G16B16A16_SFLOAT = 97
_HEADER_BYTES = 80
LEVEL_ALIGNMENT = 8
"""Alignment of levels [bytes]: least common multiple of 4 and the texel's 8."""


def write_ktx2_cube(path: Path, levels: list[np.ndarray]) -> None:
    """Write mips [6, S, S, 4] float16, the largest first, faces +X -X +Y -Y +Z -Z, row 0 on top."""
    size = levels[0].shape[1]
    descriptor = _descriptor()
    pairs = b"KTXorientation\0rd\0", b"KTXwriter\0anyprobe\0"  # in order of their keys
    values = b"".join(struct.pack("<I", len(pair)) + pair + b"\0" * (-len(pair) % 4) for pair in pairs)
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


ADDRESSING = {
    "order": "+X -X +Y -Y +Z -Z, row 0 first, as OpenGL, Direct3D and KTX2 address faces",
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
    levels = box_mips(cube_faces(light.radiance, face_size(light.radiance.shape[0])))
    halves = [np.minimum(np.pad(one, [(0, 0)] * 3 + [(0, 1)], constant_values=1), HALF_MAX) for one in levels]
    write_ktx2_cube(folder / f"{light.name}.ktx2", [one.astype(np.float16) for one in halves])
    (folder / f"{light.name}.js").write_text(template("ktx2.js", light), encoding="utf-8")
    return {
        "clipped_energy": share_beyond(light.radiance, HALF_MAX, HALF_LEAST),
        "cube": {**ADDRESSING, "size": levels[0].shape[1], "mips": len(levels), "filter": "box"},
    }

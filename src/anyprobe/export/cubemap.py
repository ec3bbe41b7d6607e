"""Six square faces instead of one map: order, addressing, resampling and mips.

Faces are +X, -X, +Y, -Y, +Z, -Z and addressed as OpenGL, Direct3D, KTX2 and DDS do: row 0 first in
the file, t down, with c the direction that the cube is asked for:

    face     +X   -X   +Y   -Y   +Z   -Z
    2s - 1   -z   +z   +x   +x   +x   -x     each over the face's own |component|
    2t - 1   -y   -y   +z   -z   -y   -y

That layout is left-handed: looked at from inside, every face is the picture that is seen there only
if c is our direction with x turned round. three.js, which does so for every cube it loads, and all
programs that keep left-handed cubes in a right-handed world then show our light as it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv

if TYPE_CHECKING:
    from jaxtyping import Float, Float16

FACES = ("px", "nx", "py", "ny", "pz", "nz")

C_FROM_OURS = np.array([-1.0, 1.0, 1.0])
"""c = (-x, y, z)."""

SUPERSAMPLE = 4
"""Reads of the map along each side of a texel; an emitter of one pixel is then not missed."""

READS = 1 << 18
"""Reads of the map at once, some 300 bytes each."""


def face_directions(size: int) -> Float[np.ndarray, "6 S S 3"]:
    """Unit directions c of the texels' centres, [6, S, S, 3]."""
    return np.stack([_directions(face, slice(None), size) for face in range(6)])


def face_size(height: int) -> int:
    """Side of the faces for a map of so many rows: the power of two from `height` on, 1024 at most."""
    return min(1024, 1 << max(0, (height - 1).bit_length()))


def cube_faces(radiance: Float[np.ndarray, "H 2*H 3"], size: int) -> Float[np.ndarray, "H 2*H 3"]:
    """Our map [H, 2H, 3] on six faces [6, S, S, 3] float32, every texel an average over its square."""
    faces = np.empty((6, size, size, 3), np.float32)
    rows = max(1, READS // (SUPERSAMPLE**2 * size))
    for face in range(6):
        for top in range(0, size, rows):
            strip = slice(top * SUPERSAMPLE, (top + rows) * SUPERSAMPLE)
            fine = _directions(face, strip, size * SUPERSAMPLE) * C_FROM_OURS
            values = bilinear(radiance, direction_to_uv(fine))
            squares = values.reshape(-1, SUPERSAMPLE, size, SUPERSAMPLE, 3)
            faces[face, top : top + rows] = squares.mean(axis=(1, 3))
    return faces


def _directions(face: int, rows: slice, size: int) -> np.ndarray:
    """face_directions of some rows of one face, [R, S, 3]."""
    a = (np.arange(size) + 0.5) / size * 2 - 1
    s, t = np.meshgrid(a, a[rows])
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    c = np.stack(faces[face], axis=-1)
    return c / np.linalg.norm(c, axis=-1, keepdims=True)


def box_mips(faces: Float[np.ndarray, "6 S S 3"]) -> list[np.ndarray]:
    """The faces [6, S, S, 3] and their halves down to 1 x 1; S a power of two."""
    levels = [faces]
    while levels[-1].shape[1] > 1:
        half = levels[-1].shape[1] // 2
        levels.append(levels[-1].reshape(6, half, 2, half, 2, 3).mean(axis=(2, 4)))
    return levels


def clipped_share(faces: Float[np.ndarray, "6 S S 3"], limit: float) -> float:
    """Share of the energy of faces [6, S, S, 3] that lies above limit, weighted by solid angle."""
    size = faces.shape[1]
    a = (np.arange(size) + 0.5) / size * 2 - 1
    weights = (1 + a[:, None] ** 2 + a**2) ** -1.5
    energy = float((faces * weights[None, :, :, None]).sum())
    lost = float((np.maximum(faces - limit, 0) * weights[None, :, :, None]).sum())
    return lost / energy if energy > 0 else 0.0


def to_half_rgba(faces: Float[np.ndarray, "6 S S 3"], limit: float) -> Float16[np.ndarray, "6 S S 4"]:
    """[6, S, S, 3] to [6, S, S, 4] float16, clamped, alpha 1."""
    rgba = np.ones((*faces.shape[:3], 4), np.float16)
    rgba[..., :3] = np.minimum(faces, limit)
    return rgba

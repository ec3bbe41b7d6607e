"""Shadow maps: what a mesh hides of single strong sources, sharper than its voxels tell (render.voxels)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.frames import orthonormal_basis
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import cover
from anyprobe.render.voxels import passed

if TYPE_CHECKING:
    from jaxtyping import Float

SIDE = 256
"""Pixels along the mesh's longest extent."""


def sharp_shares(
    mesh: Mesh, points: Float[np.ndarray, "P 3"], directions: Float[np.ndarray, "D 3"]
) -> Float[np.ndarray, "D P"]:
    """Return how much of distant light from each direction reaches each point, 0 to 1, past the triangles of a mesh.

    Points of its own surface should be a pixel or two off it.
    """
    result = np.empty((len(directions), len(points)), np.float32)
    for share, direction in zip(result, directions, strict=True):
        axes = np.stack([*orthonormal_basis(direction), direction], axis=-1)
        corners, at = mesh.positions @ axes, points @ axes
        low, pixel = corners[:, :2].min(axis=0), np.ptp(corners[:, :2], axis=0).max() / SIDE
        corners[:, :2], at[:, :2] = (1 + (of[:, :2] - low) / pixel for of in (corners, at))
        face, weights, covered = cover(corners[mesh.faces, :2], SIDE + 2)
        nearest = np.full((SIDE + 2) ** 2, -np.inf)
        np.maximum.at(nearest, covered, (weights * corners[mesh.faces[face], 2]).sum(axis=1))
        share[:] = passed(nearest.reshape(SIDE + 2, SIDE + 2), at[:, 1::-1] - 0.5, at[:, 2])
    return result

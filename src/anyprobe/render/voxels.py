"""Shapes as occupied cells: what they hide from a point, by marching through columns.

A shape is 64 x 64 words over x and z of its box, a bit for each of 64 cells along y. A ray passes columns, and in each
the cells between the heights where it enters and leaves are one mask (Amanatides and Woo, "A Fast Voxel Traversal
Algorithm", Eurographics 1987, in two dimensions).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.render.mesh import Mesh

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

SIDE = 64
"""Cells along each side of the box."""
FINENESS = 1.5
"""Points for a cell along a triangle's longest edge."""
LEAST_EXTENT = 1e-3
"""Smallest side of a box, so that a sheet has cells."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Voxels:
    """Occupied cells of a shape.

    words: [z, x] uint64, bit y. low: [3], the corner of the box; cell: [3], sides of a cell, in the shape's frame.
    """

    words: np.ndarray
    low: np.ndarray
    cell: np.ndarray


def voxelize(mesh: Mesh) -> Voxels:
    """Return the cells that a mesh's surface lies in; the box is the mesh's own."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    extent = np.maximum(high - low, LEAST_EXTENT)
    cell = (extent / SIDE).astype(np.float32)
    corners = ((mesh.positions - low) / cell)[mesh.faces].astype(np.float32)  # [F, 3, 3] in cells
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    counts = 2 ** np.ceil(np.log2(np.maximum(edges * FINENESS, 1.0))).astype(int)
    occupied = np.zeros((SIDE, SIDE, SIDE), bool)  # z, x, y
    for count in np.unique(counts):
        i, j = np.nonzero(np.add.outer(np.arange(count + 1), np.arange(count + 1)) <= count)
        weights = np.stack([i, j, count - i - j], axis=1).astype(np.float32) / count
        for some in np.array_split(corners[counts == count], max(1, (counts == count).sum() * len(weights) // 500_000)):
            x, y, z = np.clip(np.einsum("kc,fca->afk", weights, some).astype(int), 0, SIDE - 1)
            occupied[z, x, y] = True
    words = (occupied.astype(np.uint64) << np.arange(SIDE, dtype=np.uint64)).sum(axis=2, dtype=np.uint64)
    return Voxels(words=words, low=low.astype(np.float32), cell=cell)


def blocked(
    voxels: Voxels, origins: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]
) -> Bool[np.ndarray, " N"]:
    """Return whether rays from origins [N, 3] along directions [N, 3] meet an occupied cell, the one they start in
    included; both in the shape's frame."""
    start = (np.asarray(origins, np.float64) - voxels.low) / voxels.cell
    along = np.asarray(directions, np.float64) / voxels.cell
    along = np.where(np.abs(along) < 1e-9, 1e-9, along)
    to_low, to_high = -start / along, (SIDE - start) / along
    near = np.maximum(np.minimum(to_low, to_high).max(axis=1), 0.0)
    far = np.maximum(to_low, to_high).min(axis=1)
    result = np.zeros(len(start), bool)
    rays = np.flatnonzero(near < far)
    t, last, start, along = near[rays], far[rays], start[rays], along[rays]
    step = np.where(along > 0, 1, -1)
    column = np.clip(np.floor(start + t[:, None] * along), 0, SIDE - 1).astype(int)[:, [0, 2]]
    flat_step, flat = step[:, [0, 2]], along[:, [0, 2]]
    border = (column + (flat_step > 0) - start[:, [0, 2]]) / flat
    one, bits = np.uint64(1), np.uint64(SIDE - 1)
    while len(rays):
        axis = border.argmin(axis=1)
        which = np.arange(len(rays))
        leave = np.minimum(border[which, axis], last)
        heights = start[:, 1] + np.stack([t, leave]) * along[:, 1]
        bottom, top = np.clip(np.floor(np.sort(heights, axis=0)), 0, SIDE - 1).astype(np.uint64)
        mask = (~np.uint64(0) >> (bits - top)) & ~((one << bottom) - one)
        hit = (voxels.words[column[:, 1], column[:, 0]] & mask) != 0
        result[rays[hit]] = True
        column[which, axis] += flat_step[which, axis]
        border[which, axis] += np.abs(1.0 / flat[which, axis])
        moved = column[which, axis]
        on = ~hit & (leave < last) & (moved >= 0) & (moved < SIDE)
        rays, t, last, start, along = rays[on], leave[on], last[on], start[on], along[on]
        column, border, flat, flat_step = column[on], border[on], flat[on], flat_step[on]
    return result

"""Light hidden from points by shapes: as occupied cells, ray by ray or for all rays of one direction together; and by
shadow maps, which are sharper, for single strong sources.

A shape is 64 x 64 words over x and z of its box, a bit for each of 64 cells along y. A ray passes columns, and in each
the cells between the heights where it enters and leaves are one mask (Amanatides and Woo, "A Fast Voxel Traversal
Algorithm", Eurographics 1987, in two dimensions). Parallel rays are the columns of the sheared grid, of which only the
occupied cell nearest to the light counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core import Float, Int
from anyprobe.core.frames import orthonormal_basis
from anyprobe.core.sampling import hammersley
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import cover

SIDE = 64
"""Cells along each side of the box."""
MAP_SIDE, BLURRED = 256, 64
"""Pixels of a shadow map along the mesh's longest extent, and places that a blurred one is the mean of."""

FINENESS = 1.5
"""Points for a cell along a triangle's longest edge."""
TRIES = 4
"""Number of faces by which a ray may pass close."""
CLEAR = 1.0
"""Distance in front of a point, in cells, from which a cell hides parallel light: nearer ones are its own surface."""
LEAST_EXTENT = 1e-3
"""Smallest side of a box, so that a sheet has cells."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Voxels:
    """Occupied cells of a shape.

    words: [z, x] uint64, bit y. faces: [z, x, y] int32, one of the faces in each cell, -1 where none is. low: [3], the
    corner of the box; cell: [3], sides of a cell, in the shape's frame.
    """

    words: np.ndarray
    faces: np.ndarray
    low: np.ndarray
    cell: np.ndarray


def voxelize(mesh: Mesh) -> Voxels:
    """Return the cells that a mesh's surface lies in; the box is the mesh's own."""
    low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
    cell = (np.maximum(high - low, LEAST_EXTENT) / SIDE).astype(np.float32)
    corners = ((mesh.positions - low) / cell)[mesh.faces].astype(np.float32)  # [F, 3, 3] in cells
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    counts = 2 ** np.ceil(np.log2(np.maximum(edges * FINENESS, 1.0))).astype(int)
    faces = np.full((SIDE, SIDE, SIDE), -1, np.int32)  # z, x, y
    for count in np.unique(counts):
        i, j = np.nonzero(np.add.outer(np.arange(count + 1), np.arange(count + 1)) <= count)
        weights = np.stack([i, j, count - i - j], axis=1).astype(np.float32) / count
        these = np.flatnonzero(counts == count)
        for some in np.array_split(these, max(1, len(these) * len(weights) // 500_000)):
            x, y, z = np.clip(np.einsum("kc,fca->afk", weights, corners[some]).astype(int), 0, SIDE - 1)
            faces[z, x, y] = some[:, None]
    words = ((faces >= 0).astype(np.uint64) << np.arange(SIDE, dtype=np.uint64)).sum(axis=2, dtype=np.uint64)
    return Voxels(words=words, faces=faces, low=low.astype(np.float32), cell=cell)


def first_faces(
    voxels: Voxels, origins: Float[np.ndarray, "N 3"], directions: Float[np.ndarray, "N 3"]
) -> Int[np.ndarray, " N"]:
    """Return a face in the first occupied cell on rays from origins [N, 3] along directions [N, 3], the cell they start
    in included; -1 where there is none. Both in the shape's frame."""
    start = (np.asarray(origins, np.float64) - voxels.low) / voxels.cell
    along = np.asarray(directions, np.float64) / voxels.cell
    along = np.where(np.abs(along) < 1e-9, 1e-9, along)
    to_low, to_high = -start / along, (SIDE - start) / along
    near = np.maximum(np.minimum(to_low, to_high).max(axis=1), 0.0)
    far = np.maximum(to_low, to_high).min(axis=1)
    result = np.full(len(start), -1)
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
        met = voxels.words[column[:, 1], column[:, 0]] & mask
        hit = met != 0
        lowest, highest = met & (~met + one), met & ~(met >> one)  # the latter's next bit is never set
        height = np.frexp(np.where(along[:, 1] > 0, lowest, highest)[hit].astype(np.float64))[1] - 1
        result[rays[hit]] = voxels.faces[column[hit, 1], column[hit, 0], height]
        column[which, axis] += flat_step[which, axis]
        border[which, axis] += np.abs(1.0 / flat[which, axis])
        moved = column[which, axis]
        on = ~hit & (leave < last) & (moved >= 0) & (moved < SIDE)
        rays, t, last, start, along = rays[on], leave[on], last[on], start[on], along[on]
        column, border, flat, flat_step = column[on], border[on], flat[on], flat_step[on]
    return result


def faces_around(mesh: Mesh) -> Int[np.ndarray, "F K"]:
    """Return the faces that share a corner with each face, itself included; some more than once."""
    corner = mesh.faces.ravel()
    order, count = np.argsort(corner, kind="stable"), np.bincount(corner, minlength=len(mesh.positions))
    first = np.cumsum(count) - count
    turns = np.arange(count.max()) % np.maximum(count, 1)[:, None]
    faces = order.take(first[:, None] + turns, mode="clip") // 3  # of a corner without faces, any
    return faces[mesh.faces].reshape(len(mesh.faces), -1)


def first_hits(
    mesh: Mesh,
    voxels: Voxels,
    around: Int[np.ndarray, "F K"],
    origins: Float[np.ndarray, "N 3"],
    directions: Float[np.ndarray, "N 3"],
) -> tuple[Int[np.ndarray, " N"], Float[np.ndarray, "N 3"]]:
    """Return the face that rays meet, -1 where none, and the weights of its corners there (Moeller and Trumbore 1997).

    first_faces says where to look: of its face and those around. A ray that passes them by goes on, TRIES times.
    """
    corners = mesh.positions[mesh.faces]
    found, weights, rays = np.full(len(origins), -1), np.zeros((len(origins), 3)), np.arange(len(origins))
    for _ in range(TRIES):
        face = first_faces(voxels, origins, directions)
        rays, face, origins, directions = (one[face >= 0] for one in (rays, face, origins, directions))
        near = around[face]
        a, b, c = np.moveaxis(corners[near], 2, 0)
        d, across, up = directions[:, None], b - a, c - a
        side, from_a = np.cross(d, up), origins[:, None] - a
        size = (across * side).sum(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):  # edge-on
            turned = np.cross(from_a, across)
            pairs = ((from_a, side), (d, turned), (up, turned))
            of_b, of_c, way = ((one * of).sum(axis=-1) / size for one, of in pairs)
        share = np.stack([1.0 - of_b - of_c, of_b, of_c], axis=-1)
        way = np.where((share >= 0).all(axis=-1) & (way > 0), way, np.inf)
        best = np.arange(len(rays)), way.argmin(axis=1)
        is_met = np.isfinite(way[best])
        found[rays[is_met]], weights[rays[is_met]] = near[best][is_met], share[best][is_met]
        passed = ((corners[face].mean(axis=1) - origins) * directions).sum(axis=1, keepdims=True) + voxels.cell.max()
        origins = origins + np.maximum(passed, voxels.cell.max()) * directions
        rays, origins, directions = rays[~is_met], origins[~is_met], directions[~is_met]
    return found, weights


def open_shares(
    voxels: Voxels, points: Float[np.ndarray, "P 3"], directions: Float[np.ndarray, "D 3"]
) -> Float[np.ndarray, "D P"]:
    """Return how much of distant light from each direction [D, 3] reaches each point [P, 3], 0 to 1, linear between the
    columns of the sheared grid. Points of the shape's own surface should be a cell or two off it."""
    occupied = voxels.faces >= 0
    at = ((points - voxels.low) / voxels.cell)[:, [2, 0, 1]].astype(np.float32)
    result = np.empty((len(directions), len(points)), np.float32)
    for share, direction in zip(result, directions / voxels.cell, strict=True):
        toward = direction[[2, 0, 1]]
        axis = int(np.abs(toward).argmax())
        across = [k for k in range(3) if k != axis]
        sign = 1 if toward[axis] > 0 else -1
        slope = toward[across] / toward[axis]
        shifts = np.round(-slope * (np.arange(SIDE)[:, None] + 0.5)).astype(int)
        first = shifts.min(axis=0) - 1
        nearest = np.full(np.ptp(shifts, axis=0) + SIDE + 3, -np.inf, np.float32)
        slabs = np.moveaxis(occupied, axis, 0)
        for k in range(SIDE)[::sign]:
            row, column = shifts[k] - first
            np.copyto(nearest[row : row + SIDE, column : column + SIDE], sign * (k + 0.5), where=slabs[k])
        place = at[:, across] - slope.astype(np.float32) * at[:, axis, None] - first - 0.5
        share[:] = passed(nearest, place, sign * at[:, axis] + CLEAR)
    return result


def passed(
    nearest: Float[np.ndarray, "H W"], place: Float[np.ndarray, "P 2"], depth: Float[np.ndarray, " P"]
) -> Float[np.ndarray, " P"]:
    """Return how much light passes what is nearest to it, 0 to 1, linear between the pixels.

    nearest: depth towards the light, -inf where there is nothing, which the border must be. place: row and column.
    """
    most = np.array(nearest.shape) - 1
    place = np.clip(place, 0, most)
    corner = np.minimum(place.astype(int), most - 1)
    (y, x), (row, column) = (place - corner).T, corner.T
    upper, lower = (
        (nearest[r, column] <= depth) * (1 - x) + (nearest[r, column + 1] <= depth) * x for r in (row, row + 1)
    )
    return upper * (1 - y) + lower * y


def sharp_shares(
    mesh: Mesh, points: Float[np.ndarray, "P 3"], directions: Float[np.ndarray, "D 3"], blur: float = 0.0
) -> Float[np.ndarray, "D P"]:
    """Return how much of distant light from each direction reaches each point, 0 to 1, past the triangles of a mesh.

    Points of its own surface should be a pixel or two off it.

    Args:
        blur: standard deviation of where the mesh may be, in its longest extent: the mean over all is returned.
    """
    result = np.empty((len(directions), len(points)), np.float32)
    u = hammersley(BLURRED if blur > 0 else 1)
    radius, angle = blur * MAP_SIDE * np.sqrt(-2.0 * np.log(1.0 - u[:, :1])), 2 * np.pi * u[:, 1:]
    offsets = radius * np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    for share, direction in zip(result, directions, strict=True):
        axes = np.stack([*orthonormal_basis(direction), direction], axis=-1)
        corners, at = mesh.positions @ axes, points @ axes
        low, pixel = corners[:, :2].min(axis=0), np.ptp(corners[:, :2], axis=0).max() / MAP_SIDE
        corners[:, :2], at[:, :2] = (1 + (of[:, :2] - low) / pixel for of in (corners, at))
        face, weights, covered = cover(corners[mesh.faces, :2], MAP_SIDE + 2)
        flat, place = np.full((MAP_SIDE + 2) ** 2, -np.inf), at[:, 1::-1] - 0.5
        np.maximum.at(flat, covered, (weights * corners[mesh.faces[face], 2]).sum(axis=1))
        nearest = flat.reshape(MAP_SIDE + 2, MAP_SIDE + 2)
        share[:] = np.mean([passed(nearest, place + offset, at[:, 2]) for offset in offsets], axis=0)
    return result

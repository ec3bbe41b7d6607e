"""Triangle meshes: triangles with a normal at every corner, inside the unit sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core import Float
from anyprobe.errors import InvalidMesh

CREASE_DEG = 40.0
"""Angle [degrees] above which faces that meet do not share their normals."""

MAX_FACES = 5_000_000

MAX_PAIRS = 1_000_000_000
"""Largest number of pairs of faces at one vertex, summed over the corners; an even mesh has 18 a face."""

PAIRS_AT_ONCE = 4_000_000
"""Pairs in memory together."""

MIN_AREA = 1e-12
"""Smallest doubled area of the largest face in the unit sphere; below it nothing is visible."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Mesh:
    """Triangle mesh: positions [V, 3], faces [F, 3] (counter-clockwise from outside), corner normals [F, 3, 3]."""

    positions: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


def make_mesh(positions: np.ndarray, faces: np.ndarray, name: str = "mesh", crease_deg: float = CREASE_DEG) -> Mesh:
    """Check the triangles, scale them into the unit sphere around the origin, add normals."""
    positions = np.asarray(positions, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    check_triangles(positions, faces, name)
    centre = (positions.max(axis=0) + positions.min(axis=0)) / 2
    radius = np.linalg.norm(positions - centre, axis=1).max()
    if radius == 0:
        raise InvalidMesh("expected an extended shape, got all vertices in one point; export it again", source=name)
    positions = (positions - centre) / radius
    edges = positions[faces[:, 1:]] - positions[faces[:, :1]]
    if np.abs(np.cross(edges[:, 0], edges[:, 1])).max() < MIN_AREA:
        raise InvalidMesh(f"expected faces with an area, got {len(faces):,} without; export it again", source=name)
    shared = np.bincount(faces.reshape(-1)).astype(np.float64)
    if (shared**2).sum() > MAX_PAIRS:
        text = f"expected at most some thousand faces at a vertex, got {shared.max():,.0f}; remesh it first"
        raise InvalidMesh(text, source=name)
    normals = corner_normals(positions, faces, crease_deg)
    return Mesh(positions=positions.astype(np.float32), faces=faces, normals=normals.astype(np.float32))


def put_together(pieces: list[tuple[np.ndarray, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Join pieces, each (positions [V, 3], faces [F, 3]), into one."""
    firsts = np.cumsum([0] + [len(positions) for positions, _ in pieces[:-1]])
    faces = [faces + first for (_, faces), first in zip(pieces, firsts, strict=True)]
    return np.concatenate([positions for positions, _ in pieces]), np.concatenate(faces)


def check_triangles(positions: np.ndarray, faces: np.ndarray, name: str) -> None:
    """Raise InvalidMesh unless there are 1 ... MAX_FACES faces with indices of finite vertices."""
    if len(faces) == 0 or len(positions) == 0:
        raise InvalidMesh("expected triangles, got none; is the file empty?", source=name)
    if len(faces) > MAX_FACES:
        raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {len(faces):,}; decimate it first", source=name)
    low, high = int(faces.min()), int(faces.max())
    if low < 0 or high >= len(positions):
        raise InvalidMesh(
            f"expected faces that name vertices 0 to {len(positions) - 1}, "
            f"got {low if low < 0 else high}; export it again",
            source=name,
        )
    if not (np.abs(positions) <= np.finfo(np.float32).max).all():  # squares of these still fit
        raise InvalidMesh("expected finite vertices, got NaN or infinity; repair the mesh first", source=name)


def corner_normals(
    positions: np.ndarray, faces: np.ndarray, crease_deg: float = CREASE_DEG
) -> Float[np.ndarray, "F 3 3"]:
    """Compute angle-weighted normals [F, 3, 3], averaged over the faces of a vertex within the crease angle."""
    corners = positions[faces]  # [F, 3, 3]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(face_normals, axis=1, keepdims=True)
    face_normals = face_normals / np.maximum(length, 1e-20)  # a sliver has no normal: no 0/0
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    lengths = np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    cosine = (to_next * to_last).sum(axis=2) / np.maximum(lengths, 1e-20)
    angles = np.arccos(np.clip(cosine, -1.0, 1.0)).reshape(-1)

    corner_vertex = faces.reshape(-1)
    corner_face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex, minlength=len(positions))
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # every corner against every corner of the same vertex
    valence = counts[corner_vertex]
    ends = np.cumsum(valence)
    summed = np.empty((len(corner_vertex), 3), dtype=positions.dtype)
    first = 0
    while first < len(corner_vertex):
        before = ends[first] - valence[first]
        last = max(first + 1, int(np.searchsorted(ends, before + PAIRS_AT_ONCE, side="right")))
        some = valence[first:last]
        begins = np.cumsum(some) - some
        one = np.repeat(np.arange(first, last), some)
        within = np.arange(len(one)) - np.repeat(begins, some)
        other = order[starts[corner_vertex[one]] + within]
        alike = (face_normals[corner_face[one]] * face_normals[corner_face[other]]).sum(axis=1)
        weight = np.where(alike >= np.cos(np.radians(crease_deg)), angles[other], 0.0)
        summed[first:last] = np.add.reduceat(face_normals[corner_face[other]] * weight[:, None], begins, axis=0)
        first = last
    norm = np.linalg.norm(summed, axis=1, keepdims=True)
    return np.where(norm > 1e-12, summed / np.maximum(norm, 1e-12), face_normals[corner_face]).reshape(-1, 3, 3)

"""Mesh (noun): triangles with a normal at every corner, inside the unit sphere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.errors import InvalidMesh

CREASE_DEG = 40.0
"""Faces that meet at a sharper angle do not share their normals."""

MAX_FACES = 5_000_000


@dataclass(frozen=True, kw_only=True, slots=True)
class Mesh:
    """positions [V, 3], faces [F, 3] (counter-clockwise from outside), normals [F, 3, 3] at the corners."""

    positions: np.ndarray
    faces: np.ndarray
    normals: np.ndarray


def make_mesh(
    positions: np.ndarray, faces: np.ndarray, name: str = "mesh", crease_deg: float = CREASE_DEG
) -> Mesh:
    """Check the triangles, move them into the unit sphere around the origin, add normals."""
    positions = np.asarray(positions, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    if len(faces) == 0 or len(positions) == 0:
        raise InvalidMesh(f"{name}: expected triangles, got none; is the file empty?")
    if len(faces) > MAX_FACES:
        raise InvalidMesh(
            f"{name}: expected at most {MAX_FACES:,} faces, got {len(faces):,}; decimate it first"
        )
    if not np.isfinite(positions).all():
        raise InvalidMesh(f"{name}: expected finite vertices, got NaN or infinity; repair the mesh first")
    centre = (positions.max(axis=0) + positions.min(axis=0)) / 2
    radius = np.linalg.norm(positions - centre, axis=1).max()
    if radius == 0:
        raise InvalidMesh(f"{name}: expected an extended shape, got all vertices in one point")
    positions = (positions - centre) / radius
    normals = corner_normals(positions, faces, crease_deg)
    return Mesh(positions=positions.astype(np.float32), faces=faces, normals=normals.astype(np.float32))


def corner_normals(positions: np.ndarray, faces: np.ndarray, crease_deg: float = CREASE_DEG) -> np.ndarray:
    """Angle-weighted normals [F, 3, 3], averaged over the faces of a vertex within the crease angle."""
    corners = positions[faces]  # [F, 3, 3]
    face_normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(face_normals, axis=1, keepdims=True)
    face_normals = face_normals / np.maximum(length, 1e-20)  # a sliver has no normal: no 0/0
    to_next = np.roll(corners, -1, axis=1) - corners
    to_last = np.roll(corners, 1, axis=1) - corners
    cosine = (to_next * to_last).sum(axis=2) / np.maximum(
        np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2), 1e-20
    )
    angles = np.arccos(np.clip(cosine, -1.0, 1.0)).reshape(-1)

    corner_vertex = faces.reshape(-1)
    corner_face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(corner_vertex, kind="stable")
    counts = np.bincount(corner_vertex, minlength=len(positions))
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    # every corner against every corner of the same vertex
    valence = counts[corner_vertex]
    one = np.repeat(np.arange(len(corner_vertex)), valence)
    within = np.arange(len(one)) - np.repeat(np.cumsum(valence) - valence, valence)
    other = order[starts[corner_vertex[one]] + within]
    alike = (face_normals[corner_face[one]] * face_normals[corner_face[other]]).sum(axis=1)
    weight = np.where(alike >= np.cos(np.radians(crease_deg)), angles[other], 0.0)
    weighted = face_normals[corner_face[other]] * weight[:, None]
    summed = np.add.reduceat(weighted, np.cumsum(valence) - valence, axis=0)
    norm = np.linalg.norm(summed, axis=1, keepdims=True)
    own = face_normals[corner_face]
    return np.where(norm > 1e-12, summed / np.maximum(norm, 1e-12), own).reshape(-1, 3, 3)

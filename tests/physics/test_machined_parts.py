"""Machined parts: closed, turned outwards, of flat faces that meet at edges."""

import numpy as np
import pytest

from anyprobe.core.frames import world_from_camera
from anyprobe.render.mesh import make_mesh
from anyprobe.render.shapes import CREASE_DEG, extruded, part
from anyprobe.render.surface import frame_object, see


def area_vectors(positions: np.ndarray, faces: np.ndarray) -> np.ndarray:
    a, b, c = (positions[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


def is_closed(faces: np.ndarray) -> bool:
    """Whether every edge is passed once in each direction."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, count = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0)
    return bool((count == 1).all()) and np.array_equal(there, back)


@pytest.mark.parametrize("seed", range(40))
def test_a_piece_is_closed_and_turned_outwards(seed):
    positions, faces = extruded(np.random.default_rng(seed))
    assert is_closed(faces)
    volume = (positions[faces].mean(axis=1) * area_vectors(positions, faces)).sum() / 3
    assert volume > 0.02


def test_a_hole_goes_through():
    """Some pieces are rings: V - E + F is 0 for them and 2 for all others."""
    seen = []
    for seed in range(40):
        positions, faces = extruded(np.random.default_rng(seed))
        ring = len(positions) - len(faces) * 3 / 2 + len(faces) == 0
        seen.append(ring)
        if ring:  # nothing of it is near the axis
            assert np.hypot(positions[:, 0], positions[:, 2]).min() > 0.005
    assert 0.2 < np.mean(seen) < 0.6


def test_lids_are_flat_but_where_a_rounding_begins():
    flat = []
    for seed in range(20):
        positions, faces = extruded(np.random.default_rng(seed))
        mesh = make_mesh(positions, faces, crease_deg=CREASE_DEG)
        lid = np.ptp(positions[faces][..., 1], axis=1) < 1e-9
        along = np.abs(mesh.normals[lid][..., 1])
        assert lid.any()
        assert along.min() > 0.9
        flat.append(along.min() > 0.999)
    assert np.mean(flat) > 0.4


@pytest.mark.ci
def test_parts_show_flat_faces_as_nothing_else_of_ours_does():
    """Most of what a part shows are pixels whose right neighbours have the same normal."""
    flat = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        mesh = part(rng)
        surface = see(mesh, frame_object(mesh, world_from_camera(rng.uniform(0, 6.28), 0.5), 20.0, size=64))
        normals = np.zeros((64, 64, 3))
        normals[surface.mask] = surface.normals
        both = surface.mask[:, 1:] & surface.mask[:, :-1]
        flat.append(((normals[:, 1:] * normals[:, :-1]).sum(axis=-1)[both] > 0.99999).mean())
    assert np.median(flat) > 0.5
    assert min(flat) < 0.9


def test_a_part_is_its_seed_and_lies_in_the_unit_sphere():
    one, again, other = (part(np.random.default_rng(seed)) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.positions, again.positions)
    assert one.positions.shape != other.positions.shape or (one.positions != other.positions).any()
    assert np.linalg.norm(one.positions, axis=1).max() <= 1 + 1e-6

"""The project's own shapes: closed, outward, in the unit sphere; the polyhedra convex."""

from functools import lru_cache

import numpy as np
import pytest

from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe_train.dataset.random_shapes import blob, lathe, rounded_polyhedron, superquadric

FAMILIES = [superquadric, blob, lathe, rounded_polyhedron]
SEEDS = range(8)


@lru_cache
def draw(family, seed: int) -> Mesh:
    return family(np.random.default_rng(seed), rows=32)


def geometry(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Unit face normals [F, 3] and areas [F] from the positions alone."""
    corners = mesh.positions.astype(np.float64)[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-30)[:, None], length / 2


@pytest.mark.parametrize("family", FAMILIES)
def test_every_edge_joins_two_faces(family):
    """Each directed edge once, and its reverse once: closed, and turned the same way all over."""
    for seed in SEEDS:
        faces = draw(family, seed).faces
        edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
        key = edges[:, 0] * (faces.max() + 1) + edges[:, 1]
        back = edges[:, 1] * (faces.max() + 1) + edges[:, 0]
        assert len(np.unique(key)) == len(key)
        np.testing.assert_array_equal(np.sort(key), np.sort(back))


@pytest.mark.parametrize("family", FAMILIES)
def test_faces_look_outwards(family):
    """The volume by the divergence theorem is positive, and no more than the unit sphere's."""
    for seed in SEEDS:
        mesh = draw(family, seed)
        normals, areas = geometry(mesh)
        centres = mesh.positions[mesh.faces].mean(axis=1)
        volume = ((centres * normals).sum(axis=1) * areas).sum() / 3
        assert 0.01 < volume < 4 * np.pi / 3


@pytest.mark.parametrize("family", FAMILIES)
def test_fills_the_unit_sphere_and_no_more(family):
    for seed in SEEDS:
        mesh = draw(family, seed)
        np.testing.assert_allclose(np.linalg.norm(mesh.positions, axis=1).max(), 1.0, atol=1e-6)
        middle = (mesh.positions.max(axis=0) + mesh.positions.min(axis=0)) / 2
        np.testing.assert_allclose(middle, 0.0, atol=1e-6)


@pytest.mark.parametrize("family", FAMILIES)
def test_seed_decides(family):
    one, same, other = draw(family, 4), draw.__wrapped__(family, 4), draw(family, 5)
    np.testing.assert_array_equal(one.positions, same.positions)
    np.testing.assert_array_equal(one.normals, same.normals)
    assert not np.array_equal(one.positions, other.positions)


def test_sphere_is_round():
    mesh = sphere(rows=48)
    np.testing.assert_allclose(np.linalg.norm(mesh.positions[:-2], axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(mesh.normals, mesh.positions[mesh.faces], atol=0.01)


def test_polyhedron_is_convex():
    """No vertex lies outside the tangent plane of any other: at its point, across its normal."""
    for seed in SEEDS:
        mesh = draw(rounded_polyhedron, seed)
        points = mesh.positions.astype(np.float64)
        normals = np.empty_like(points)
        normals[mesh.faces.reshape(-1)] = mesh.normals.reshape(-1, 3)
        reach = normals @ points.T  # [V, V]: how far each point lies along each normal
        assert (reach - np.diag(reach)[:, None]).max() < 1e-6

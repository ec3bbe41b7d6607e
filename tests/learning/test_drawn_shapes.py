"""Shapes that are only learned from: figures of closed pieces, machined parts of flat faces, all families drawn."""

import numpy as np
import pytest

from anyprobe.core.frames import world_from_camera
from anyprobe.render.mesh import Mesh
from anyprobe.render.surface import frame_object, see
from anyprobe_train.dataset.drawn_shapes import draw_shape, figure, part
from anyprobe_train.dataset.random_shapes import blob, lathe, rounded_polyhedron, superquadric

FAMILIES = [superquadric, blob, lathe, rounded_polyhedron]


def geometry(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Unit face normals [F, 3] and areas [F] from the positions alone."""
    corners = mesh.positions.astype(np.float64)[mesh.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, 1e-30)[:, None], length / 2


@pytest.mark.ci
def test_every_family_is_drawn():
    """Told apart by their vertex counts: rows differ from family to family, but for blobs and spheres."""
    rng = np.random.default_rng(0)
    counts = {len(family(rng).positions) for family in FAMILIES}
    assert len(counts) == len(FAMILIES)
    assert {len(draw_shape(rng).positions) for _ in range(24)} == counts


def piece_of(mesh: Mesh) -> np.ndarray:
    """The number of each face's connected piece, in the order of the vertices."""
    label = np.arange(len(mesh.positions))
    while True:
        least = label[mesh.faces].min(axis=1)
        spread = label.copy()
        np.minimum.at(spread, mesh.faces, least[:, None])
        spread = spread[spread]
        if np.array_equal(spread, label):
            return np.unique(label[mesh.faces[:, 0]], return_inverse=True)[1]
        label = spread


@pytest.mark.ci
def test_figures_are_closed_pieces_turned_outwards():
    """Each piece has a positive volume, mirrored ones too; about half of the figures have all but the body twice."""
    twice = 0
    for seed in range(12):
        mesh = figure(np.random.default_rng(seed))
        edges = np.sort(np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]))
        assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
        normals, areas = geometry(mesh)
        centres = mesh.positions[mesh.faces].mean(axis=1)
        volumes = np.bincount(piece_of(mesh), (centres * normals).sum(axis=1) * areas / 3)
        assert len(volumes) >= 3
        assert (volumes > 0).all()
        one, other = volumes[1::2], volumes[2::2]
        twice += len(one) == len(other) and np.allclose(one, other, rtol=1e-3)
    assert 3 <= twice <= 9


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

"""Voxels: the face that a ray meets first, and how much parallel light passes."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.render.shapes import sphere
from anyprobe.render.voxels import faces_around, first_faces, first_hits, open_shares, voxelize

BALL = sphere(48)
VOXELS = voxelize(BALL)
CELL = float(VOXELS.cell.max())


@pytest.fixture
def outside(rng) -> np.ndarray:
    """Points about the unit sphere, at least three cells off it."""
    points = rng.normal(size=(2000, 3))
    radius = 1 + 3 * CELL + rng.uniform(0, 1, (2000, 1))
    return points / np.linalg.norm(points, axis=1, keepdims=True) * radius


def test_rays_meet_the_sphere_where_it_is(outside, rng):
    toward = -outside + 0.9 * rng.normal(size=outside.shape)
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    along = (outside * toward).sum(axis=1)
    inside = 1 - (outside**2).sum(axis=1) + along**2  # the square of half the chord
    clear = np.abs(inside) > 6 * CELL
    faces = first_faces(VOXELS, outside, toward)
    np.testing.assert_array_equal(faces[clear] >= 0, ((inside > 0) & (along < 0))[clear])
    hit = clear & (faces >= 0)
    met = outside[hit] + (-along[hit] - np.sqrt(inside[hit]))[:, None] * toward[hit]
    centres = BALL.positions[BALL.faces[faces[hit]]].mean(axis=1)
    assert np.linalg.norm(met - centres, axis=1).max() < 6 * CELL  # on the near side


def test_hits_are_points_of_the_mesh_itself(outside, rng):
    toward = -outside + 0.6 * rng.normal(size=outside.shape)
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    along = (outside * toward).sum(axis=1)
    inside = 1 - (outside**2).sum(axis=1) + along**2
    faces, weights = first_hits(BALL, VOXELS, faces_around(BALL), outside, toward)
    sag = 0.02  # of 48 segments, twice
    clear = np.abs(inside) > sag
    is_met = (inside > 0) & (along < 0)
    assert (faces[clear & is_met] >= 0).mean() > 0.995  # a few that graze slip between
    assert (faces[clear & ~is_met] < 0).all()  # of cells, .03 wide, some are met
    hit = clear & (faces >= 0)
    assert hit.sum() > 500
    np.testing.assert_allclose(weights[hit].sum(axis=1), 1, atol=1e-9)
    at = (BALL.positions[BALL.faces[faces[hit]]] * weights[hit, :, None]).sum(axis=1)
    off = at - outside[hit]
    assert np.abs(np.cross(off, toward[hit])).max() < 1e-5  # on the ray
    met = outside[hit] + (-along[hit] - np.sqrt(inside[hit]))[:, None] * toward[hit]
    assert np.median(np.linalg.norm(at - met, axis=1)) < 0.005


@pytest.mark.parametrize("direction", [(0.3, 1, 0.2), (-1, 0.2, 0.4), (0.1, -0.2, -1), (0, 0, 1)])
def test_parallel_light_is_hidden_where_single_rays_are(outside, direction):
    toward = np.asarray(direction) / np.linalg.norm(direction)
    share = open_shares(VOXELS, outside, toward[None])[0]
    hidden = first_faces(VOXELS, outside, np.broadcast_to(toward, outside.shape)) >= 0
    assert ((share < 0.5) == hidden).mean() > 0.98
    assert 0 <= share.min() <= share.max() <= 1
    away = np.linalg.norm(outside - (outside @ toward)[:, None] * toward, axis=1)
    np.testing.assert_array_equal(share[away > 1 + 3 * CELL], 1)


def test_a_convex_body_hides_nothing_from_its_own_lit_side():
    n = BALL.normals[:, 0]
    at = BALL.positions[BALL.faces[:, 0]] + 1.5 * CELL * n
    for direction in np.eye(3):
        lit = n @ direction > 0.05
        assert open_shares(VOXELS, at[lit], direction[None]).mean() > 0.995
        assert open_shares(VOXELS, at[n @ direction < -0.3], direction[None]).mean() < 0.01

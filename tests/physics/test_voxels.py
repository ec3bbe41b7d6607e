"""Voxels: the face that a ray meets first, and how much parallel light passes."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.render.shapes import sphere
from anyprobe.render.voxels import first_faces, open_shares, voxelize

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

"""Vectors and rotations: signs and handedness."""

import numpy as np
import pytest

from anyprobe.core.frames import (
    dot,
    normalize,
    orthonormal_basis,
    reflect,
    rotation_x,
    rotation_y,
    rotation_z,
    turn_towards,
    world_from_camera,
    world_from_local,
)

X, Y, Z = np.eye(3)


def unit(count, seed=0):
    return normalize(np.random.default_rng(seed).normal(size=(count, 3)))


def test_zero_vector_gives_nan():
    assert np.isfinite(normalize(np.zeros((2, 3)))).all()
    np.testing.assert_allclose(np.linalg.norm(unit(20), axis=1), 1, atol=1e-12)


def test_reflect_points_into_the_surface():
    """Both vectors point away: v and its mirror image share the cosine with n, and lie in one plane."""
    v, n = unit(100, 3), unit(100, 4)
    r = reflect(v, n)
    np.testing.assert_allclose(dot(r, n), dot(v, n), atol=1e-12)
    np.testing.assert_allclose(r + v, 2 * dot(v, n) * n, atol=1e-12)
    np.testing.assert_allclose(reflect(np.array([1.0, 1.0, 0.0]), Y), [-1, 1, 0])


@pytest.mark.parametrize("n", [Z, -Z, X, Y, np.array([0.6, 0.8, 0.0]), np.array([0.6, 0.8, -0.0])])
def test_basis_breaks_at_special_normals(n):
    t, b = orthonormal_basis(n)
    np.testing.assert_allclose(np.stack([t, b, n]) @ np.stack([t, b, n]).T, np.eye(3), atol=1e-12)


def test_basis_is_left_handed():
    n = np.concatenate([unit(200), normalize(np.array([[1e-4, 2e-4, -1.0]]))])
    t, b = orthonormal_basis(n)
    np.testing.assert_allclose(np.cross(t, b), n, atol=1e-12)


def test_local_z_is_not_the_normal():
    n, v = unit(100, 5), unit(100, 6)
    np.testing.assert_allclose(world_from_local(np.broadcast_to(Z, (100, 3)), n), n, atol=1e-12)
    np.testing.assert_allclose(dot(world_from_local(v, n), n)[:, 0], v[:, 2], atol=1e-12)


def test_rotation_turns_the_other_way():
    """The senses that the docstrings promise."""
    np.testing.assert_allclose(rotation_x(np.pi / 2) @ -Z, Y, atol=1e-12)
    np.testing.assert_allclose(rotation_y(np.pi / 2) @ -Z, -X, atol=1e-12)
    np.testing.assert_allclose(rotation_z(np.pi / 2) @ X, Y, atol=1e-12)


def test_raised_camera_looks_up():
    """It stands where yaw and elevation say, and its axis passes through the origin."""
    np.testing.assert_allclose(world_from_camera(0.0, 0.0), np.eye(3), atol=1e-12)
    rotation = world_from_camera(0.4, 0.7)
    position = rotation @ Z
    np.testing.assert_allclose(position, [np.cos(0.7) * np.sin(0.4), np.sin(0.7), np.cos(0.7) * np.cos(0.4)])
    assert (rotation @ -Z)[1] < 0
    assert abs((rotation @ X)[1]) < 1e-12  # no roll: the picture's x axis stays level


def test_turn_towards_misses_or_rolls():
    """-Z lands on the target, and no rotation that does it is smaller."""
    for target in [*unit(30, 7), X, Y, -Y, -Z]:
        rotation = turn_towards(target)
        np.testing.assert_allclose(rotation @ -Z, target, atol=1e-9)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-9)
        assert np.linalg.det(rotation) > 0
        np.testing.assert_allclose((np.trace(rotation) - 1) / 2, -Z @ target, atol=1e-9)


def test_turn_to_straight_behind_gives_nan():
    rotation = turn_towards(Z)
    np.testing.assert_allclose(rotation @ -Z, Z, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(rotation), 1)


def test_torch_frames_differ():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    n, v = unit(50, 8), unit(50, 9)
    got = world_from_local(torch.asarray(v), torch.asarray(n)).numpy()
    np.testing.assert_allclose(got, world_from_local(v, n), atol=1e-12)
    np.testing.assert_allclose(reflect(torch.asarray(v), torch.asarray(n)).numpy(), reflect(v, n), atol=1e-12)

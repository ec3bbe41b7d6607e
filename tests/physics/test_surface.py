"""Which pixels see a mesh, and from which side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anyprobe.core.frames import world_from_camera
from anyprobe.render.mesh import make_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import Camera, frame_object, see

CARD = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
HALVES = np.array([(0, 1, 2), (0, 2, 3)])


def from_all_sides(mesh, size=48):
    for yaw in (0.3, 1.9, 3.4, 5.1):
        yield see(mesh, frame_object(mesh, world_from_camera(yaw, 0.4), 25.0, size=size))


def test_mesh_wound_inwards_looks_like_the_same_wound_outwards():
    unit_sphere = sphere(48)
    inward = replace(unit_sphere, faces=unit_sphere.faces[:, ::-1], normals=-unit_sphere.normals[:, ::-1])
    for out, turned in zip(from_all_sides(unit_sphere), from_all_sides(inward), strict=True):
        np.testing.assert_array_equal(turned.mask, out.mask)
        np.testing.assert_allclose(turned.normals, out.normals, atol=1e-6)


def test_card_has_two_sides():
    """Its normal is along its own axis, towards the eye, from behind as from before."""
    card = make_mesh(CARD, HALVES)
    for yaw in (0.0, 0.8, np.pi, 2.5):
        turned = world_from_camera(yaw, 0.2)
        surface = see(card, frame_object(card, turned, 20.0, size=32))
        along = surface.normals @ (np.array([0.0, 0.0, 1.0]) @ turned).astype(np.float32)
        assert np.abs(along).min() > 0.95  # the camera is turned a little to the object's middle
        assert (surface.normals * surface.wo).sum(axis=1).min() > 0.3


def test_open_bowl_shows_its_inside():
    """Seen into, half a sphere has normals towards its middle: n = -x, from the eye's side."""
    unit_sphere = sphere(64)
    below = (unit_sphere.positions[unit_sphere.faces][:, :, 1] <= 1e-6).all(axis=1)
    bowl = replace(unit_sphere, faces=unit_sphere.faces[below], normals=unit_sphere.normals[below])
    surface = see(bowl, frame_object(bowl, world_from_camera(0.0, 1.2), 10.0, size=64))
    middle = surface.normals[np.nonzero(surface.mask.reshape(-1))[0] == 32 * 64 + 32]
    up = np.array([0.0, 1.0, 0.0]) @ world_from_camera(0.0, 1.2)
    assert (middle @ up).min() > 0.9
    assert (surface.normals * surface.wo).sum(axis=1).mean() > 0.6


@pytest.mark.parametrize("size", [63, 127])
@pytest.mark.parametrize("rows", [16, 24, 48])
def test_sphere_straight_ahead_has_no_holes(rows, size):
    """With an odd number of pixels its edges run exactly through their centres."""
    camera = Camera(world_from_camera=np.eye(3), position=np.array([0.0, 0.0, 5.0]), tan_half=0.25, size=size)
    for row in see(sphere(rows), camera).mask:
        (columns,) = np.nonzero(row)
        assert len(columns) == 0 or columns[-1] - columns[0] == len(columns) - 1

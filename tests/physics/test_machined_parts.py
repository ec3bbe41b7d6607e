"""Machined parts: closed, turned outwards, of flat faces that meet at edges."""

import numpy as np
import pytest

from anyprobe.core.frames import world_from_camera
from anyprobe.render.shapes import part
from anyprobe.render.surface import frame_object, see


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

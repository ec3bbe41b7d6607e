"""Meshes of all formats are read alike, and those that would cost too much are refused before they do."""

from __future__ import annotations

import struct

import numpy as np
import pytest
import trimesh
from support.mesh_files import glb, obj, off, ply, stl

from anyprobe.core.frames import world_from_camera
from anyprobe.errors import InvalidMesh
from anyprobe.files import objects
from anyprobe.files.objects import read_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object, see

SPHERE = sphere(rows=6)
CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
CUBE_FACES = np.array(
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)]
    + [(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
)
WRITERS = {
    "ascii.ply": ply,
    "binary.ply": lambda p, f: ply(p, f, binary=True),
    "a.obj": obj,
    "a.glb": glb,
    "a.stl": stl,
    "a.off": off,
}


def refusal(path, data: bytes | None = None) -> str:
    """The one line that a mesh file is refused with."""
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(InvalidMesh) as caught:
        read_mesh(path)
    message = str(caught.value)
    assert path.name in message
    assert "\n" not in message
    assert len(message) < 300, message
    return message


# Meshes that are fine


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_triangles(tmp_path, name):
    """Moved and scaled into the unit sphere about the origin, face by face."""
    size = np.array([3.0, 1.0, 2.0])
    positions = CUBE * size + [10.0, -20.0, 5.0]
    (tmp_path / name).write_bytes(WRITERS[name](positions, CUBE_FACES))
    mesh = read_mesh(tmp_path / name)
    expected = (CUBE - 0.5) * size / (np.linalg.norm(size) / 2)
    np.testing.assert_allclose(mesh.positions[mesh.faces], expected[CUBE_FACES], atol=1e-6)
    outward = np.sign(CUBE - 0.5)[CUBE_FACES]  # a corner's normal is one of the three its vertex has
    assert (np.abs(mesh.normals).max(axis=2) > 0.999).all()
    assert ((mesh.normals * outward).sum(axis=2) > 0.999).all()


@pytest.mark.parametrize("name", ["ascii.ply", "a.stl"])
def test_repeated_vertices_stay_smooth(tmp_path, name):
    """A sphere whose faces share no vertex has the normals of one whose faces do."""
    corners = SPHERE.positions[SPHERE.faces].reshape(-1, 3)
    (tmp_path / name).write_bytes(WRITERS[name](corners, np.arange(len(corners)).reshape(-1, 3)))
    mesh = read_mesh(tmp_path / name)
    round_ones = np.linalg.norm(mesh.positions[mesh.faces], axis=2) > 0.999
    along = (mesh.normals * mesh.positions[mesh.faces]).sum(axis=2)
    assert round_ones.mean() > 0.8
    assert along[round_ones].min() > 0.97


@pytest.mark.parametrize("kind", ["open", "three faces at one edge", "both sides", "two pieces"])
def test_mesh_need_be_neither_closed_nor_manifold(tmp_path, kind):
    """Triangles are rasterised: whatever has an area can be seen."""
    faces = {
        "open": CUBE_FACES[:-3],
        "three faces at one edge": np.array([(0, 1, 2), (0, 1, 4), (0, 1, 7)]),
        "both sides": np.concatenate([CUBE_FACES, CUBE_FACES[:, ::-1]]),
        "two pieces": CUBE_FACES[[0, 2]],
    }[kind]
    (tmp_path / "a.ply").write_bytes(ply(CUBE, faces))
    mesh = read_mesh(tmp_path / "a.ply")
    assert len(mesh.faces) == len(faces)
    assert np.isfinite(mesh.normals).all()
    surface = see(mesh, frame_object(mesh, world_from_camera(0.6, 0.4), 20.0, size=32))
    assert surface.mask.mean() > 0.05
    assert np.isfinite(surface.normals).all()


@pytest.mark.parametrize("name", ["ascii.ply", "a.glb"])
def test_stray_vertex_does_not_make_the_shape_small(tmp_path, name):
    (tmp_path / name).write_bytes(WRITERS[name](np.concatenate([CUBE, [[900.0, 0.0, 0.0]]]), CUBE_FACES))
    mesh = read_mesh(tmp_path / name)
    np.testing.assert_allclose(np.linalg.norm(mesh.positions, axis=1), 1.0, atol=1e-6)


# Meshes that are not


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.ply", ply(CUBE, CUBE_FACES, announced=5_000_001)),
        ("b.ply", ply(CUBE, CUBE_FACES, announced=5_000_001, binary=True)),
        ("a.off", b"OFF\n# made by hand\n8 5000001 0\n"),
        ("a.stl", bytes(80) + struct.pack("<I", 5_000_001)),
    ],
)
def test_too_many_faces_are_refused_by_their_count(tmp_path, monkeypatch, name, data):
    """The parser, which would take memory for them, is never called."""

    def parse(*_, **__):
        pytest.fail("parsed")

    monkeypatch.setattr(trimesh, "load_scene", parse)
    message = refusal(tmp_path / name, data)
    assert "5,000,000" in message
    assert "5,000,001" in message


def test_small_file_that_places_its_mesh_many_times(tmp_path, monkeypatch):
    """Copies count before they are made."""
    (tmp_path / "few.glb").write_bytes(glb(CUBE, CUBE_FACES, copies=3))
    mesh = read_mesh(tmp_path / "few.glb")
    copies = mesh.positions[mesh.faces].reshape(3, 12, 3, 3)
    first, second, third = copies[np.argsort(copies[:, 0, 0, 0])]
    beside = np.array([3.0, 0.0, 0.0]) / np.linalg.norm([3.5, 0.5, 0.5])  # the row is 7 x 1 x 1
    np.testing.assert_allclose(second - first, beside + 0 * first, atol=1e-6)
    np.testing.assert_allclose(third - second, beside + 0 * first, atol=1e-6)

    def dump(*_, **__):
        pytest.fail("copied")

    monkeypatch.setattr(trimesh.Scene, "dump", dump)
    monkeypatch.setattr(objects, "MAX_FACES", 1000)
    assert "got 1,200" in refusal(tmp_path / "many.glb", glb(CUBE, CUBE_FACES, copies=100))


def test_hub_of_very_many_faces(tmp_path):
    """Normals compare all faces at a vertex with one another: a fan of 40,000 would take minutes."""

    def fan(count):
        angle = np.arange(count) * 2 * np.pi / count
        rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        k = np.arange(count)
        faces = np.stack([0 * k, 1 + k, 1 + (k + 1) % count], axis=-1)
        return ply(np.concatenate([[[0.0, 0.0, 0.3]], rim]), faces, binary=True)

    assert "40,000" in refusal(tmp_path / "fan.ply", fan(40_000))
    (tmp_path / "cone.ply").write_bytes(fan(500))
    assert len(read_mesh(tmp_path / "cone.ply").faces) == 500

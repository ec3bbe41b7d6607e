"""Virtual objects by name, made here, or from a mesh file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.meshes import read_mesh
from anyprobe.render.mesh import Mesh, make_mesh
from anyprobe.render.shapes import blob, lathe, rounded_polyhedron, sphere, superquadric

BASE = 0.08
"""Of the vase's height: what its rounded foot is cut off at, so that it stands."""


def _vase() -> Mesh:
    mesh = lathe(np.random.default_rng(0), rows=72)
    positions = mesh.positions.copy()
    low, high = positions[:, 1].min(), positions[:, 1].max()
    positions[:, 1] = np.maximum(positions[:, 1], low + BASE * (high - low))
    return make_mesh(positions, mesh.faces, "vase")


OBJECTS: dict[str, Callable[[], Mesh]] = {
    "sphere": lambda: sphere(48),
    "vase": _vase,
    "pebble": lambda: blob(np.random.default_rng(7), rows=56),
    "block": lambda: superquadric(np.random.default_rng(2), rows=56),
    "solid": lambda: rounded_polyhedron(np.random.default_rng(4), rows=64),
}


OLD_NAMES = {"ball": "sphere"}
"""Names that older scripts use."""


def open_object(name: str) -> Mesh:
    """One of OBJECTS, or a mesh file; +Y is up. InputError or InvalidMesh lists them."""
    name = OLD_NAMES.get(name, name)
    if name in OBJECTS:
        return OBJECTS[name]()
    if not Path(name).suffix:
        raise InputError(
            f"object: expected one of {', '.join(OBJECTS)} or a mesh file (.glb, .obj, .ply), got {name!r}"
        )
    return read_mesh(name)

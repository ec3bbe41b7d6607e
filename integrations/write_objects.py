"""Write the objects to insert, four members of the families of random shapes, into the package.

python integrations/write_objects.py
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.render.mesh import Mesh, make_mesh
from anyprobe_train.dataset.random_shapes import blob, lathe, rounded_polyhedron, superquadric

BASE = 0.08
"""Height at which the vase's rounded foot is cut off so that it stands, as a share of the vase's height."""


def _vase() -> Mesh:
    mesh = lathe(np.random.default_rng(0), rows=72)
    positions = mesh.positions.copy()
    low, high = positions[:, 1].min(), positions[:, 1].max()
    positions[:, 1] = np.maximum(positions[:, 1], low + BASE * (high - low))
    return make_mesh(positions, mesh.faces, "vase")


def write_objects(path: Path) -> None:
    """Write the objects of files.objects: by name positions [V, 3], faces [F, 3], and the normals at vertices of the
    one whose edges are rounder than its grid shows."""
    solid = rounded_polyhedron(np.random.default_rng(4), rows=64)
    meshes = {
        "vase": _vase(),
        "pebble": blob(np.random.default_rng(7), rows=56),
        "block": superquadric(np.random.default_rng(2), rows=56),
        "solid": solid,
    }
    arrays: dict[str, Any] = {name: mesh.positions for name, mesh in meshes.items()}
    arrays |= {f"{name} faces": mesh.faces.astype(np.uint16) for name, mesh in meshes.items()}
    normals = np.empty_like(solid.positions)
    normals[solid.faces] = solid.normals
    arrays["solid normals"] = normals
    np.savez_compressed(path, **arrays)


if __name__ == "__main__":
    write_objects(Path(__file__).parents[1] / "src" / "anyprobe" / "files" / "objects.npz")

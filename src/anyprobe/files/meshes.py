"""Read a mesh file; trimesh knows the formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.errors import InvalidMesh
from anyprobe.render.mesh import Mesh, make_mesh

SUFFIXES = (".ply", ".obj", ".glb", ".stl", ".off")


def read_mesh(path: str | Path) -> Mesh:
    """A PLY, OBJ, GLB, STL or OFF file as one Mesh in the unit sphere."""
    import trimesh

    path = Path(path)
    if not path.is_file():
        raise InvalidMesh(f"{path}: expected a mesh file, found none; check the path")
    if path.suffix.lower() not in SUFFIXES:
        raise InvalidMesh(f"{path}: expected {', '.join(SUFFIXES)}, got {path.suffix or 'no suffix'}")
    try:
        scene = trimesh.load_scene(path, process=False)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
    except Exception as error:  # trimesh raises whatever its parsers raise
        raise InvalidMesh(
            f"{path.name}: not readable as {path.suffix[1:].upper()} ({error}); export it again"
        ) from error
    if not parts:
        raise InvalidMesh(f"{path.name}: expected triangles, got none; is the file empty?")
    offsets = np.cumsum([0] + [len(part.vertices) for part in parts])
    positions = np.concatenate([np.asarray(part.vertices) for part in parts])
    faces = np.concatenate([np.asarray(p.faces) + o for p, o in zip(parts, offsets[:-1], strict=True)])
    # files that repeat a vertex for every face would come out faceted
    positions, index = np.unique(np.asarray(positions, dtype=np.float32), axis=0, return_inverse=True)
    return make_mesh(positions, index.reshape(-1)[faces], name=path.name)

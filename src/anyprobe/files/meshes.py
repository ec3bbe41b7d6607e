"""Read a mesh file; trimesh knows the formats, and what it lets pass is found here.

Triangles are only rasterised: a mesh may be open, non-manifold or of many pieces.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from anyprobe.errors import InvalidMesh
from anyprobe.render.mesh import MAX_FACES, Mesh, check_triangles, make_mesh

SUFFIXES = (".ply", ".obj", ".glb", ".stl", ".off")

HEADER_BYTES = 1 << 16
"""The counts of faces lie within these."""

_PLY_FACES = re.compile(rb"^element\s+face\s+(\d+)", re.MULTILINE)
_OBJ_ZERO = re.compile(rb"^f[^\n]*[ \t]0+(?=[/\s])", re.MULTILINE)


def read_mesh(path: str | Path) -> Mesh:
    """A PLY, OBJ, GLB, STL or OFF file as one Mesh in the unit sphere.

    Raises:
        InvalidMesh: the file is absent, damaged, cut, too large or holds no triangles to see.
    """
    path = Path(path)
    if not path.is_file():
        found = "a folder" if path.is_dir() else "none"
        raise InvalidMesh(f"{path}: expected a mesh file, found {found}; check the path")
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InvalidMesh(
            f"{path.name}: expected a mesh in {', '.join(SUFFIXES)}, got {suffix or 'no suffix'}; export it again"
        )
    announced = _check_header(path, suffix)
    parts = _read_parts(path, suffix)
    if not parts:
        raise InvalidMesh(f"{path.name}: expected triangles, got none; is the file empty?")
    offsets = np.cumsum([0] + [len(positions) for positions, _ in parts])
    positions = np.concatenate([positions for positions, _ in parts])
    faces = np.concatenate([faces + offset for (_, faces), offset in zip(parts, offsets[:-1], strict=True)])
    if announced is not None and len(faces) < announced:
        raise InvalidMesh(
            f"{path.name}: expected {announced:,} faces as its header says, got {len(faces):,}; "
            "is the file cut? fetch or export it again"
        )
    check_triangles(positions, faces, path.name)
    used = np.zeros(len(positions), dtype=bool)
    used[faces] = True  # a stray vertex would make the object a dot
    # files that repeat a vertex for every face would come out faceted
    kept, index = np.unique(positions[used], axis=0, return_inverse=True)
    place = np.zeros(len(positions), dtype=np.int64)
    place[used] = index.reshape(-1)
    return make_mesh(kept, place[faces], name=path.name)


def _check_header(path: Path, suffix: str) -> int | None:
    """Refuse by its first bytes what is empty, cut or far too large; the faces they announce, if any."""
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            start = stream.read(HEADER_BYTES)
    except OSError as error:
        raise InvalidMesh(f"{path}: cannot be read ({error.strerror}); check the permissions") from error
    if size == 0:
        raise InvalidMesh(f"{path.name}: expected a mesh, got an empty file (0 bytes); fetch it again")
    faces, whole = None, 0
    if suffix == ".ply":
        found = _PLY_FACES.search(start.partition(b"end_header")[0])
        faces = int(found[1]) if found else None
    elif suffix == ".off":
        words = re.sub(rb"#[^\n]*", b"", start[:4096]).split()[:3]
        faces = int(words[2]) if len(words) == 3 and words[2].isdigit() else None
    elif suffix == ".glb" and start[:4] == b"glTF":
        whole = int.from_bytes(start[8:12], "little")
    elif suffix == ".stl" and start[:5].lower() != b"solid" and size >= 84:
        faces = int.from_bytes(start[80:84], "little")
        whole = 84 + 50 * faces
    if faces is not None and faces > MAX_FACES:
        raise InvalidMesh(
            f"{path.name}: expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first"
        )
    if size < whole:
        raise InvalidMesh(
            f"{path.name}: expected {whole:,} bytes as its header says, got {size:,}; "
            "the file is cut: fetch or export it again"
        )
    return faces


def _read_parts(path: Path, suffix: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vertices [V, 3] float64 and faces [F, 3] of every part, moved to its place in the scene."""
    import trimesh

    try:
        if suffix == ".obj" and _OBJ_ZERO.search(path.read_bytes()):
            raise ValueError("a face names vertex 0, the first is 1")  # trimesh would take the last
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about numbers that check_triangles looks at
            scene = trimesh.load_scene(path, process=False)
            copies = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
            faces = sum(len(one.faces) for one in copies if isinstance(one, trimesh.Trimesh))
            if faces > MAX_FACES:  # a small file may place a mesh many times
                raise InvalidMesh(
                    f"{path.name}: expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first"
                )
            parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh)]
            return [
                (np.asarray(part.vertices, dtype=np.float64), np.asarray(part.faces, dtype=np.int64))
                for part in parts
                if len(part.faces)
            ]
    except InvalidMesh:
        raise
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InvalidMesh(
            f"{path.name}: expected a readable {suffix[1:].upper()} file, got {reason}; export it again"
        ) from error

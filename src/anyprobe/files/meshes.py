"""Read a mesh file; trimesh knows the formats, and what it lets pass is found here.

Triangles are only rasterised: a mesh may be open, non-manifold or of many pieces.
"""

from __future__ import annotations

import io
import json
import re
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InvalidMesh
from anyprobe.files.paths import read_regular
from anyprobe.render.mesh import MAX_FACES, Mesh, check_triangles, make_mesh, put_together

MESH_SUFFIXES = (".ply", ".obj", ".glb", ".stl", ".off")

MAX_PARTS = 20_000
"""Nodes, meshes and the like of a scene."""

_HEADER_BYTES = 1 << 16
"""The counts of faces lie within these."""

_PLY_FACES = re.compile(rb"^element\s+face\s+(\d{1,18})", re.MULTILINE)
_OBJ_ZERO = re.compile(rb"^f[^\n]*[ \t]0+(?=[/\s]|\Z)", re.MULTILINE)
_OBJ_RELATIVE = re.compile(rb"^f[^\n]*[\s/]-\d", re.MULTILINE)


def read_mesh(path: str | Path) -> Mesh:
    """Read a PLY, OBJ, GLB, STL or OFF file as one Mesh in the unit sphere.

    Raises:
        InvalidMesh: the file is absent, damaged, cut, too large or holds no triangles to see.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES and not path.is_dir():
        raise InvalidMesh(
            f"expected a mesh in {', '.join(MESH_SUFFIXES)}, got {suffix or 'no suffix'}; export it again",
            source=path.name,
        )
    data = read_regular(path, path.name, InvalidMesh, "a mesh file")
    announced = _check_header(data, suffix, path.name)
    parts = _read_parts(data, suffix, path.name)
    if not parts:
        raise InvalidMesh("expected triangles, got none; is the file empty?", source=path.name)
    positions, faces = put_together(parts)
    if announced is not None and len(faces) < announced:
        raise InvalidMesh(
            f"expected {announced:,} faces as its header says, got {len(faces):,}; "
            "is the file cut? fetch or export it again",
            source=path.name,
        )
    check_triangles(positions, faces, path.name)
    used = np.zeros(len(positions), dtype=bool)
    used[faces] = True  # a stray vertex would make the object a dot
    # files that repeat a vertex for every face would come out faceted
    kept, index = np.unique(positions[used], axis=0, return_inverse=True)
    place = np.zeros(len(positions), dtype=np.int64)
    place[used] = index.reshape(-1)
    return make_mesh(kept, place[faces], name=path.name)


def _check_header(data: bytes, suffix: str, name: str) -> int | None:
    """Refuse by its first bytes what is empty, cut or far too large; the faces they announce, if any."""
    size, start = len(data), data[:_HEADER_BYTES]
    if size == 0:
        raise InvalidMesh("expected a mesh, got an empty file (0 bytes); fetch it again", source=name)
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
        raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first", source=name)
    if size < whole:
        raise InvalidMesh(
            f"expected {whole:,} bytes as its header says, got {size:,}; the file is cut: fetch or export it again",
            source=name,
        )
    return faces


def _read_parts(data: bytes, suffix: str, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vertices [V, 3] float64 and faces [F, 3] of every part, moved to its place in the scene."""
    import trimesh

    try:
        if suffix == ".obj" and _OBJ_ZERO.search(data):
            raise ValueError("a face names vertex 0, the first is 1")  # trimesh would take the last
        if suffix == ".obj" and _OBJ_RELATIVE.search(data):
            data = _counted_from_one(data)
        if suffix == ".glb":
            _check_glb(data)
        # of bytes alone it opens no file that they name; floats that overflow are check_triangles' to refuse
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False, skip_materials=True)
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
        copies = [(matrix, scene.geometry[key]) for matrix, key in placed]
        copies = [(matrix, one) for matrix, one in copies if isinstance(one, trimesh.Trimesh) and len(one.faces)]
        faces = sum(len(one.faces) for _, one in copies)
        if faces > MAX_FACES:  # a small file may place a mesh many times
            raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first", source=name)
        return [_placed(matrix, one.vertices, one.faces) for matrix, one in copies]
    except InvalidMesh:
        raise
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        if suffix == ".ply" and "unexpected length" in reason:
            raise InvalidMesh(
                "expected polygons of one kind in a binary PLY, got several, or a cut file; export triangles",
                source=name,
            ) from error
        raise InvalidMesh(
            f"expected a readable {suffix[1:].upper()} file, got {reason}; export it again", source=name
        ) from error


def _counted_from_one(data: bytes) -> bytes:
    """Return an OBJ whose faces count back from the vertices before them, as -1, with numbers from its beginning:
    trimesh counts back from its end."""
    counts, lines = {b"v": 0, b"vt": 0, b"vn": 0}, []
    for line in data.replace(b"\\\n", b" ").split(b"\n"):
        words = line.split()
        if words and words[0] in counts:
            counts[words[0]] += 1
        elif words and words[0] == b"f":
            corners = (zip(word.split(b"/"), counts.values(), strict=False) for word in words[1:])
            line = b"f " + b" ".join(
                b"/".join(b"%d" % (int(n) + so_far + 1) if n.startswith(b"-") else n for n, so_far in corner)
                for corner in corners
            )
        lines.append(line)
    return b"\n".join(lines)


def _placed(matrix: np.ndarray, positions: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices [V, 3] under a matrix [4, 4], and faces [F, 3], turned over where the matrix mirrors."""
    positions, faces = np.asarray(positions, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise ValueError(f"vertices of {positions.shape[-1]} numbers")
    if np.array_equal(matrix, np.eye(4)):
        return positions, faces
    with np.errstate(all="ignore"):
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        return positions @ matrix[:3, :3].T + matrix[:3, 3], faces[:, ::-1] if mirrored else faces


def _check_glb(data: bytes) -> None:
    """ValueError for a scene that takes long to put together, or that claims more numbers than its bytes can hold."""
    length = int.from_bytes(data[12:16], "little")
    scene = json.loads(data[20 : 20 + length])
    packed = sorted({"KHR_draco_mesh_compression", "EXT_meshopt_compression"} & {*scene.get("extensionsRequired", ())})
    if packed:
        raise ValueError(f"geometry packed by {packed[0]}, which is not read")
    for part in ("nodes", "meshes", "accessors", "bufferViews"):
        if len(scene.get(part, ())) > MAX_PARTS:
            raise ValueError(f"more than {MAX_PARTS:,} {part}")
    if sum(len(mesh["primitives"]) for mesh in scene.get("meshes", ())) > MAX_PARTS:
        raise ValueError(f"more than {MAX_PARTS:,} primitives")
    if any(not str(one.get("uri", "data:")).startswith("data:") for one in scene.get("buffers", ())):
        raise ValueError("buffers in other files")
    claimed = sum(int(one["count"]) for one in scene.get("accessors", ()))
    if not 0 <= claimed <= len(data):  # each takes a byte at least
        raise ValueError("more numbers than bytes")


def glb_file(document: Mapping[str, Any], body: bytes) -> bytes:
    """Header, JSON chunk padded with spaces, binary chunk of a length that 4 divides: glTF 2.0 specification, 4.4."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks

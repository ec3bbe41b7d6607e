"""Read a mesh file; trimesh knows the formats, and what it lets pass is found here. Make a GLB of a glTF.

Triangles are only rasterised: a mesh may be open, non-manifold or of many pieces.

Of a glTF with its buffers beside it the nodes with their transforms, the positions and the indices are kept; normals,
texture coordinates, materials, pictures and animations are not, so that the file needs no other. glTF 2.0
specification, sections 3.6 (buffers, accessors) and 4.4 (GLB layout).
"""

from __future__ import annotations

import base64
import io
import json
import re
import struct
import urllib.parse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InvalidMesh
from anyprobe.files.paths import read_regular
from anyprobe.render.mesh import MAX_FACES, Mesh, check_triangles, make_mesh, put_together

SUFFIXES = (".ply", ".obj", ".glb", ".stl", ".off")

MAX_PARTS = 20_000
"""Nodes, meshes and the like of a scene."""

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
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES and not path.is_dir():
        raise InvalidMesh(
            f"{path.name}: expected a mesh in {', '.join(SUFFIXES)}, got {suffix or 'no suffix'}; export it again"
        )
    data = read_regular(path, path.name, InvalidMesh, "a mesh file")
    announced = _check_header(data, suffix, path.name)
    parts = _read_parts(data, suffix, path.name)
    if not parts:
        raise InvalidMesh(f"{path.name}: expected triangles, got none; is the file empty?")
    positions, faces = put_together(parts)
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


def _check_header(data: bytes, suffix: str, name: str) -> int | None:
    """Refuse by its first bytes what is empty, cut or far too large; the faces they announce, if any."""
    size, start = len(data), data[:HEADER_BYTES]
    if size == 0:
        raise InvalidMesh(f"{name}: expected a mesh, got an empty file (0 bytes); fetch it again")
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
        raise InvalidMesh(f"{name}: expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first")
    if size < whole:
        raise InvalidMesh(
            f"{name}: expected {whole:,} bytes as its header says, got {size:,}; "
            "the file is cut: fetch or export it again"
        )
    return faces


def _read_parts(data: bytes, suffix: str, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Vertices [V, 3] float64 and faces [F, 3] of every part, moved to its place in the scene."""
    import trimesh

    try:
        if suffix == ".obj" and _OBJ_ZERO.search(data):
            raise ValueError("a face names vertex 0, the first is 1")  # trimesh would take the last
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
            raise InvalidMesh(f"{name}: expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first")
        return [_placed(matrix, one.vertices, one.faces) for matrix, one in copies]
    except InvalidMesh:
        raise
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InvalidMesh(
            f"{name}: expected a readable {suffix[1:].upper()} file, got {reason}; export it again"
        ) from error


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


HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_")
"""Required extensions that say nothing about triangles."""

NODE_KEYS = ("name", "children", "mesh", "matrix", "translation", "rotation", "scale")
DATA_URI = "data:"


def read_gltf(path: Path, name: str) -> dict:
    """A .gltf document whose triangles can be packed.

    Raises:
        InvalidMesh: not glTF 2, compressed, or more than MAX_FACES triangles.
    """
    try:
        document = json.loads(path.read_bytes())
        version = document["asset"]["version"]
        required = document.get("extensionsRequired", [])
        faces = _count_faces(document)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InvalidMesh(f"{name}: not readable as glTF ({error!r})") from error
    if not str(version).startswith("2."):
        raise InvalidMesh(f"{name}: expected glTF 2, got version {version}")
    strange = [one for one in required if not str(one).startswith(HARMLESS)]
    if strange:
        raise InvalidMesh(f"{name}: expected plain glTF, got one that needs {', '.join(map(str, strange))}")
    if faces > MAX_FACES:
        raise InvalidMesh(f"{name}: expected at most {MAX_FACES:,} faces, got {faces:,}")
    return document


def buffer_paths(document: dict) -> list[str]:
    """The files beside the .gltf that hold its numbers, as paths relative to it."""
    uris = [buffer.get("uri", "") for buffer in document.get("buffers", [])]
    return [urllib.parse.unquote(uri) for uri in uris if not uri.startswith(DATA_URI)]


def pack_glb(document: dict, buffers: Mapping[str, bytes], name: str) -> bytes:
    """One GLB from a document of read_gltf and the buffers that buffer_paths names.

    Raises:
        InvalidMesh: the document asks for bytes that are not there.
    """
    try:
        return _pack(document, buffers)
    except (ValueError, LookupError, TypeError, AttributeError) as error:
        raise InvalidMesh(f"{name}: its glTF and its buffers do not fit together ({error!r})") from error


def _pack(document: dict, buffers: Mapping[str, bytes]) -> bytes:
    body = bytearray()
    views: dict[int, int] = {}
    accessors: dict[int, int] = {}
    new_views, new_accessors, new_meshes = [], [], []

    def keep_view(old: int) -> int:
        if old not in views:
            view = document["bufferViews"][old]
            data = _buffer(document["buffers"][view["buffer"]], buffers)
            start, length = view.get("byteOffset", 0), view["byteLength"]
            if not 0 <= start <= start + length <= len(data):
                raise ValueError(f"bufferView {old} ends at byte {start + length} of {len(data)}")
            body.extend(bytes(-len(body) % 4))
            kept = {"buffer": 0, "byteOffset": len(body), "byteLength": length}
            views[old] = len(new_views)
            new_views.append(kept | {key: view[key] for key in ("byteStride",) if key in view})
            body.extend(data[start : start + length])
        return views[old]

    def keep_accessor(old: int) -> int:
        if old not in accessors:
            accessor = document["accessors"][old]
            if "sparse" in accessor:
                raise ValueError(f"accessor {old} is sparse")
            view = keep_view(accessor["bufferView"])
            accessors[old] = len(new_accessors)
            new_accessors.append(accessor | {"bufferView": view})
        return accessors[old]

    for mesh in document.get("meshes", []):
        primitives = []
        for old in mesh["primitives"]:
            kept = {"attributes": {"POSITION": keep_accessor(old["attributes"]["POSITION"])}}
            if "indices" in old:
                kept["indices"] = keep_accessor(old["indices"])
            primitives.append(kept | {key: old[key] for key in ("mode",) if key in old})
        new_meshes.append({"primitives": primitives})
    body.extend(bytes(-len(body) % 4))
    packed = {
        "asset": {"version": "2.0", "generator": "anyprobe"},
        "scene": document.get("scene", 0),
        "scenes": [{"nodes": scene.get("nodes", [])} for scene in document["scenes"]],
        "nodes": [{key: node[key] for key in NODE_KEYS if key in node} for node in document["nodes"]],
        "meshes": new_meshes,
        "accessors": new_accessors,
        "bufferViews": new_views,
        "buffers": [{"byteLength": len(body)}],
    }
    return glb_file(packed, bytes(body))


def glb_file(document: Mapping[str, Any], body: bytes) -> bytes:
    """Header, JSON chunk padded with spaces, binary chunk of a length that 4 divides."""
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


def _buffer(buffer: dict, buffers: Mapping[str, bytes]) -> bytes:
    uri = buffer["uri"]
    if uri.startswith(DATA_URI):
        return base64.b64decode(uri.partition(",")[2])
    return buffers[urllib.parse.unquote(uri)]


def _count_faces(document: dict) -> int:
    """Triangles of all nodes; a mesh that two nodes share counts twice."""
    counts = []
    for mesh in document.get("meshes", []):
        corners = [
            document["accessors"][one.get("indices", one["attributes"]["POSITION"])]["count"]
            for one in mesh["primitives"]
        ]
        counts.append(sum(corners) // 3)
    return sum(counts[node["mesh"]] for node in document.get("nodes", []) if "mesh" in node)

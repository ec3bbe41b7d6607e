"""Virtual objects: built-in ones by name, or mesh files. trimesh parses these; faults that it lets pass are found here.

Triangles are only rasterised: a mesh may be open, non-manifold or in pieces.
"""

import io
import json
import re
import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, InvalidMesh
from anyprobe.files.paths import read_regular
from anyprobe.render.mesh import MAX_FACES, Mesh, check_triangles, make_mesh, put_together
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import Material, material_named

MESH_SUFFIXES = (".ply", ".obj", ".glb", ".stl", ".off")

MAX_PARTS = 20_000
"""Largest number of nodes, of meshes and the like in a scene."""

_HEADER_BYTES = 1 << 16
"""Number of bytes within which a header declares its faces."""

_PLY_FACES = re.compile(rb"^element\s+face\s+(\d{1,18})", re.MULTILINE)
_OBJ_ZERO = re.compile(rb"^f[^\n]*[ \t]0+(?=[/\s]|\Z)", re.MULTILINE)
_OBJ_RELATIVE = re.compile(rb"^f[^\n]*[\s/]-\d", re.MULTILINE)


def read_mesh(path: str | Path) -> Mesh:
    """Read a PLY, OBJ, GLB, STL or OFF file as one Mesh in the unit sphere.

    Raises:
        InvalidMesh: the file is absent, damaged, truncated, too large or holds no triangles.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in MESH_SUFFIXES and not path.is_dir():
        text = f"expected a mesh in {', '.join(MESH_SUFFIXES)}, got {suffix or 'no suffix'}; export it again"
        raise InvalidMesh(text, source=path.name)
    data = read_regular(path, path.name, InvalidMesh, "a mesh file")
    declared = _check_header(data, suffix, path.name)
    if not (parts := _read_parts(data, suffix, path.name)):
        raise InvalidMesh("expected triangles, got none; check the file", source=path.name)
    positions, faces = put_together(parts)
    if declared is not None and len(faces) < declared:
        text = f"expected {declared:,} faces as its header says, got {len(faces):,}; the file may be truncated"
        raise InvalidMesh(f"{text}: copy or export it again", source=path.name)
    check_triangles(positions, faces, path.name)
    used = np.zeros(len(positions), dtype=bool)
    used[faces] = True  # drop stray vertices, which would make the object a dot
    # merge equal vertices: files that repeat them for every face would look faceted
    kept, index = np.unique(positions[used], axis=0, return_inverse=True)
    renumbered = np.zeros(len(positions), dtype=np.int64)
    renumbered[used] = index.reshape(-1)
    return make_mesh(kept, renumbered[faces], name=path.name)


def _check_header(data: bytes, suffix: str, name: str) -> int | None:
    """Refuse an empty, truncated or far too large file; return the number of faces its header declares, or None."""
    size, start = len(data), data[:_HEADER_BYTES]
    if size == 0:
        raise InvalidMesh("expected a mesh, got an empty file (0 bytes); copy it again", source=name)
    faces, full_size = None, 0
    if suffix == ".ply":
        found = _PLY_FACES.search(start.partition(b"end_header")[0])
        faces = int(found[1]) if found else None
    elif suffix == ".off":
        words = re.sub(rb"#[^\n]*", b"", start[:4096]).split()[:3]
        faces = int(words[2]) if len(words) == 3 and words[2].isdigit() else None
    elif suffix == ".glb" and start[:4] == b"glTF":
        version, full_size = (int.from_bytes(start[at : at + 4], "little") for at in (4, 8))
        if version != 2:
            raise InvalidMesh(f"expected glTF 2, got version {version}; export it again as glTF 2", source=name)
    elif suffix == ".stl" and start[:5].lower() != b"solid" and size >= 84:
        faces = int.from_bytes(start[80:84], "little")
        full_size = 84 + 50 * faces
    if faces is not None and faces > MAX_FACES:
        raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first", source=name)
    if size < full_size:
        text = f"expected {full_size:,} bytes as its header says, got {size:,}; the file is truncated: copy it again"
        raise InvalidMesh(text, source=name)
    return faces


def _read_parts(data: bytes, suffix: str, name: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return vertices [V, 3] float64 and faces [F, 3] of every part, transformed into the scene."""
    import trimesh

    try:
        if suffix == ".obj" and _OBJ_ZERO.search(data):
            raise ValueError("a face names vertex 0, the first is 1")  # trimesh would read it as the last
        if suffix == ".obj" and _OBJ_RELATIVE.search(data):
            data = _counted_from_one(data)
        if suffix == ".glb":
            _check_glb(data)
        # from bytes, trimesh opens no files that they name; check_triangles refuses floats that overflow
        with np.errstate(all="ignore"):
            scene = trimesh.load_scene(io.BytesIO(data), file_type=suffix[1:], process=False, skip_materials=True)
        placed = [scene.graph[node] for node in scene.graph.nodes_geometry]
        copies = [(matrix, scene.geometry[key]) for matrix, key in placed]
        copies = [(matrix, part) for matrix, part in copies if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        faces = sum(len(part.faces) for _, part in copies)
        if faces > MAX_FACES:  # a small file may place a mesh many times
            raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {faces:,}; decimate it first", source=name)
        return [_placed(matrix, part.vertices, part.faces) for matrix, part in copies]
    except InvalidMesh:
        raise
    except Exception as error:  # trimesh raises whatever its parsers raise
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        text = f"expected a readable {suffix[1:].upper()} file, got {reason}; export it again"
        if suffix == ".ply" and "unexpected length" in reason:
            text = "expected polygons of one kind in a binary PLY, got several, or a truncated file; export triangles"
        raise InvalidMesh(text, source=name) from error


def _counted_from_one(data: bytes) -> bytes:
    """Replace an OBJ's relative vertex numbers, such as -1, by absolute ones: trimesh counts them from the file's
    end instead of from the face."""
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
    """Transform vertices [V, 3] by a matrix [4, 4]; flip the faces [F, 3] where it mirrors."""
    positions, faces = np.asarray(positions, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    if positions.ndim != 2 or positions.shape[1] != 3:
        raise ValueError(f"vertices of {positions.shape[-1]} coordinates")
    if np.array_equal(matrix, np.eye(4)):
        return positions, faces
    with np.errstate(all="ignore"):
        mirrored = np.linalg.det(matrix[:3, :3]) < 0
        return positions @ matrix[:3, :3].T + matrix[:3, 3], faces[:, ::-1] if mirrored else faces


def _check_glb(data: bytes) -> None:
    """Raise ValueError for a scene that takes long to assemble, or declares more numbers than its bytes can hold."""
    scene = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    packed = sorted({"KHR_draco_mesh_compression", "EXT_meshopt_compression"} & {*scene.get("extensionsRequired", ())})
    if packed:
        raise ValueError(f"geometry compressed by {packed[0]}, which is not supported")
    for part in ("nodes", "meshes", "accessors", "bufferViews"):
        if len(scene.get(part, ())) > MAX_PARTS:
            raise ValueError(f"more than {MAX_PARTS:,} {part}")
    if sum(len(mesh["primitives"]) for mesh in scene.get("meshes", ())) > MAX_PARTS:
        raise ValueError(f"more than {MAX_PARTS:,} primitives")
    if any(not str(buffer.get("uri", "data:")).startswith("data:") for buffer in scene.get("buffers", ())):
        raise ValueError("buffers in other files")
    declared = sum(int(accessor["count"]) for accessor in scene.get("accessors", ()))
    if not 0 <= declared <= len(data):  # each takes at least a byte
        raise ValueError("more numbers than bytes")


def glb_file(document: Mapping[str, Any], body: bytes) -> bytes:
    """Build a .glb: header, JSON chunk padded with spaces, binary chunk (glTF 2.0 specification, 4.4).

    body: its length is a multiple of 4.
    """
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    return struct.pack("<4s2I", b"glTF", 2, 12 + len(chunks)) + chunks


MOST_SIDE = 4096
"""Largest side [px] of a drawn picture."""


def _stored(name: str) -> Mesh:
    """Read an object of objects.npz, which integrations/write_objects.py writes."""
    with np.load(Path(__file__).with_suffix(".npz")) as file:
        mesh = make_mesh(file[name], file[f"{name} faces"], name)
        normals = file.get(f"{name} normals")
    return mesh if normals is None else replace(mesh, normals=normals[mesh.faces])


OBJECTS: dict[str, Callable[[], Mesh]] = {
    "sphere": lambda: sphere(48),
    **{name: partial(_stored, name) for name in ("vase", "pebble", "block", "solid")},
}


def open_object(name: str) -> Mesh:
    """Return one of OBJECTS, or read a mesh file; +Y is up. InputError lists the names."""
    if name in OBJECTS:
        return OBJECTS[name]()
    if not Path(name).suffix:
        named = f"expected one of {', '.join(OBJECTS)} or a mesh file ({', '.join(MESH_SUFFIXES)})"
        raise InputError(f"{named}, got {name!r}{did_you_mean(name, OBJECTS)}", subject="object")
    return read_mesh(name)


def draw_under(
    radiance: np.ndarray,
    mesh: Mesh | str | Path,
    material: Material | str = "chrome",
    *,
    size: int = 256,
    fov_deg: float = 30.0,
    world_from_camera: np.ndarray | None = None,
) -> np.ndarray:
    """Draw a mesh lit by an environment map: [S, S, 4] linear radiance in the map's units, and coverage.

    core.response converts it to display values.

    Args:
        radiance: [H, 2H, 3].
        mesh: of render.shapes or render.mesh, one of OBJECTS, or a mesh file; +Y up, inside the unit sphere.
        material: of scatter.materials, or a name.
        size: side [px]. fov_deg: field of view, which the unit sphere fills.
        world_from_camera: [3, 3], the world being the map's frame; None: the camera looks along -Z as the photo's did.
    Raises:
        InputError: invalid size or field of view; see also open_object and material_named.
    """
    if not (isinstance(size, Integral) and 1 <= size <= MOST_SIDE):
        raise InputError(f"expected an integer number of pixels from 1 to {MOST_SIDE}, got {size}", subject="size")
    if not (isinstance(fov_deg, Real) and 0 < fov_deg < 180):
        raise InputError(f"expected more than 0 and less than 180 degrees, got {fov_deg}", subject="fov_deg")
    mesh = mesh if isinstance(mesh, Mesh) else open_object(str(mesh))
    material = material if isinstance(material, Material) else material_named(material)
    turn = np.eye(3) if world_from_camera is None else world_from_camera
    return draw_mesh(mesh, frame_object(mesh, turn, fov_deg, size=size), radiance, material)

"""Make one GLB of a glTF and the buffers beside it.

The nodes with their transforms, the positions and the indices are kept; normals, texture coordinates, materials,
pictures and animations are not, so that the file needs no other. glTF 2.0 specification, sections 3.6 (buffers,
accessors) and 4.4 (GLB layout).
"""

from __future__ import annotations

import base64
import json
import urllib.parse
from collections.abc import Mapping
from functools import cache

from anyprobe.errors import InvalidMesh
from anyprobe.files.objects import glb_file
from anyprobe.render.mesh import MAX_FACES

HARMLESS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_")
"""Required extensions that say nothing about triangles."""

NODE_KEYS = ("name", "children", "mesh", "matrix", "translation", "rotation", "scale")
DATA_URI = "data:"


def read_gltf(data: bytes, name: str) -> dict:
    """Read a .gltf document whose triangles can be packed.

    Raises:
        InvalidMesh: not glTF 2, compressed, or more than MAX_FACES triangles.
    """
    try:
        document = json.loads(data)
        version = document["asset"]["version"]
        required = document.get("extensionsRequired", [])
        faces = _count_faces(document)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise InvalidMesh(f"not readable as glTF ({error!r})", source=name) from error
    if not str(version).startswith("2."):
        raise InvalidMesh(f"expected glTF 2, got version {version}", source=name)
    strange = [one for one in required if not str(one).startswith(HARMLESS)]
    if strange:
        raise InvalidMesh(f"expected plain glTF, got one that needs {', '.join(map(str, strange))}", source=name)
    if faces > MAX_FACES:
        raise InvalidMesh(f"expected at most {MAX_FACES:,} faces, got {faces:,}", source=name)
    return document


def buffer_paths(document: dict) -> list[str]:
    """Return the files beside the .gltf that hold its numbers, as paths relative to it."""
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
        raise InvalidMesh(f"its glTF and its buffers do not fit together ({error!r})", source=name) from error


def _pack(document: dict, buffers: Mapping[str, bytes]) -> bytes:
    body = bytearray()
    new_views, new_accessors, new_meshes = [], [], []

    @cache
    def keep_view(old: int) -> int:
        view = document["bufferViews"][old]
        data = _buffer(document["buffers"][view["buffer"]], buffers)
        start, length = view.get("byteOffset", 0), view["byteLength"]
        if not 0 <= start <= start + length <= len(data):
            raise ValueError(f"bufferView {old} ends at byte {start + length} of {len(data)}")
        body.extend(bytes(-len(body) % 4))
        kept = {"buffer": 0, "byteOffset": len(body), "byteLength": length}
        new_views.append(kept | {key: view[key] for key in ("byteStride",) if key in view})
        body.extend(data[start : start + length])
        return len(new_views) - 1

    @cache
    def keep_accessor(old: int) -> int:
        accessor = document["accessors"][old]
        if "sparse" in accessor:
            raise ValueError(f"accessor {old} is sparse")
        new_accessors.append(accessor | {"bufferView": keep_view(accessor["bufferView"])})
        return len(new_accessors) - 1

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

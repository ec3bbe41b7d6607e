"""Mesh files written by hand, byte by byte, so that nothing of the reader's makes them."""

from __future__ import annotations

import json
import struct

import numpy as np


def ply(positions, faces, *, binary: bool = False, announced: int | None = None) -> bytes:
    """Vertices [V, 3] as float32; announced: the count of faces in the header, if another."""
    announced = len(faces) if announced is None else announced
    header = (
        f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\n"
        f"element vertex {len(positions)}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {announced}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if binary:
        body = np.asarray(positions, "<f4").tobytes()
        return header + body + b"".join(struct.pack("<B3i", 3, *face) for face in np.asarray(faces).tolist())
    lines = [" ".join(map(repr, np.asarray(p, np.float64).tolist())) for p in positions]
    return header + "".join(f"{line}\n" for line in lines + [f"3 {a} {b} {c}" for a, b, c in faces]).encode()


def obj(positions, faces) -> bytes:
    """Counts from 1, as the format does: faces are given from 0."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, np.float64).tolist()]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.asarray(faces).tolist()]
    return "".join(f"{line}\n" for line in lines).encode()


def off(positions, faces) -> bytes:
    lines = ["OFF", f"{len(positions)} {len(faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in np.asarray(positions, np.float64).tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in np.asarray(faces).tolist()]
    return "".join(f"{line}\n" for line in lines).encode()


def stl(positions, faces) -> bytes:
    """Binary STL: every face with its own three corners."""
    corners = np.asarray(positions, "<f4")[np.asarray(faces)]
    records = b"".join(bytes(12) + one.tobytes() + bytes(2) for one in corners)
    return bytes(80) + struct.pack("<I", len(corners)) + records


def glb(positions, faces, *, copies: int = 1) -> bytes:
    """One mesh, placed so many times, each one beside the last."""
    vertices = np.asarray(positions, "<f4")
    indices = np.asarray(faces, "<u4")
    body = vertices.tobytes() + indices.tobytes()
    finite = vertices[np.isfinite(vertices).all(axis=1)]
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(copies))}],
        "nodes": [{"mesh": 0, "translation": [3.0 * k, 0.0, 0.0]} for k in range(copies)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(body)}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": vertices.nbytes},
            {"buffer": 0, "byteOffset": vertices.nbytes, "byteLength": indices.nbytes},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(vertices),
                "type": "VEC3",
                "min": finite.min(axis=0).tolist(),
                "max": finite.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": indices.size, "type": "SCALAR"},
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body))
    return header + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body

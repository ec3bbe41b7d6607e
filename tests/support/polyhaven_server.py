"""A local imitation of api.polyhaven.com and its file server, with faults on order."""

from __future__ import annotations

import hashlib
import json
import threading
import time
from collections import defaultdict
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import unquote

import numpy as np

CHUNK = 4096


@dataclass(frozen=True, kw_only=True)
class Fault:
    """What goes wrong with one answer."""

    status: int = 0  # instead of 200, without a body
    headers: dict = field(default_factory=dict)
    end_after: int | None = None  # bytes of the body, then the connection ends
    pause_s: float = 0.0  # after every chunk
    body: bytes | None = None  # sent instead of the right one


@dataclass(frozen=True, kw_only=True)
class Request:
    """One request as it came in."""

    path: str
    headers: dict
    began: float


class PolyHaven:
    """Assets by slug, files by path; `faults[path]` are used up one a request."""

    def __init__(self) -> None:
        self.assets: dict[str, dict[str, dict]] = {"hdris": {}, "models": {}}
        self.files: dict[str, dict] = {}
        self.bodies: dict[str, bytes] = {}
        self.faults: dict[str, list[Fault]] = defaultdict(list)
        self.requests: list[Request] = []
        self.at_once = self.most_at_once = 0
        self._lock = threading.Lock()
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), self._handler())
        self._server.daemon_threads = True
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        threading.Thread(target=self._server.serve_forever, args=(0.02,), daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()

    def paths(self, part: str = "") -> list[str]:
        """Of the requests so far, in order."""
        return [one.path for one in self.requests if part in one.path]

    def add_file(self, path: str, body: bytes, md5: str | None = None) -> dict:
        """Serve a body; its entry in the API's answer."""
        self.bodies[path] = body
        return {"url": self.url + path, "size": len(body), "md5": md5 or hashlib.md5(body).hexdigest()}

    def add_map(self, slug: str, bodies: dict[str, bytes], **entry) -> None:
        """A map; `bodies` by resolution and format, as 1k/hdr."""
        tree: dict = {}
        for name, body in bodies.items():
            resolution, suffix = name.split("/")
            path = f"/file/HDRIs/{suffix}/{resolution}/{slug}_{resolution}.{suffix}"
            tree.setdefault(resolution, {})[suffix] = self.add_file(path, body)
        self.files[slug] = {"hdri": tree, "tonemapped": {"url": self.url + "/file/no", "size": 1, "md5": "0"}}
        self._add("hdris", slug, entry)

    def add_model(self, slug: str, gltf: dict, buffers: dict[str, bytes], **entry) -> None:
        """A model; the .bin lies elsewhere than the .gltf, as on the real server."""
        include = {name: self.add_file(f"/file/gltf/8k/{slug}/{name}", b) for name, b in buffers.items()}
        include[f"textures/{slug}_diff_1k.jpg"] = {"url": self.url + "/file/no", "size": 9, "md5": "0" * 32}
        main = {
            size: {"gltf": self.add_file(f"/file/gltf/{size}/{slug}_{size}.gltf", json.dumps(gltf).encode())}
            for size in ("2k", "1k")
        }
        for one in main.values():
            one["gltf"]["include"] = include
        self.files[slug] = {"blend": {}, "gltf": main}
        self._add("models", slug, entry)

    def _add(self, kind: str, slug: str, entry: dict) -> None:
        content = json.dumps(self.files[slug]).encode()
        base = {"name": slug, "authors": {"Ada Light": "All"}, "files_hash": hashlib.sha1(content).hexdigest()}
        self.assets[kind][slug] = {**base, **entry}

    def _answer(self, path: str) -> bytes | None:
        for kind, assets in self.assets.items():
            if path == f"/assets?type={kind}":
                return json.dumps(assets).encode()
        if path.startswith("/files/"):
            files = self.files.get(path.removeprefix("/files/"))
            return None if files is None else json.dumps(files).encode()
        return self.bodies.get(path)

    def _handler(house):  # `self` is the handler's
        class Handler(BaseHTTPRequestHandler):
            def log_message(self, *arguments) -> None:
                pass

            def do_GET(self) -> None:
                self.path = unquote(self.path)
                with house._lock:
                    seen = Request(path=self.path, headers=dict(self.headers), began=time.monotonic())
                    house.requests.append(seen)
                    house.at_once += 1
                    house.most_at_once = max(house.most_at_once, house.at_once)
                    fault = house.faults[self.path].pop(0) if house.faults[self.path] else Fault()
                try:
                    self.answer(fault)
                except (BrokenPipeError, ConnectionResetError):
                    pass  # the client was killed
                finally:
                    with house._lock:
                        house.at_once -= 1

            def answer(self, fault: Fault) -> None:
                body = house._answer(self.path) if fault.body is None else fault.body
                status = fault.status or (404 if body is None else 200)
                if status != 200:
                    body = b"no"
                self.send_response(status)
                for name, value in {"Content-Length": str(len(body)), **fault.headers}.items():
                    self.send_header(name, value)
                self.end_headers()
                body = body[: fault.end_after]
                for start in range(0, len(body), CHUNK):
                    self.wfile.write(body[start : start + CHUNK])
                    self.wfile.flush()
                    time.sleep(fault.pause_s)

        return Handler


def tetrahedron() -> tuple[dict, dict[str, bytes]]:
    """A glTF as exporters write it: normals, a texture, a moved node, numbers in a file beside it."""
    positions = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")
    indices = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], dtype="<u2")
    blobs = [positions.tobytes(), positions.tobytes(), indices.tobytes()]
    starts = np.cumsum([0, *map(len, blobs)])
    floats = {"componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]}
    shape = {"attributes": {"NORMAL": 0, "POSITION": 1}, "indices": 2, "material": 0}
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_materials_specular"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "body", "mesh": 0, "scale": [1, 2, 1], "translation": [5, 0, 0]}],
        "meshes": [{"primitives": [shape]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "textures/shape_diff_1k.jpg"}],
        "accessors": [
            {"bufferView": 0, **floats},
            {"bufferView": 1, **floats},
            {"bufferView": 2, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(blob)}
            for start, blob in zip(starts, blobs, strict=False)
        ],
        "buffers": [{"byteLength": sum(map(len, blobs)), "uri": "my%20shape.bin"}],
    }
    return document, {"my shape.bin": b"".join(blobs)}

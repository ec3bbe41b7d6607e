"""The built page: its files, the networks it runs, and the example it opens with.

page/ is built from web/ (CONTRIBUTING.md) and holds large files as .gz: a server sends them as they are, write_static
unpacks them for hosts that cannot.
"""

import asyncio
import gzip
import hashlib
import json
import threading
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.routing import Match

from anyprobe import __version__
from anyprobe.core.color import to_bytes
from anyprobe.errors import ModelError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.runtime import LIGHT_STAGE, model_id, stages_of, weights_folder
from anyprobe.export.targets import TARGETS
from anyprobe.files.atomic import atomic_path
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.masks.weights import find_weights
from anyprobe.pictures.images import png_bytes, read_image
from anyprobe.serve.answers import light_json, mask_png
from anyprobe.serve.guards import SECURITY_HEADERS
from anyprobe.serve.pool import WorkerPool

MEDIA_TYPES = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".mjs": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".json": "application/json",
    ".wasm": "application/wasm",
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".svg": "image/svg+xml",
    ".txt": "text/plain; charset=utf-8",
    ".onnx": "application/octet-stream",
}

PACKED = ".gz"

EXAMPLE = "example/table.png"
EXAMPLE_FOV_DEG = 42.0
"""Field of view of the camera that rendered the example [degrees]."""


class Page:
    """The page's files by address, and its configuration for this installation."""

    def __init__(self, estimator: Estimator, model: str) -> None:
        root = Path(str(resources.files("anyprobe") / "serve" / "page"))
        self._estimator = estimator
        self._example: dict[str, bytes] = {}
        self._lock = threading.Lock()
        self.files = {path.relative_to(root).as_posix(): path for path in sorted(root.rglob("*")) if path.is_file()}
        if "index.html" not in self.files:
            raise ModelError("page: expected the built page in the package, found none; reinstall anyprobe")
        has_light = LIGHT_STAGE in stages_of(weights_folder(model))
        runs = model if has_light else DEFAULT_MODEL  # browsers run light.onnx alone
        self.files["weights/light.onnx"] = weights_folder(runs) / "light.onnx"
        self._model_id = model_id(runs)
        if (mask := weights_folder(DEFAULT_MODEL).parent / "mask" / "mask.onnx").is_file():
            self.files["weights/mask.onnx"] = mask
        if (mask_weights := find_weights()) is not None:
            self.files["weights/u2netp.onnx"] = mask_weights.path

    def config(self, *, server: bool) -> dict[str, Any]:
        """Return the page's configuration: the available networks, and whether a server is behind it."""
        return {
            "version": __version__,
            "model": self._model_id,
            "server": server,
            "targets": list(TARGETS) if server else [],
            "weights": {
                Path(name).stem: f"{name}?{_digest(path)}"
                for name, path in self.files.items()
                if name.startswith("weights/")
            },
        }

    def example(self) -> dict[str, bytes]:
        """Return the finished example by address: photo, mask, and the light as /v1/estimate answers it.

        Made at the first call, from a picture whose alpha channel is the mask.
        """
        with self._lock:
            if not self._example:
                pixels = read_image(self.files[EXAMPLE])
                photo = load_photo(pixels.rgb, mask=pixels.alpha, fov_deg=EXAMPLE_FOV_DEG)
                answer = light_json(self._estimator.from_photo(photo), frozenset({"radiance"}), None)
                self._example = {
                    "example/photo.png": png_bytes(to_bytes(pixels.rgb), compress_level=3),
                    "example/mask.png": mask_png(photo.mask),
                    "example/light.json": json.dumps(answer | {"photo": "example"}).encode(),
                }
        return self._example


def write_static(page: Page, folder: Path) -> list[Path]:
    """Write the page for any static host into a folder, each file whole or not at all."""
    files = {name: path.read_bytes() for name, path in page.files.items()}
    packed = [name for name in files if name.endswith(PACKED)]
    files |= {name.removesuffix(PACKED): gzip.decompress(files.pop(name)) for name in packed}
    lines = ["/*", *(f"  {name}: {value}" for name, value in SECURITY_HEADERS.items()), ""]
    files |= {"config.json": json.dumps(page.config(server=False), indent=1).encode(), **page.example()}
    files["_headers"] = "\n".join(lines).encode()
    for name, data in files.items():
        with atomic_path(folder / name) as temporary:
            temporary.write_bytes(data)
    return [folder / name for name in files]


def add_page(app: FastAPI, page: Page, pool: WorkerPool) -> None:
    """Serve the page at /; other addresses answer 404, or 405 if another method may use them."""

    @app.get("/config.json", include_in_schema=False)
    async def config() -> dict[str, Any]:
        return page.config(server=True)

    @app.get("/example/{name}", include_in_schema=False)
    async def example(name: str) -> Response:
        files = await pool.run(page.example, asyncio.Event().wait)  # others wait for it too
        if f"example/{name}" not in files:
            raise HTTPException(404, "there is no such page; see /api/")
        return Response(files[f"example/{name}"], media_type=MEDIA_TYPES[Path(name).suffix])

    @app.api_route("/{name:path}", methods=["GET", "POST", "PUT", "PATCH", "DELETE"], include_in_schema=False)
    async def file(request: Request, name: str) -> Response:
        name = "index.html" if not name else f"{name}index.html" if name.endswith("/") else name
        if request.method != "GET" and (name in page.files or name + PACKED in page.files):
            raise HTTPException(405, headers={"Allow": "GET"})
        return _file_response(request, page, name)


def _file_response(request: Request, page: Page, name: str) -> Response:
    """Return a file, packed if it is kept packed and the browser accepts it; 304 if the browser has it already."""
    path, packed = page.files.get(name), False
    if path is None:
        path, packed = page.files.get(name + PACKED), True
    if path is None:
        raise _absent(request)
    tag = f'"{_digest(path)}"'
    headers = {"ETag": tag, "Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    if name.startswith("assets/") or request.url.query == tag.strip('"'):
        headers["Cache-Control"] = "public, max-age=31536000, immutable"  # the address names the content
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers=headers)
    data = path.read_bytes()
    if packed and "gzip" in request.headers.get("accept-encoding", ""):
        headers["Content-Encoding"] = "gzip"
    elif packed:
        data = gzip.decompress(data)
    return Response(data, media_type=MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream"), headers=headers)


def _absent(request: Request) -> HTTPException:
    """Return 405 for an API address called by another method, which the page's catch-all route hides; else 404."""
    hidden_routes = [route for route in request.app.routes if route.matches(request.scope)[0] is Match.PARTIAL]
    if hidden_routes:
        return HTTPException(405, headers={"Allow": ", ".join(sorted(hidden_routes[0].methods))})
    return HTTPException(404, "there is no such page; see /api/")


@cache
def _digest(path: Path) -> str:
    """Return a short digest of a file of the package, which stays while a server runs."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]

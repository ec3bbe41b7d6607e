"""A headless Chromium for tests: folders served on 127.0.0.1, steps written for Playwright.

with serve({"/": folder, "/node_modules/": NODE_MODULES}) as url:
    result = run_steps("three_page.mjs", url, {"page": "vase_three.html"})

NoBrowser says what is missing: Node, the packages of tests/browser, or Chromium.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

FOLDER = Path(__file__).parents[1] / "browser"
NODE_MODULES = FOLDER / "node_modules"

FLAGS = (
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
    "--disable-gpu-rasterization",
    "--disable-accelerated-2d-canvas",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
"""WebGL without a GPU, the page itself composed as Chromium does without one, and no calls of its own to
the network."""


class NoBrowser(RuntimeError):
    """Why no browser can be used here."""


class PageFailed(AssertionError):
    """The steps threw, or the page logged an error."""


def find_browser() -> tuple[str, str]:
    """Paths of node and chromium, or NoBrowser."""
    node = shutil.which("node")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser")
    if node is None:
        raise NoBrowser("Node.js is needed (apt-get install nodejs npm)")
    if chromium is None:
        raise NoBrowser("Chromium is needed (apt-get install chromium)")
    if not (NODE_MODULES / "playwright-core").is_dir():
        raise NoBrowser("the packages of tests/browser are needed (cd tests/browser && npm ci)")
    return node, chromium


class _Folders(SimpleHTTPRequestHandler):
    """Files of several folders, each under its prefix; nothing is cached or logged."""

    extensions_map = SimpleHTTPRequestHandler.extensions_map | {
        ".js": "text/javascript",
        ".mjs": "text/javascript",
        ".wasm": "application/wasm",
        ".json": "application/json",
    }

    def __init__(self, *arguments, folders: Mapping[str, Path], headers: Mapping[str, str]) -> None:
        self.folders, self.more_headers = folders, headers
        super().__init__(*arguments)

    def translate_path(self, path: str) -> str:
        asked = unquote(urlsplit(path).path)
        for prefix in sorted(self.folders, key=len, reverse=True):
            if asked.startswith(prefix) and ".." not in asked:
                return str(Path(self.folders[prefix]) / asked[len(prefix) :])
        return str(FOLDER / "absent")

    def end_headers(self) -> None:
        for name, value in {"Cache-Control": "no-store", **self.more_headers}.items():
            self.send_header(name, value)
        super().end_headers()

    def do_GET(self) -> None:
        if urlsplit(self.path).path == "/favicon.ico":  # every browser asks; a 404 would be an error there
            self.send_response(204)
            self.end_headers()
        else:
            super().do_GET()

    def log_message(self, *arguments) -> None:
        pass


@contextmanager
def serve(folders: Mapping[str, Path], headers: Mapping[str, str] | None = None) -> Iterator[str]:
    """Serve folders by prefix ("/" the shortest) on a free port of 127.0.0.1; gives the URL with a slash."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Folders, folders=folders, headers=headers or {}))
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def run_steps(
    steps: str | Path,
    url: str,
    arguments: Mapping[str, Any] | None = None,
    *,
    flags: Sequence[str] = (),
    viewport: tuple[int, int] = (960, 540),
    timeout_s: float = 240,
    complaints_allowed: bool = False,
) -> Any:
    """Run a module of tests/browser (or of any path) against a fresh page; what it returns, from JSON.

    Raises:
        NoBrowser: see find_browser.
        PageFailed: the steps threw, or, unless allowed, the page logged an error.
    """
    node, chromium = find_browser()
    order = {
        "chromium": chromium,
        "flags": [*FLAGS, *flags],
        "url": url,
        "steps": str((FOLDER / steps).resolve()),
        "arguments": dict(arguments or {}),
        "viewport": dict(zip(("width", "height"), viewport, strict=True)),
        "timeout_ms": 1000 * timeout_s,
    }
    ended = subprocess.run(
        [node, str(FOLDER / "run.mjs")],
        input=json.dumps(order),
        capture_output=True,
        text=True,
        timeout=timeout_s + 60,
        check=False,
    )
    try:
        answer = json.loads(ended.stdout)
    except ValueError:
        raise PageFailed(f"no answer from the browser: {ended.stderr.strip()[-2000:]}") from None
    if "error" in answer or (answer["complaints"] and not complaints_allowed):
        raise PageFailed("\n".join([answer.get("error", ""), *answer["complaints"]]).strip())
    return answer["result"]

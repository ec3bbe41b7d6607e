"""The live page as its users get it: from the command `anyprobe serve`, in a headless Chromium."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import NoBrowser, find_browser, serve

VASE = Path(__file__).parents[2] / "examples" / "vase.png"
PROGRAM = Path(sys.executable).with_name("anyprobe")


@pytest.fixture(scope="session")
def chromium() -> None:
    try:
        find_browser()
    except NoBrowser as reason:
        pytest.skip(str(reason))


@pytest.fixture(scope="session")
def page_url(chromium):
    """Address of a running `anyprobe serve`, with a slash."""
    pytest.importorskip("fastapi", reason="needs the serve extra")
    with subprocess.Popen(
        [PROGRAM, "serve", "--port", "0", "--workers", "1"], stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield re.search(r"http://\S+/", process.stderr.readline())[0]
        finally:
            process.terminate()


@pytest.fixture(scope="session")
def static_url(chromium, tmp_path_factory):
    """Address of a plain file server over what `anyprobe serve --static` writes."""
    guards = pytest.importorskip("anyprobe.serve.guards", reason="needs the serve extra", exc_type=ImportError)
    pytest.importorskip("fastapi", reason="needs the serve extra")
    folder = tmp_path_factory.mktemp("static")
    subprocess.run([PROGRAM, "serve", "--static", folder], check=True, capture_output=True)
    with serve({"/": folder}, headers=guards.SECURITY_HEADERS) as url:
        yield url


@pytest.fixture
def vase_photo(tmp_path) -> Path:
    """The example without its alpha channel."""
    path = tmp_path / "vase on a table.jpg"
    with Image.open(VASE) as image:
        image.convert("RGB").save(path, quality=95)
    return path


@pytest.fixture
def aside_photo(tmp_path) -> Path:
    """The example cut so that the vase stands beside the middle, alpha and all: its crop is a turned camera's."""
    path = tmp_path / "aside" / "vase.png"
    path.parent.mkdir()
    with Image.open(VASE) as image:
        image.crop((120, 0, image.width, 420)).save(path)
    return path


@pytest.fixture
def vase_frame() -> np.ndarray:
    """[512, 672, 3] uint8: the example as a camera's picture."""
    with Image.open(VASE) as image:
        picture = np.asarray(image.convert("RGB"))
    return np.pad(picture, ((0, 0), (80, 80), (0, 0)), mode="edge")

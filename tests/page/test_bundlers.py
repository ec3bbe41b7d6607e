"""The npm package as `npm pack` makes it, built by each bundler in an empty project and opened in Chromium."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.browser import run_steps, serve
from support.bundlers import BUNDLERS, VITE, Bundler, emitted, page

ROOT = Path(__file__).parents[2]
WEB = ROOT / "web"
FOV_DEG = 24.0
ISOLATED = {"Cross-Origin-Opener-Policy": "same-origin", "Cross-Origin-Embedder-Policy": "require-corp"}
IN_CI = ("vite",)
"""The others take a minute each."""
pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def packed(chromium, tmp_path_factory) -> Path:
    """What a stranger's `npm pack` makes, nothing generated before."""
    if not (WEB / "node_modules" / "onnxruntime-web").is_dir():
        pytest.skip("needs the packages of web/ (cd web && npm ci)")
    folder = tmp_path_factory.mktemp("packed")
    for name in ("weights", "dist"):
        shutil.rmtree(WEB / name, ignore_errors=True)
    (WEB / "LICENSE").unlink(missing_ok=True)
    subprocess.run(["npm", "pack", "--silent", "--pack-destination", folder], cwd=WEB, check=True, capture_output=True)
    return next(folder.glob("*.tgz"))


@pytest.fixture(scope="module")
def photo(tmp_path_factory) -> Path:
    """photo.png, opaque, and mask.png with the soft edge of its alpha channel."""
    folder = tmp_path_factory.mktemp("photo")
    with Image.open(ROOT / "examples" / "vase.png") as image:
        image.convert("RGB").save(folder / "photo.png")
        image.getchannel("A").save(folder / "mask.png")
    return folder


@pytest.fixture(scope="module")
def expected(photo, estimator) -> np.ndarray:
    """[27] Python's own light."""
    return estimator(photo / "photo.png", mask=photo / "mask.png", fov_deg=FOV_DEG).sh9().ravel()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in IN_CI else pytest.mark.slow) for name in BUNDLERS]
)
def test_build_gives_pythons_light(packed, photo, expected, tmp_path, name):
    site = BUNDLERS[name].build(packed, tmp_path)
    for path in photo.iterdir():
        shutil.copy(path, site)
    with serve({"/": site}, headers=ISOLATED) as url:
        seen = run_steps("package_built.mjs", url, {"page": "index.html"})
    assert seen["failed"] == []
    assert not any("mask" in path and path.endswith(".onnx") for path in seen["fetched"])  # a mask was given
    assert np.linalg.norm(np.subtract(seen["light"], expected)) < 1e-3 * np.linalg.norm(expected)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "files"),
    [
        ('import { encodeHdr } from "anyprobe/core"; globalThis.x = encodeHdr;', []),
        ('import { ProbeLight } from "anyprobe/three"; globalThis.x = ProbeLight;', []),
        ('import { AnyProbe } from "anyprobe"; globalThis.x = AnyProbe;', ["light", "mask", "ort-wasm-simd-threaded"]),
    ],
)
def test_only_what_is_used_is_emitted(packed, tmp_path, program, files):
    sources = {"index.html": page("/main.js"), "main.js": program}
    vite = Bundler(packages=(*VITE, "three@0.187.0"), sources=sources, command=("npx", "vite", "build"), site="dist")
    found = emitted(vite.build(packed, tmp_path))
    assert len(found) == len(files), found
    for file in files:
        assert any(name.startswith(file) for name in found), (file, found)
    assert not any("jspi" in name for name in found)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["esbuild", "rollup"])
def test_bundler_that_copies_no_files_fails_at_build_time(packed, tmp_path, name):
    """Of the plain package, in a line that names the core."""
    source = 'import { AnyProbe } from "anyprobe"; globalThis.x = AnyProbe;'
    bundler = replace(BUNDLERS[name], sources={"main.js": source})
    with pytest.raises(AssertionError, match=r"this-bundler-copies-no-files-import-anyprobe-core\.js"):
        bundler.build(packed, tmp_path)


@pytest.mark.parametrize(
    ("around", "line"),
    [
        ("src/anyprobe/weights", "npm pack: expected the packages of web/, got none; run npm ci first"),
        (None, "npm pack: expected a clone of anyprobe around web/"),
    ],
)
def test_what_npm_pack_lacks_is_said_in_one_line(tmp_path, around, line):
    if shutil.which("npm") is None:
        pytest.skip("needs npm")
    web = tmp_path / "web"
    shutil.copytree(WEB, web, ignore=shutil.ignore_patterns("node_modules", "weights", "dist", "LICENSE"))
    if around:
        (tmp_path / around).mkdir(parents=True)
    ended = subprocess.run(["npm", "pack"], cwd=web, capture_output=True, text=True, check=False)
    assert ended.returncode != 0
    assert line in ended.stderr
    assert not list(web.glob("*.tgz"))

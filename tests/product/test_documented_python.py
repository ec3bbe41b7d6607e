"""Python that documents and notebooks show runs, page by page, from top to bottom.

A block after a line `<!-- not run: why -->` is only compiled.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from support.places import place
from support.scenes import sphere_photo

import anyprobe
from anyprobe.maps.radiance import write_exr

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"(?:<!-- not run: ([^>]+) -->\n)?^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs").rglob("*.ipynb"))]
pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("networks_opened_once", "rough_shadows", "small_results")]


def blocks_of(path: Path) -> list[tuple[int, str, str]]:
    """The blocks of a page or notebook: line where it begins, why it is not run ("": it is), source."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        return [(1, "", "".join(cell["source"])) for cell in json.loads(text)["cells"] if cell["cell_type"] == "code"]
    return [(text[: match.start(2)].count("\n") + 1, match[1] or "", match[2]) for match in BLOCK.finditer(text)]


def run(path: Path, names: dict) -> int:
    """Run a page's blocks in one namespace; how many ran."""
    count = 0
    for line, reason, source in blocks_of(path):
        code = compile("\n" * (line - 1) + source, str(path), "exec")
        if not reason:
            exec(code, names)
            count += 1
    return count


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """The files that blocks name."""
    folder = tmp_path_factory.mktemp("documents")
    with Image.open(ROOT / "examples" / "table.jpg") as photo:
        mirrored = photo.transpose(Image.Transpose.FLIP_LEFT_RIGHT)  # the vase is at 412, 290
    for name in ("photo.jpg", "photo.png", "vase.jpg"):
        mirrored.save(folder / name)
    sphere = Image.fromarray(sphere_photo())
    for name in ("sphere.png", "toy.png"):
        sphere.convert("RGB").save(folder / name)
    sphere.getchannel("A").save(folder / "mask.png")
    trimesh.creation.icosphere(subdivisions=2).export(folder / "bunny.glb")
    (folder / "hdris").mkdir()
    for seed in range(2):
        write_exr(folder / "hdris" / f"place_{seed}.exr", place(seed))
    return folder


@pytest.fixture
def names(files) -> dict:
    """What blocks take for given: the light of a photo, arrays, lists."""
    height, width = np.array(Image.open(files / "mask.png")).shape
    normals = np.zeros((height, width, 3), np.float32)
    normals[30:60, 50:80, 2] = 1
    return {
        "anyprobe": anyprobe,
        "np": np,
        "light": anyprobe.Light(radiance=np.ones((64, 128, 3), np.float32)),
        "normals": normals,
        "panorama": np.full((64, 128, 4), 128, np.uint8),
        "paths": [ROOT / "examples" / "vase.png"] * 2,
        "world_from_camera": np.stack([np.eye(3)] * 2),
    }


@pytest.mark.parametrize("path", [path for path in PAGES if blocks_of(path)], ids=lambda path: path.name)
def test_blocks_of_a_page_run(path, files, names, tmp_path, monkeypatch):
    shutil.copytree(files, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(path.parent if path.suffix == ".ipynb" else tmp_path)
    run(path, names)

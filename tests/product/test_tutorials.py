"""Tutorials work as written: their commands run in order, their labels and names are the extension's own."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pytest

from anyprobe.errors import InputError

ROOT = Path(__file__).parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
EXTENSION = ROOT / "integrations" / "blender" / "light_from_photo"
SHELL = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"^Save as `([^`]+)`:\n\n```\w+\n(.*?)^```", re.MULTILINE | re.DOTALL)
NOT_RUN = (
    "git clone",
    "cd anyprobe",
    "python3 -m venv",
    ". .venv",
    "pip install",
    "npm install",
    "python3 -m http.server",
)
"""Steps that install, download or serve."""
BLENDERS_OWN = {"Open", "Add > Mesh > Monkey", "Image > Save As", "Cycles", "Metallic", "Roughness", "New"}
"""Labels of Blender itself, as are those that begin with a menu."""
MENUS = ("Edit >", "File >", "View >", "Render >", "Install from Disk")
pytestmark = pytest.mark.usefixtures("networks_opened_once", "rough_shadows", "small_results")


def steps_of(page: str) -> list[str]:
    """The commands of a page, one by one."""
    lines = [line.partition(" #")[0] for block in SHELL.findall(page) for line in block.splitlines()]
    return [step.strip() for line in lines for step in line.split("&&") if step.strip()]


def follow(page: str, folder: Path, command) -> list[str]:
    """Run a tutorial's own commands and save its files in a folder that has examples/; the commands."""
    ran = []
    for step in steps_of(page):
        if step.startswith("anyprobe ") and not step.startswith("anyprobe mask --fetch"):
            outcome = command(*shlex.split(step)[1:])
            assert outcome.status == 0, outcome.err
            ran.append(step)
        else:
            known = (*NOT_RUN, "anyprobe mask --fetch", "python integrations/blender/build.py ", "blender --background")
            if not step.startswith(known):
                raise InputError(f"{step}: expected a command that this test runs or leaves out")
    for name, text in FILE.findall(page):
        (folder / name).write_text(text, encoding="utf-8")
    return ran


@pytest.fixture
def clone(work) -> Path:
    (work / "examples").symlink_to(ROOT / "examples")
    return work


@pytest.mark.ci
def test_three_js_tutorial_leaves_a_scene(clone, command):
    page = (TUTORIALS / "three.md").read_text(encoding="utf-8")
    assert len(follow(page, clone, command)) == 2
    left = {path.name for path in (clone / "scene").iterdir()}
    assert {"index.html", "main.js", "table_panorama_three.js"} <= left
    program = (clone / "scene" / "main.js").read_text()
    assert {Path(name).name for name in re.findall(r'from "(\./[^"]+)"', program)} <= left
    assert {path.name for path in (clone / "light").iterdir()} >= {"table.png", "table_panorama.exr"}


def test_blender_tutorial_runs_up_to_blender():
    """Its estimate is the one that the tutorial of three.js runs; the zip is built for a platform that there is."""
    steps, run = (steps_of((TUTORIALS / name).read_text(encoding="utf-8")) for name in ("blender.md", "three.md"))
    assert {step for step in steps if step.startswith("anyprobe ")} <= set(run)
    (built,) = (step for step in steps if "build.py" in step)
    platform = shlex.split(built)[-1]
    assert f'"{platform}"' in (ROOT / "integrations" / "blender" / "build.py").read_text()


def test_blender_tutorial_names_what_the_extension_has():
    page = (TUTORIALS / "blender.md").read_text(encoding="utf-8")
    sources = "\n".join(path.read_text() for path in EXTENSION.glob("*.py"))
    labels = set(re.findall(r'(?:bl_label|name|bl_category) ?= ?"([^"]+)"|"bl_category": "([^"]+)"', sources))
    own = {one for pair in labels for one in pair if one}
    shown = {label for label in re.findall(r"\*\*([^*]+)\*\*", page) if not label.startswith(MENUS)}
    assert shown - own - BLENDERS_OWN == set()
    (script,) = re.findall(r"^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    tree = ast.walk(ast.parse(script))
    attributes = [node for node in tree if isinstance(node, ast.Attribute)]
    settings = {node.attr for node in attributes if ast.unparse(node.value) == "settings"}
    assert settings >= {"image", "use_box", "box", "use_fov", "fov"}
    assert {name for name in settings if not re.search(rf"^    {name}: ", sources, re.MULTILINE)} == set()
    operators = {node.attr for node in attributes if ast.unparse(node.value) == "bpy.ops.light_from_photo"}
    assert operators == {"estimate", "standard"}
    assert {name for name in operators if f'bl_idname = "light_from_photo.{name}"' not in sources} == set()

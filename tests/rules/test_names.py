"""A name of a module or a package is one layer's; a public name of a function or class is one module's."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

import pytest

import anyprobe

SOURCE = Path(anyprobe.__file__).parent


def modules(root: Path) -> list[str]:
    """Dotted names below the package, of all but __init__."""
    found = (p.relative_to(root).with_suffix("").as_posix().replace("/", ".") for p in root.rglob("*.py"))
    return [name for name in found if not name.endswith("__init__")]


def shared(root: Path) -> list[str]:
    """Names that modules or packages of two layers have, but for a layer and the command that is named as it."""
    rooms = [(name.split(".")[0], name.split(".")[-1]) for name in modules(root) if "." in name]
    packages = {path.parent.name for path in root.glob("*/__init__.py")}
    rooms += [(name, name) for name in packages]
    layers = Counter(name for layer, name in set(rooms) if not (layer == "cli" and name in packages))
    return sorted(name for name, count in layers.items() if count > 1)


def test_a_name_is_one_layers():
    assert shared(SOURCE) == []


@pytest.fixture
def tree(tmp_path) -> Path:
    """A package of which nothing is wrong."""
    for name in ("core/__init__.py", "core/one.py", "light/__init__.py", "light/two.py", "cli/light.py"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    return tmp_path


def test_a_tree_without_fault_has_none(tree):
    assert shared(tree) == []


@pytest.mark.parametrize("file", ["light/one.py", "core/light.py", "cli/one.py"])
def test_rule_names_a_shared_name(tree, file):
    (tree / file).touch()
    assert shared(tree) == [Path(file).stem]


COMMANDS = {"estimate", "export", "mask", "status", "train"}
"""Of a command, or a request to the server, and of what it calls or shows."""
KEPT = {
    "Shown": "what a photo shows of its object, and a picture's display values",
    "Source": "of a map in a folder, and of light",
    "begin": "the state of a filter, and a dataset",
    "blend": "two maps, and a light with a map's detail",
    "choose": "the part that is meant, and pairs by lot",
    "decode": "a library's codes, and a sample's files",
    "encode": "a library's codes, and a filter's logarithm",
    "evaluate": "a material's reflectance, and the command",
    "irradiance": "at normals, and as coefficients for exports",
    "lift": "values to a map, and the run that is named after it",
    "line_of": "a message that names options, and one that names form fields",
    "paint": "a material under a texture, and a room's rectangle",
    "upright_size": "of a picture's header, and of a clip",
}
"""Other names that two modules have, and what each means."""


def twice(root: Path) -> set[str]:
    """Names of functions and classes without an underscore that more than one module of a tree defines."""
    found = Counter(
        node.name
        for path in root.rglob("*.py")
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_")
    )
    return {name for name, count in found.items() if count > 1}


def test_a_public_name_is_one_modules():
    """Those that are kept are still there twice: one that is mended leaves the list."""
    assert twice(SOURCE) == COMMANDS | KEPT.keys()


def test_rule_names_what_two_modules_define(tmp_path):
    (tmp_path / "one.py").write_text("class Frame: ...\ndef _same(): ...\ndef own(): ...\n")
    (tmp_path / "two.py").write_text("def Frame(): ...\ndef _same(): ...\nclass A:\n    def own(self): ...\n")
    assert twice(tmp_path) == {"Frame"}

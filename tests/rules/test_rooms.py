"""Small modules stand with the one that uses them, and a name is one layer's."""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from pathlib import Path

import pytest

import anyprobe

SOURCE = Path(anyprobe.__file__).parent
SMALL = 130
"""Lines that are not blank below which a module has no room of its own where one other alone imports it."""

COMMAND = "one file a command, registered in cli/app"
ROOMS = {
    "__main__": "what `python -m anyprobe` runs",
    "cli.app": "the front door of the command line",
    "cli.doctor": COMMAND,
    "cli.export": COMMAND,
    "cli.mask": COMMAND,
    "cli.train": COMMAND,
    "dataset.seen_surroundings": "of dataset.pairs, which would be longer than 400 lines with it",
    "export.templates.blender_world": "a text that is filled in and written, imported by nothing",
    "nets.lifting": "the step between the two halves of nets.light_net, which docs/conventions.md describes",
}
"""Modules that stay small and alone, and why."""


def modules(root: Path) -> dict[str, Path]:
    """By name without the package's, those with code."""
    found = {p.relative_to(root).with_suffix("").as_posix().replace("/", "."): p for p in root.rglob("*.py")}
    return {name: path for name, path in found.items() if not name.endswith("__init__")}


def importers(root: Path) -> dict[str, set[str]]:
    """Of each module, the modules that import it, inside functions too."""
    names, found = modules(root), defaultdict(set)
    for path in root.rglob("*.py"):
        own = path.relative_to(root).with_suffix("").as_posix().replace("/", ".")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            asked: list[str] = []
            if isinstance(node, ast.Import):
                asked = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                asked = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
            for one in asked:
                name = one.removeprefix("anyprobe.")
                if name in names and name != own:
                    found[name].add(own)
    return found


def lone(root: Path) -> dict[str, str]:
    """Small modules, and the only one that imports each (none: empty)."""
    asked = importers(root)
    lines = {
        name: sum(1 for line in path.read_text(encoding="utf-8").splitlines() if line.strip())
        for name, path in modules(root).items()
    }
    return {name: "".join(asked[name]) for name, count in lines.items() if count < SMALL and len(asked[name]) < 2}


def shared(root: Path) -> list[str]:
    """Names that modules or packages of two layers have, but for a layer and the command that is named as it."""
    rooms = [(name.split(".")[0], name.split(".")[-1]) for name in modules(root) if "." in name]
    packages = {path.parent.name for path in root.glob("*/__init__.py")}
    rooms += [(name, name) for name in packages]
    layers = Counter(name for layer, name in set(rooms) if not (layer == "cli" and name in packages))
    return sorted(name for name, count in layers.items() if count > 1)


def test_a_small_module_stands_with_the_one_that_imports_it():
    found = lone(SOURCE)
    assert {name: by for name, by in found.items() if name not in ROOMS} == {}


def test_every_exception_is_needed():
    assert sorted(set(ROOMS) - set(lone(SOURCE))) == []


def test_a_name_is_one_layers():
    assert shared(SOURCE) == []


@pytest.fixture
def tree(tmp_path) -> Path:
    """A package of which nothing is wrong."""
    files = {
        "core/__init__.py": "",
        "core/one.py": "x = 1\n" * (SMALL - 1),
        "core/large.py": "x = 1\n" * SMALL,
        "light/__init__.py": "",
        "light/two.py": "from anyprobe.core.one import x\n" + "x = 1\n" * SMALL,
        "light/three.py": "from anyprobe.core import one\nimport anyprobe.core.large\n" + "x = 1\n" * SMALL,
        "cli/__init__.py": "",
        "cli/light.py": "def f():\n    import anyprobe.light.two\n" + "x = 1\n" * SMALL,
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_a_tree_without_fault_has_none(tree):
    assert lone(tree) == {}
    assert shared(tree) == []


@pytest.mark.parametrize(
    ("file", "text", "found"),
    [
        ("light/three.py", "y = 1\n" * SMALL, {"core.one": "light.two"}),
        ("light/small.py", "y = 1\n", {"light.small": ""}),
        ("core/large.py", "y = 1\n", {"core.large": "light.three"}),
    ],
)
def test_rule_names_a_small_module_that_stands_alone(tree, file, text, found):
    (tree / file).write_text(text)
    assert lone(tree) == found


@pytest.mark.parametrize("file", ["light/one.py", "core/light.py", "cli/one.py"])
def test_rule_names_a_shared_name(tree, file):
    (tree / file).write_text("y = 1\n" * SMALL)
    assert shared(tree) == [Path(file).stem]

"""No module needs itself by way of others, by imports inside functions and for types included."""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from support.trees import tree_of

import anyprobe
import anyprobe_train

SOURCE = Path(anyprobe.__file__).parent


def needs(root: Path) -> dict[str, set[str]]:
    """Return the modules of a package by name, each with those that it imports anywhere."""
    names = {path: ".".join([root.name, *path.relative_to(root).with_suffix("").parts]) for path in root.rglob("*.py")}
    modules = {name.removesuffix(".__init__"): path for path, name in names.items()}
    found: dict[str, set[str]] = {}
    for module, path in modules.items():
        asked = set()
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Import):
                asked |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                whole = [f"{node.module}.{alias.name}" for alias in node.names]
                asked |= {name if name in modules else str(node.module) for name in whole}
        found[module] = asked & set(modules)
    return found


def circle(root: Path) -> list[str]:
    """Return the modules of one circle in order, the first again at the end; [] where there is none."""
    try:
        TopologicalSorter(needs(root)).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_modules_import_in_a_circle():
    assert circle(SOURCE) == []
    assert circle(Path(anyprobe_train.__file__).parent) == []

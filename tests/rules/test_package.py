"""Small rooms with names on the doors."""

from __future__ import annotations

import ast
from pathlib import Path

from support.trees import tree_of

import anyprobe
import anyprobe_train

SOURCE = Path(anyprobe.__file__).parent
TRAIN = Path(anyprobe_train.__file__).parent
TESTS = Path(__file__).parents[1]
MAX_LINES = 400
NAMELESS = {"utils", "util", "helpers", "helper", "common", "misc"}


def long_files(root: Path) -> dict[str, int]:
    counts = {p: len(p.read_text(encoding="utf-8").splitlines()) for p in root.rglob("*.py")}
    return {str(p.relative_to(root)): count for p, count in counts.items() if count > MAX_LINES}


def nameless(root: Path) -> list[str]:
    found = (p for p in root.rglob("*") if p.suffix == ".py" or p.is_dir())
    found = (p for p in found if "node_modules" not in p.parts)  # others' names
    return sorted(str(p.relative_to(root)) for p in found if NAMELESS & set(p.stem.lower().split("_")))


def undocumented(root: Path) -> list[str]:
    """Modules with code and no first line that says what they are."""
    trees = {p: tree_of(p) for p in sorted(root.rglob("*.py"))}
    return [str(p.relative_to(root)) for p, tree in trees.items() if tree.body and not ast.get_docstring(tree)]


def test_no_file_over_400_lines():
    assert long_files(SOURCE) | long_files(TRAIN) == {}


def test_every_file_has_a_name_that_says_something():
    assert nameless(SOURCE) + nameless(TRAIN) == []
    assert nameless(TESTS) == []


def test_every_module_says_what_it_is():
    assert undocumented(SOURCE) + undocumented(TRAIN) == []

"""A name of a module or a package is one layer's."""

from __future__ import annotations

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

"""A name of a module or package is one layer's, of a function or class one module's, in each distribution."""

from __future__ import annotations

import ast
from collections import Counter
from pathlib import Path

from support.trees import tree_of

import anyprobe
import anyprobe_train

SOURCE = Path(anyprobe.__file__).parent
TRAIN = Path(anyprobe_train.__file__).parent


def modules(root: Path) -> list[str]:
    """Dotted names below the package, of all but __init__."""
    found = (p.relative_to(root).with_suffix("").as_posix().replace("/", ".") for p in root.rglob("*.py"))
    return [name for name in found if not name.endswith("__init__")]


def shared(root: Path) -> list[str]:
    """Names that modules or packages of two layers have, but for a layer and the command that is named as it."""
    found = [path.parent.relative_to(root).parts for path in root.rglob("__init__.py") if path.parent != root]
    packages = {names[-1] for names in found}
    found += [tuple(name.split(".")) for name in modules(root) if "." in name and not name.endswith("__main__")]
    rooms = [(names[0], names[-1]) for names in found]
    layers = Counter(name for layer, name in set(rooms) if not (layer == "cli" and name in packages))
    return sorted(name for name, count in layers.items() if count > 1)


def test_a_name_is_one_layers():
    assert shared(SOURCE) == []
    assert shared(TRAIN) == []


COMMANDS = {"estimate", "export", "mask", "status"}
"""Of a command, or a request to the server, and of what it calls."""


def twice(root: Path) -> set[str]:
    """Names of functions and classes without an underscore that more than one module of a tree defines."""
    found = Counter(
        node.name
        for path in root.rglob("*.py")
        for node in tree_of(path).body
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) and not node.name.startswith("_")
    )
    return {name for name, count in found.items() if count > 1}


def test_a_public_name_is_one_modules():
    """But for commands, which are named as what they call."""
    assert twice(SOURCE) <= COMMANDS
    assert twice(TRAIN) <= {"evaluate", "export", "main", "run", "train"}


def shared_constants(root: Path) -> set[str]:
    """Names of constants that a module imports from another, and that more than one module of a tree defines."""
    defined: Counter[str] = Counter()
    imported = set()
    for path in root.rglob("*.py"):
        tree = tree_of(path)
        targets = [one for node in tree.body if isinstance(node, ast.Assign) for one in node.targets]
        targets += [node.target for node in tree.body if isinstance(node, ast.AnnAssign)]
        defined.update({one.id for target in targets for one in ast.walk(target) if isinstance(one, ast.Name)})
        nodes = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        imported |= {one.name for node in nodes if (node.module or "").startswith("anyprobe") for one in node.names}
    return {name for name in imported if defined[name] > 1}


def test_a_constant_that_is_imported_is_one_modules():
    assert not shared_constants(SOURCE)
    assert not shared_constants(TRAIN)

"""Docstrings begin as engineers write: none with a word that makes the reader look for the noun."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from support.trees import tree_of

ROOT = Path(__file__).parents[2]
PACKAGES = (ROOT / "src" / "anyprobe", ROOT / "train" / "anyprobe_train")
RIDDLE = re.compile(r"(Of|What|None|So|From which)\b")


def riddles(path: Path) -> Iterator[str]:
    """Yield the docstrings, of constants too, that begin with such a word."""
    for node in ast.walk(tree_of(path)):
        for statement in getattr(node, "body", []) if not isinstance(node, ast.Lambda | ast.IfExp) else []:
            value = statement.value if isinstance(statement, ast.Expr) else None
            if isinstance(value, ast.Constant) and isinstance(value.value, str) and RIDDLE.match(value.value.strip()):
                yield value.value


def test_no_docstring_begins_with_a_riddle():
    found = {path: list(riddles(path)) for root in PACKAGES for path in root.rglob("*.py")}
    assert {str(path): lines for path, lines in found.items() if lines} == {}

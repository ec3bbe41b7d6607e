"""The paper: every element of it is in one file, and its page computes what it says of Table 1."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

import numpy as np

from anyprobe.core.response import inverse_response
from anyprobe.paper.chain import LN_SCALE

ROOT = Path(__file__).parents[2]
ELEMENTS = ROOT / "src" / "anyprobe" / "paper" / "README.md"
PAGE = ROOT / "docs" / "explanation" / "paper.md"
ROW = re.compile(r"^\| ([^|]+?) \| `([\w./]+)`: ((?:`\w+`(?:, )?)+) \|", re.MULTILINE)
WANTED = [f"Eq. {number}" for number in range(1, 9)] + "Fig. 2,Fig. 5,Fig. 8,Fig. 9,Sect. 3.2,Sect. 3.5".split(",")


def names_in(source: str) -> set[str]:
    """Functions, classes and constants of a file."""
    found = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.Assign):
            found |= {target.id for target in node.targets if isinstance(target, ast.Name)}
    return found


def missing(page: str) -> list[str]:
    """Files that a table of elements names and that are not there, and names that a file does not have."""
    found = []
    for _, path, names in ROW.findall(page):
        if not (ROOT / path).is_file():
            found.append(path)
            continue
        there = names_in((ROOT / path).read_text(encoding="utf-8"))
        found += [f"{path}: {name}" for name in re.findall(r"\w+", names) if name not in there]
    return found


def test_every_element_is_in_one_file():
    page = ELEMENTS.read_text(encoding="utf-8")
    rows = ROW.findall(page)
    assert missing(page) == []
    assert len(rows) == page.count("\n| ") - 1 >= 15
    for one in WANTED:
        assert any(row[0].startswith(one) for row in rows), one


def test_planted_faults_are_found():
    page = "| Eq. 9 | `src/anyprobe/no.py`: `a` | x |\n| Eq. 10 | `src/anyprobe/paper/equations.py`: `nothing` | x |"
    assert missing(page) == ["src/anyprobe/no.py", "src/anyprobe/paper/equations.py: nothing"]


def test_table_1_is_computed():
    number = r"([+-]?\d*\.\d+)"
    rows = re.findall(rf"^\| [^|]+ \| {number} \| {number} \| {number} \| {number} \|$", PAGE.read_text(), re.MULTILINE)
    assert len(rows) == 9
    for rmse, computed, printed, gap in (map(float, row) for row in rows):
        assert abs(-20 * math.log10(rmse) - computed) < 0.0006
        assert abs(printed - computed - gap) < 0.0006


def test_an_ldr_error_has_a_least_hdr_error():
    display = np.linspace(0.01, 0.8, 80)
    slope = np.diff(np.log(inverse_response(display))) / np.diff(display)
    assert abs(slope.min() - 2.8) < 0.05
    assert abs(0.127 * slope.min() / (LN_SCALE[1] - LN_SCALE[0]) - 0.022) < 0.0005

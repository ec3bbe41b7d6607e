"""docs/explanation/paper.md names files that are there, functions that they have, and every element of the paper."""

from __future__ import annotations

import ast
import re
import shlex
from pathlib import Path

import pytest
from support.command_faults import PROGRAMS, fault_of, fault_of_module

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "explanation" / "paper.md"
NAMED = re.compile(
    r"`((?:src|train|research|tests|docs|examples|benchmarks)/[\w./-]+)`(?:: (`[\w.]+`(?:, `[\w.]+`)*))?"
)
SHORT = re.compile(r"^([A-Z]+) is `([^`]+)`", re.MULTILINE)
COMMAND = re.compile(r"`((?:python -m|anyprobe-train|anyprobe|pytest|FIGURE|EVALUATE|COMPARE) [^`]+)`")
FIGURES = range(1, 17)


def missing(page: str) -> list[str]:
    """The files that a page names and that are not there, and the names that a file does not have."""
    found = []
    for path, names in NAMED.findall(page):
        if not (ROOT / path).exists():
            found.append(path)
        elif names:
            there = names_in((ROOT / path).read_text(encoding="utf-8"))
            found += [f"{path}: {name}" for name in re.findall(r"`([\w.]+)`", names) if name not in there]
    return found


def names_in(source: str) -> set[str]:
    """Functions, classes and constants of a file, and methods as Class.method."""
    found = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{one.name}" for one in node.body if isinstance(one, ast.FunctionDef)}
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        found |= {one.id for one in targets if isinstance(one, ast.Name)}
    return found


def refused(page: str) -> list[str]:
    """The commands of a page that cannot run: their program, an option, a word or a file is not there."""
    found, short = [], dict(SHORT.findall(page))
    for command in COMMAND.findall(page):
        first, rest = command.split(" ", 1)
        words = shlex.split(f"{short.get(first, first)} {rest}")
        if words[0] == "pytest":
            fault = " ".join(word for word in words[1:] if not (ROOT / word).is_file())
        else:
            fault = fault_of(words) if words[0] in PROGRAMS else fault_of_module(words)
        found += [f"{command}: {fault}"] if fault else []
    return found


def untold(page: str) -> list[str]:
    """The paper's equations and figures that no row of a table begins with."""
    rows = re.findall(r"^\| ([^|]+?) \|", page, re.MULTILINE)
    drawn = [row.split(",")[0] for row in rows if re.match(r"(Fig\. )?\d+\b", row)]
    figures = {int(number) for row in drawn for number in re.findall(r"\d+", row)}
    wanted = [f"Eq. {number}" for number in range(1, 9)] + ["Sect. 3.5", "Sect. 4.2", "Sect. 5"]
    lacking = [one for one in wanted if not any(row.startswith(f"{one},") for row in rows)]
    return lacking + [f"Fig. {number}" for number in FIGURES if number not in figures]


def test_what_the_page_names_is_there():
    page = PAGE.read_text(encoding="utf-8")
    assert missing(page) == []
    assert len(NAMED.findall(page)) > 30


def test_what_the_page_shows_can_be_run():
    page = PAGE.read_text(encoding="utf-8")
    assert refused(page) == []
    assert len(COMMAND.findall(page)) > 30
    assert set(dict(SHORT.findall(page))) == {"FIGURE", "EVALUATE", "COMPARE"}


@pytest.mark.parametrize(
    ("command", "fault"),
    [
        ("python -m research.compare_all", "no module"),
        ("python -m research.timing --models paper", "--models"),
        ("anyprobe-train data test DIR", ""),
        ("anyprobe-train data tests DIR", "tests"),
        ("FIGURE 13 --real DIR", ""),
        ("FIGURE 11", "11"),
        ("pytest tests/judge/test_no.py tests/rules/test_paper_page.py", "tests/judge/test_no.py"),
        ("anyprobe-train run paper --dry-run 3", ""),
        ("anyprobe-train run paper --dry", "--dry"),
    ],
)
def test_a_command_that_cannot_run_is_found(command, fault):
    (found,) = refused(f"FIGURE is `python -m research.paper_designs.figures`.\n| x | `{command}` |") or [""]
    assert fault in found if fault else not found


def test_every_element_of_the_paper_has_a_row():
    page = PAGE.read_text(encoding="utf-8")
    assert untold(page) == []
    assert "## Table 1" in page
    assert "Section 4.1" in page


def test_planted_faults_are_found():
    page = "| `src/anyprobe/no.py` | `research/gallery.py`: `photograph`, `nothing` | `docs/explanation/paper.md` |"
    assert missing(page) == ["src/anyprobe/no.py", "research/gallery.py: nothing"]
    assert untold("| Eq. 1, a | x |\n| 6, losses | y |\n| Sect. 4.2, 80 photos | z |")[:2] == ["Eq. 2", "Eq. 3"]
    figures = untold("| 6, losses | y |")
    assert "Fig. 7" in figures
    assert "Fig. 6" not in figures

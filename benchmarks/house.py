"""python -m benchmarks.house [COMMIT]: the size of this repository, beside that of an earlier commit.

Lines are non-blank. Statements are AST nodes. Numbers are int and float literals other than -1, 0 to 4 and .5, in the
Python and JSON of src/anyprobe, without training and measured materials.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLAIN = {-1, 0, 1, 2, 3, 4, 0.5}
"""Numbers that need no reason."""
MEASURED = ("materials", "presets")
"""Keys of JSON, and names of modules, that hold measured materials."""


def tracked(root: Path, *patterns: str) -> list[Path]:
    """Return the files of a work tree's git that match patterns."""
    listed = subprocess.run(["git", "ls-files", "-z", *patterns], cwd=root, capture_output=True, text=True, check=True)
    return [root / name for name in listed.stdout.split("\0") if name and (root / name).is_file()]


def lines(files: Iterable[Path]) -> int:
    """Return the non-blank lines of files."""
    return sum(bool(line.strip()) for path in files for line in path.read_text(encoding="utf-8").splitlines())


def trees(files: Iterable[Path]) -> list[ast.Module]:
    """Return the syntax trees of Python files."""
    return [ast.parse(path.read_text(encoding="utf-8")) for path in files]


def statements(files: Iterable[Path]) -> int:
    """Return the statements of Python files, without docstrings."""
    nodes = (node for tree in trees(files) for node in ast.walk(tree) if isinstance(node, ast.stmt))
    return sum(not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)) for node in nodes)


def docstring_lines(files: Iterable[Path]) -> float:
    """Return the mean number of docstring lines of functions that have one."""
    kinds = ast.FunctionDef | ast.AsyncFunctionDef
    said = [ast.get_docstring(node) for tree in trees(files) for node in ast.walk(tree) if isinstance(node, kinds)]
    counted = [len(one.splitlines()) for one in said if one]
    return sum(counted) / max(len(counted), 1)


def numbers(files: Iterable[Path]) -> int:
    """Return how many literals of Python and JSON files need a reason."""
    total = 0
    for path in files:
        if path.suffix == ".json":
            found = list(_json_numbers(json.loads(path.read_text(encoding="utf-8"))))
        elif path.stem in MEASURED or "learning" in path.parts:
            found = []
        else:
            found = list(_python_numbers(ast.parse(path.read_text(encoding="utf-8"))))
        total += sum(value not in PLAIN for value in found)
    return total


def _python_numbers(tree: ast.Module) -> Iterator[float]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            yield node.value


def _json_numbers(value: object) -> Iterator[float]:
    if isinstance(value, dict):
        for key, one in value.items():
            if key not in MEASURED:
                yield from _json_numbers(one)
    elif isinstance(value, list):
        for one in value:
            yield from _json_numbers(one)
    elif type(value) in (int, float):
        yield value  # type: ignore[misc]


def table(root: Path) -> dict[str, str]:
    """Return each figure of a work tree by its name."""
    source = tracked(root, "src/anyprobe/*.py")
    train, tests = (
        tracked(root, "train/*.py"),
        tracked(root, "tests/*.py", "tests/*.mjs", "tests/*.js", "web/test/*.js"),
    )
    script = tracked(root, "web/src/*.js", "web/page/*.js")
    documents = [path for path in tracked(root, "*.md", "docs/*.ipynb") if "LICEN" not in path.name.upper()]
    return {
        "src/anyprobe: lines; files": f"{lines(source):,}; {len(source)}",
        "src/anyprobe: statements": f"{statements(source):,}",
        "src/anyprobe: docstring lines a function": f"{docstring_lines(source):.2f}",
        "train: lines; statements": f"{lines(train):,}; {statements(train):,}",
        "JavaScript, src and page: lines": f"{lines(script):,}",
        "tests: lines": f"{lines(tests):,}",
        "research: lines": f"{lines(tracked(root, 'research/*.py')):,}",
        "benchmarks: lines": f"{lines(tracked(root, 'benchmarks/*.py', 'benchmarks/*.mjs')):,}",
        "numbers in src/anyprobe": f"{numbers([*source, *tracked(root, 'src/anyprobe/*.json')]):,}",
        "words of documents and cards": f"{sum(len(path.read_text(encoding='utf-8').split()) for path in documents):,}",
    }


def at(commit: str) -> dict[str, str]:
    """Return the figures of a commit."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "tree"
        subprocess.run(["git", "worktree", "add", "--quiet", "--detach", place, commit], cwd=ROOT, check=True)
        try:
            return table(place)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", place], cwd=ROOT, check=True)


if __name__ == "__main__":
    columns = [at(commit) for commit in sys.argv[1:2]] + [table(ROOT)]
    for name in columns[0]:
        print(f"{name:<53}", *(f"{column[name]:>15}" for column in columns))

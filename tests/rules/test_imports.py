"""The front door stays narrow: what `import anyprobe` brings in, and what its names and commands are."""

from __future__ import annotations

import ast
import inspect
import json
import subprocess
import sys
from pathlib import Path

import pytest

import anyprobe
from anyprobe import errors
from anyprobe.cli.app import app

ROOT = Path(__file__).parents[2]
HEAVY = {"torch", "fastapi", "cv2", "trimesh", "cyclopts", "rich", "onnx", "pillow_heif"}
MAX_MEMORY_MIB = 150

commands = app.resolved_commands()


def test_import_loads_nothing_heavy():
    code = """
import json, sys
import anyprobe
try:  # not getrusage: its peak includes that of the process that started this one
    with open("/proc/self/status") as file:
        peak = next(int(line.split()[1]) / 1024 for line in file if line.startswith("VmHWM"))
except (OSError, StopIteration):
    peak = 0
print(json.dumps([sorted({name.split(".")[0] for name in sys.modules}), peak]))
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    loaded, peak = json.loads(ended.stdout)
    assert "anyprobe" in loaded
    assert HEAVY & set(loaded) == set()
    assert peak < MAX_MEMORY_MIB


def test_command_line_starts_without_torch():
    code = "import sys, anyprobe.cli.app; print({'torch', 'onnx', 'cv2', 'trimesh'} & set(sys.modules))"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert ended.stdout == "set()\n"


def test_all_is_sorted_and_complete():
    """Every public class and function of the front door is listed, and every error there is."""
    assert anyprobe.__all__ == sorted(set(anyprobe.__all__))
    tree = ast.parse(Path(anyprobe.__file__).read_text(encoding="utf-8"))
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom | ast.Import)
        for alias in node.names
    }
    assert set(anyprobe.__all__) == imported
    own = {name: kind for name, kind in vars(errors).items() if inspect.isclass(kind)}
    raised = {name for name, kind in own.items() if kind.__module__ == errors.__name__}
    assert raised <= set(anyprobe.__all__)
    for name in anyprobe.__all__:
        assert inspect.getdoc(getattr(anyprobe, name)), name


def test_errors_share_one_root():
    for name, kind in vars(errors).items():
        if inspect.isclass(kind) and kind.__module__ == errors.__name__:
            assert issubclass(kind, errors.AnyprobeError), name
            assert name in errors.__doc__


@pytest.mark.parametrize("name", sorted(name for name in commands if not name.startswith("-")))
def test_command_has_help(name):
    command = commands[name]
    assert command.help
    assert command.help.strip().endswith(".")
    for argument in command.assemble_argument_collection(parse_docstring=True):
        assert argument.children or argument.parameter.help, f"{name} {argument.name}"


@pytest.mark.parametrize("name", sorted(name for name in commands if not name.startswith("-")))
def test_command_is_in_the_documentation(name):
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    written = "\n".join(page.read_text(encoding="utf-8") for page in pages)
    assert f"anyprobe {name}" in written

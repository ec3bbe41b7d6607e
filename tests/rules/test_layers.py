"""Who may import whom: found in the source itself, imports inside functions included."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import anyprobe

SOURCE = Path(anyprobe.__file__).parent

ORDER = (
    "notices errors core light scatter given_material render files maps pictures export match detail masks hints "
    "estimate relight video serve learning.nets learning.dataset learning.evaluate learning.train "
    "learning.mask_network learning.whole_network cli __init__ __main__"
).split()
"""A part may import itself and the parts before it. What users run imports nothing of `learning`: it stands above."""

ONLY = {
    "torch": {
        *("render", "learning.nets", "learning.dataset", "learning.train", "cli"),
        *("learning.mask_network", "learning.whole_network"),
    },
    "onnxruntime": {"files"},
    "onnx": {"learning.train"},
    "rembg": {"masks"},
    "trimesh": {"files"},
    "rawpy": {"pictures"},
    "pillow_jxl": {"pictures"},
    "typer": {"cli"},
    "rich": {"cli", "learning.train"},
    "av": {"video"},
    "mitsuba": {"relight"},
    "drjit": {"relight"},
    "fastapi": {"serve"},
    "starlette": {"serve"},
    "uvicorn": {"cli", "serve"},
    "cryptography": {"serve"},
    "prometheus_client": {"serve"},
}
"""Packages that not every part may import."""

TORCH_INSIDE = {"cli": "need_torch", "render": "compile_kernel"}
"""Parts without torch but for one function: to see whether it is there, and to compile with it."""


@dataclass(frozen=True, kw_only=True)
class Import:
    """One import of one module: where it stands and what it asks for."""

    part: str
    place: str
    function: str
    module: str
    level: int


def imports_in(path: Path, root: Path) -> Iterator[Import]:
    relative = path.relative_to(root)
    part = part_of(relative.with_suffix("").parts)
    if relative.name == "__main__.py" and len(relative.parts) > 1:
        part = "cli"  # a command of its own

    def visit(node: ast.AST, function: str) -> Iterator[Import]:
        for child in ast.iter_child_nodes(node):
            inside = child.name if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef) else function
            found: list[tuple[str, int]] = []
            if isinstance(child, ast.Import):
                found = [(alias.name, 0) for alias in child.names]
            elif isinstance(child, ast.ImportFrom):
                module = child.module or ""
                # `from anyprobe import files` asks for a part, `from anyprobe import __version__` does not
                found = [(module, child.level)]
                if module in ("anyprobe", "anyprobe.learning"):
                    found = [(f"{module}.{alias.name}", child.level) for alias in child.names]
            for module, level in found:
                place = f"{relative}:{child.lineno}"
                yield Import(part=part, place=place, function=inside, module=module, level=level)
            yield from visit(child, inside)

    yield from visit(ast.parse(path.read_text(encoding="utf-8")), "")


def part_of(names: tuple[str, ...] | list[str]) -> str:
    """Return the part that a module within the package belongs to: a room, or a room of the learning wing."""
    return ".".join(names[:2]) if names[0] == "learning" else names[0]


def all_imports(root: Path) -> list[Import]:
    return [found for path in sorted(root.rglob("*.py")) for found in imports_in(path, root)]


def faults(root: Path) -> list[str]:
    """What is wrong, one line each."""
    wrong = []
    for one in all_imports(root):
        package, *rest = one.module.split(".")
        asked = part_of(rest or ["__init__"]) if package == "anyprobe" else ""
        if one.level:
            wrong.append(f"{one.place}: relative import of {one.module or '.'}")
        elif one.part not in ORDER:
            wrong.append(f"{one.place}: {one.part} has no place in the order")
        elif asked and asked not in ORDER:
            if asked != "__version__":
                wrong.append(f"{one.place}: {one.part} imports {one.module}, which has no place in the order")
        elif asked and ORDER.index(asked) > ORDER.index(one.part):
            wrong.append(f"{one.place}: {one.part} imports {asked}, which stands above it")
        elif one.part not in ONLY.get(package, {one.part}):
            wrong.append(f"{one.place}: {one.part} imports {package}")
        elif package == "torch" and one.function != TORCH_INSIDE.get(one.part, one.function):
            wrong.append(f"{one.place}: torch outside {TORCH_INSIDE[one.part]}")
    return wrong


def test_imports_point_downwards():
    assert faults(SOURCE) == []


def test_every_part_of_the_order_exists_and_no_other():
    found = {path.stem for path in SOURCE.glob("*.py")}
    found |= {path.parent.name for path in SOURCE.glob("*/__init__.py")} - {"learning"}
    found |= {f"learning.{path.parent.name}" for path in SOURCE.glob("learning/*/__init__.py")}
    assert found == set(ORDER)


def test_every_permission_is_used():
    """A package that a part no longer imports loses its permission."""
    used = {(one.module.split(".")[0], one.part) for one in all_imports(SOURCE)}
    granted = {(package, part) for package, parts in ONLY.items() for part in parts}
    assert granted - used == set()


@pytest.mark.parametrize(
    ("file", "code", "fault"),
    [
        ("core/a.py", "import anyprobe.light.b", "core imports light"),
        ("core/a.py", "from anyprobe.light import b", "core imports light"),
        ("core/a.py", "from anyprobe import files", "core imports files"),
        ("core/a.py", "import anyprobe", "core imports __init__"),
        ("estimate/a.py", "def f():\n    if True:\n        import torch.nn", "estimate imports torch"),
        (
            "estimate/a.py",
            "class A:\n    def f(self):\n        from anyprobe.learning.train import b",
            "imports learning.train",
        ),
        ("serve/a.py", "def f():\n    from anyprobe.learning import nets", "serve imports learning.nets"),
        ("cli/a.py", "from anyprobe.learning.train import b", None),
        ("learning/nets/a.py", "import anyprobe.learning.train.b", "learning.nets imports learning.train"),
        ("learning/nets/a.py", "import torch", None),
        ("learning/train/__main__.py", "import typer\nfrom anyprobe.cli import b", None),
        ("learning/train/a.py", "from . import b", "relative import"),
        ("learning/train/a.py", "from ..core import b", "relative import"),
        ("web/a.py", "import json", "web has no place"),
        ("cli/a.py", "import torch", "torch outside need_torch"),
        ("render/a.py", "def f():\n    import torch.nn", "torch outside compile_kernel"),
        ("cli/a.py", "from anyprobe.web import b", "no place in the order"),
        ("errors.py", "from anyprobe.core import b", "errors imports core"),
        ("files/a.py", "import json\nfrom anyprobe.errors import b\nfrom onnxruntime import c", None),
        ("estimate/a.py", "import onnxruntime", "estimate imports onnxruntime"),
        ("cli/a.py", "from anyprobe import __version__\ndef need_torch():\n    import torch", None),
    ],
)
def test_rule_names_a_planted_fault(tmp_path, file, code, fault):
    path = tmp_path / file
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(code)
    found = faults(tmp_path)
    assert len(found) == (0 if fault is None else 1)
    assert fault is None or fault in found[0]

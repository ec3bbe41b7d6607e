"""Who may import whom: found in the source itself, imports inside functions included."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from support.trees import tree_of

import anyprobe
import anyprobe_train

SOURCE = Path(anyprobe.__file__).parent
TRAIN = Path(anyprobe_train.__file__).parent

ORDER = (
    "notices errors core paper light scatter render files maps pictures export place match masks inputs "
    "estimate session relight video serve cli __init__ __main__ "
    "anyprobe_train.__init__ anyprobe_train.nets anyprobe_train.dataset "
    "anyprobe_train.evaluate anyprobe_train.assets anyprobe_train.world anyprobe_train.train anyprobe_train.paper "
    "anyprobe_train.mask_network anyprobe_train.light anyprobe_train.cli "
    "anyprobe_train.__main__"
).split()
"""A part may import itself and the parts before it: what users run imports nothing of `anyprobe_train`."""

ONLY = {
    "torch": {
        *("anyprobe_train.nets", "anyprobe_train.train", "anyprobe_train.cli"),
        *("anyprobe_train.paper", "anyprobe_train.mask_network"),
        "anyprobe_train.light",
    },
    "onnxruntime": {"files"},
    "onnx": {"anyprobe_train.train"},
    "trimesh": {"files", "anyprobe_train.assets"},
    "rawpy": {"pictures"},
    "astral": {"estimate"},
    "OpenImageIO": {"maps"},
    "cyclopts": {"cli", "anyprobe_train.cli"},
    "rich": {"cli", "anyprobe_train.train", "anyprobe_train.cli"},
    "av": {"video"},
    "cv2": {"video", "anyprobe_train.world"},
    "mitsuba": set(),
    "drjit": set(),
    "fastapi": {"serve"},
    "pebble": {"serve"},
    "pydantic": {"serve"},
    "starlette": {"serve"},
    "uvicorn": {"cli"},
    "cryptography": {"cli"},
    "prometheus_client": {"serve"},
}
"""Packages that not every part may import."""

TORCH_INSIDE = {"anyprobe_train.cli": "need_torch"}
"""Parts without torch but for one function: to see whether it is there."""

PACKAGES = ("anyprobe", "anyprobe_train")


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
    part = part_of([root.name, *relative.with_suffix("").parts])

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
                if module in ("anyprobe", "anyprobe_train"):
                    found = [(f"{module}.{alias.name}", child.level) for alias in child.names]
            elif isinstance(child, ast.Call) and getattr(child.func, "id", "") == "optional":
                found = [(one.value, 0) for one in child.args[:1] if isinstance(one, ast.Constant)]
            for module, level in found:
                place = f"{relative}:{child.lineno}"
                yield Import(part=part, place=place, function=inside, module=module, level=level)
            yield from visit(child, inside)

    yield from visit(tree_of(path), "")


def part_of(names: Sequence[str]) -> str:
    """Return the part that a dotted name belongs to: a room of `anyprobe`, or one of `anyprobe_train` with its name."""
    package, *rest = names
    if package not in PACKAGES:
        return ""
    room = rest[0] if rest else "__init__"
    return room if package == "anyprobe" else f"{package}.{room}"


def all_imports(root: Path) -> list[Import]:
    return [found for path in sorted(root.rglob("*.py")) for found in imports_in(path, root)]


def faults(root: Path) -> list[str]:
    """What is wrong, one line each."""
    wrong = []
    for one in all_imports(root):
        package, asked = one.module.split(".")[0], part_of(one.module.split("."))
        if one.level:
            wrong.append(f"{one.place}: relative import of {one.module or '.'}")
        elif one.part not in ORDER:
            wrong.append(f"{one.place}: {one.part} has no place in the order")
        elif asked and asked not in ORDER:
            if not asked.endswith("__version__"):
                wrong.append(f"{one.place}: {one.part} imports {one.module}, which has no place in the order")
        elif asked and ORDER.index(asked) > ORDER.index(one.part):
            wrong.append(f"{one.place}: {one.part} imports {asked}, which stands above it")
        elif one.part not in ONLY.get(package, {one.part}):
            wrong.append(f"{one.place}: {one.part} imports {package}")
        elif package == "torch" and one.function != TORCH_INSIDE.get(one.part, one.function):
            wrong.append(f"{one.place}: torch outside {TORCH_INSIDE[one.part]}")
    return wrong


def test_imports_point_downwards():
    assert faults(SOURCE) + faults(TRAIN) == []


def test_every_part_of_the_order_exists_and_no_other():
    found = {
        part_of([root.name, *path.relative_to(root).parts[:1]]).removesuffix(".py")
        for root in (SOURCE, TRAIN)
        for path in root.rglob("*.py")
    }
    assert found == set(ORDER)


def test_every_permission_is_used():
    """A package that a part no longer imports loses its permission."""
    used = {(one.module.split(".")[0], one.part) for one in all_imports(SOURCE) + all_imports(TRAIN)}
    granted = {(package, part) for package, parts in ONLY.items() for part in parts}
    assert granted - used == set()

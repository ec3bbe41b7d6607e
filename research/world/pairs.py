"""The world test set: path-traced pairs under dataset.distributions; objects shade and mirror themselves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.pair import Pair, Trace
from anyprobe_train.dataset.recipe import Recipe, read_recipes
from research.kept_pairs import kept_pairs
from research.left_out import load_left_out
from research.painted import is_painted, painted
from research.path_traced import open_mitsuba, trace_mesh

PATHS = 128
"""Through each pixel; the noise that is left is a camera's in a dim room."""
COUNT = 200
PARTS = {"test": "test.txt", "left-out": "left_out.txt"}
"""The list of each part: of held-out maps and shapes; of the training assets that no shipped weights learn from,
to choose models by."""


def recipes_of(part: str) -> list[Recipe]:
    """The recipes of a part, which never change."""
    if part not in PARTS:
        raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}; choose one of them")
    return read_recipes(Path(__file__).parent / PARTS[part])


def store_of(data: Path, part: str) -> AssetStore:
    """The maps and shapes of a part, from a data folder with hdri and meshes."""
    return load_left_out(data) if part == "left-out" else load_asset_store(data, "test", commercial_only=False)


def world_pairs(data: Path, part: str, kept: Path | None, trace: Trace | None = None) -> Iterator[Pair]:
    """The pairs of a part in order; those that kept / part lacks are rendered and put there.

    trace: in the place of Mitsuba.
    Raises:
        MissingExtra: some have to be rendered, and Mitsuba cannot run.
    """
    folder = None if kept is None else kept / part
    yield from kept_pairs(recipes_of(part), store_of(data, part), folder, trace=trace or _trace)


def _trace(recipe, mesh, camera, radiance, material):
    """Trace a pair's photo; painted objects get a mild texture, which the irradiance leaves out."""
    open_mitsuba()
    coat = painted(material, mesh, recipe.rng().spawn(1)[0]) if is_painted(recipe) else material
    return trace_mesh(mesh, camera, radiance, coat, num_paths=PATHS)

"""World (noun): path-traced test pairs under the priors of dataset.priors: objects shade and mirror themselves.

    python -m anyprobe.evaluate.world --data DATA --kept runs/world [--part left-out]

renders the pairs of a part that the folder lacks, one file each, by Mitsuba 3 (`.[judge]`) and an LLVM of 17 or newer.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from importlib import resources
from pathlib import Path

from anyprobe.dataset.asset_store import AssetStore, load_asset_store, load_left_out
from anyprobe.dataset.pair import Pair, Trace
from anyprobe.dataset.plan import world_recipes
from anyprobe.dataset.recipe import Recipe
from anyprobe.errors import InputError
from anyprobe.evaluate.test_sets import kept_pairs, read_recipes, write_recipes
from anyprobe.relight.path_traced import open_mitsuba, trace_mesh

PATHS = 128
"""Through each pixel; what noise is left is a camera's in a dim room."""
COUNT, SEED = 200, 2026
PARTS = {"test": "world.txt", "left-out": "world_left_out.txt"}
"""Of held-out maps and shapes; of the training assets that no shipped weights learn from, to choose models by."""


def recipes_of(part: str) -> list[Recipe]:
    """The recipes of a part, which never change."""
    if part not in PARTS:
        raise InputError(f"part {part!r}: expected one of {', '.join(PARTS)}; choose one of them")
    return read_recipes(Path(str(resources.files("anyprobe") / "evaluate" / PARTS[part])))


def stock_of(data: Path, part: str) -> AssetStore:
    """The maps and shapes of a part, from a data folder with hdri and meshes."""
    return (
        load_left_out(data) if part == "left-out" else load_asset_store(data, "test", commercial_only=False)
    )


def world_pairs(data: Path, part: str, kept: Path | None, trace: Trace | None = None) -> Iterator[Pair]:
    """The pairs of a part in order; those that kept / part lacks are rendered and put there.

    trace: in the place of Mitsuba.
    Raises:
        MissingExtra: some have to be rendered, and Mitsuba cannot run.
    """
    folder = None if kept is None else kept / part
    yield from kept_pairs(recipes_of(part), stock_of(data, part), folder, trace=trace or _trace)


def _trace(mesh, camera, radiance, material):
    open_mitsuba()
    return trace_mesh(mesh, camera, radiance, material, num_paths=PATHS)


def write_lists(data: Path, folder: Path) -> None:
    """The lists of recipes as they were drawn, once."""
    for part, name in PARTS.items():
        write_recipes(folder / name, world_recipes(stock_of(data, part), COUNT, SEED))


def main() -> None:
    """The command above."""
    parser = argparse.ArgumentParser(prog="python -m anyprobe.evaluate.world", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder with hdri and meshes")
    parser.add_argument("--kept", type=Path, required=True, help="folder for the pairs")
    parser.add_argument("--part", choices=list(PARTS), default="test")
    given = parser.parse_args()
    for count, pair in enumerate(world_pairs(given.data, given.part, given.kept), 1):
        print(f"{count} {pair.recipe.key} {pair.map_name} {pair.shape_name}", flush=True)


if __name__ == "__main__":
    main()

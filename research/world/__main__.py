"""python -m research.world: render the pairs of a part of the world test set that a folder lacks, one file each.

Needs Mitsuba 3 (`.[judge]`) and an LLVM of 17 or newer.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from research.world.pairs import PARTS, world_pairs


def world(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri and meshes.")],
    kept: Annotated[Path, Parameter(help="Folder for the pairs.")],
    part: Annotated[str, Parameter(help=f"One of {', '.join(PARTS)}.")] = "test",
) -> None:
    """Render what is missing and print one line a pair."""
    for count, pair in enumerate(world_pairs(data, part, kept), 1):
        print(f"{count} {pair.recipe.key} {pair.map_name} {pair.shape_name}")


if __name__ == "__main__":
    run_command(world)

"""python -m research.world.whole render: path trace the whole photos of a part that a folder lacks, one file each.

Needs Mitsuba 3 (`.[judge]`) and an LLVM of 17 or newer.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from research.world.whole_photos import COUNT, PARTS, whole_photos

app = typer.Typer(help=__doc__, no_args_is_help=True)
Data = Annotated[Path, typer.Option(help="Folder with hdri and meshes.")]
Kept = Annotated[Path, typer.Option(help="Folder for the renders.")]
Part = Annotated[str, typer.Option(help=f"One of {', '.join(PARTS)}.")]


@app.command()
def render(data: Data, kept: Kept, part: Part = "test", count: int = COUNT) -> None:
    """Render what is missing and print one line a photo."""
    for number, photo in enumerate(whole_photos(data, part, kept, count), 1):
        height, width, _ = photo.picture.shape
        typer.echo(
            f"{number} {photo.recipe.key} {photo.map_name} {photo.shape_name} {width} x {height}, pitch "
            f"{photo.pitch_deg:.0f} deg {photo.cut_out}"
        )


@app.callback()
def main() -> None:
    """Whole photos."""


if __name__ == "__main__":
    app()

"""Draw a figure of the paper again: python -m research.paper_designs.figures 6|7|12|13|14|15|16.

6, 12, 13 and 14 are of the half-size designs that the history of this clone keeps; 15 and 16 are of the shipped
`paper`. With --real, 12 and 15 are of photos of yours, and go to runs/, which git ignores; 13 adds the angles to their
lamps.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from anyprobe.cli.app import main as run_command
from anyprobe.errors import InputError

HERE = Path(__file__).parent
UNCOMMITTED = Path("runs/paper_figures")
FIGURES = ("6", "7", "12", "13", "14", "15", "16")


def main(
    figure: Annotated[str, typer.Argument(help=f"The paper's number: {', '.join(FIGURES)}.")],
    data: Annotated[Path, typer.Option(help="Folder with hdri/test and meshes/test, for 7, 12, 14 and 16.")] = Path(
        "data"
    ),
    kept: Annotated[Path, typer.Option(help="Folder that keeps the pairs of 12 and 14.")] = Path("runs/frozen_pairs"),
    real: Annotated[
        list[Path] | None, typer.Option(help="Folder of real photos with NAME_mask.png or lights.csv; repeat for more.")
    ] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for the picture.")] = None,
) -> None:
    """Draw one figure."""
    if figure not in FIGURES:
        raise InputError(
            f"expected a figure of {', '.join(FIGURES)}, got another; see docs/explanation/paper.md", source=figure
        )
    to = out or (UNCOMMITTED if real and figure in ("12", "15") else HERE)
    if figure == "7":
        from research.paper_designs.figures.losses import draw_targets

        return draw_targets(data, to)
    if figure == "15":
        from research.paper_designs.figures import mixed

        return mixed.draw_real(real, to) if real else mixed.draw_scenes(to)
    if figure == "16":
        from research.paper_designs.figures.textured import draw_textured

        return draw_textured(data, to)
    from research.paper_designs.figures import half_size, losses, relit, rivals

    if figure == "6":
        return losses.draw_losses(half_size.kept_losses(), to)
    if figure == "13":
        return rivals.draw_bars(real or [], to)
    half = half_size.HalfSize()
    if figure == "12" and real:
        return rivals.draw_real(half, real, to)
    if figure == "12":
        return rivals.draw_synthetic(half, half_size.shown_pairs(data, 3, kept), to)
    return relit.draw_relit(half, half_size.shown_pairs(data, 2, kept), to)


if __name__ == "__main__":
    run_command(lambda: typer.run(main))

"""python -m research.second_stage: commands first-stage, train, measure; see README."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import torch
import typer

from anyprobe.cli.app import main as run_command
from research.second_stage.first_stage import make_seen_surfaces
from research.second_stage.measure import tables
from research.second_stage.train import SecondConfig, train

NAME = "second_stage"
FIRST = Path("training/lift.pt")

Data = Annotated[Path, typer.Option(help="Folder with hdri and meshes.")]
Runs = Annotated[Path, typer.Option(help="The run is kept in its folder second_stage.")]
First = Annotated[Path, typer.Option(help="Weights of the first stage.")]

app = typer.Typer(no_args_is_help=True)


@app.command()
def first_stage(
    data: Data,
    runs: Runs = Path("runs"),
    first: First = FIRST,
    steps: Annotated[int, typer.Option(min=1, help="Batches of 32 photos.")] = 84,
) -> None:
    """Estimate the normals of training surfaces with the first stage, once."""
    make_seen_surfaces(data, runs / NAME, first, steps)


@app.command("train")
def train_command(
    data: Data,
    runs: Runs = Path("runs"),
    workers: Annotated[int, typer.Option(min=0, help="Processes that make batches.")] = 1,
    stop_after: Annotated[int | None, typer.Option(min=1, help="Stop at this step.")] = None,
) -> None:
    """Train, or resume."""
    train(SecondConfig(), data, runs / NAME, stop_after, workers)


@app.command()
def measure(
    data: Data,
    runs: Runs = Path("runs"),
    first: First = FIRST,
    frozen: Annotated[bool, typer.Option("--frozen", help="On the frozen test set, to report.")] = False,
    pairs: Annotated[int | None, typer.Option(min=1, help="The first N only.")] = None,
    kept: Annotated[Path | None, typer.Option(help="Folder that keeps rendered pairs.")] = None,
) -> None:
    """Print the second stage's figures beside those of `lift`."""
    typer.echo("\n".join(tables(data, runs / NAME / "checkpoint.pt", first, frozen, pairs, kept)))


if __name__ == "__main__":
    torch.set_num_threads(1)
    run_command(app)

"""python -m research.whole_network: commands pairs, train, export.

Scores of an export: python -m research.world.whole score --model FOLDER, with light.onnx beside whole.onnx.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from anyprobe.cli.app import main as run_command
from anyprobe.train.checkpoint import keep_apart, save_init_weights
from research.whole_network.export import export_whole
from research.whole_network.pairs import make_pairs
from research.whole_network.train import WholeRunConfig, train_whole

RUNS = Path("runs")
WEIGHTS = Path("src/anyprobe/weights/lift")

app = typer.Typer(no_args_is_help=True)
Pairs = Annotated[Path, typer.Option(help="Folder of the pairs.")]


@app.command()
def pairs(
    data: Annotated[Path, typer.Option(help="Folder with hdri and meshes.")],
    kept: Annotated[Path, typer.Option(help="Folder of the renders, see research.world.whole.")],
    out: Pairs = RUNS / "whole-pairs",
    scenes: Annotated[int, typer.Option(min=1, help="So many.")] = 4096,
    first: Annotated[int, typer.Option(min=0, help="From this one on.")] = 0,
    part: Annotated[str, typer.Option(help="Of research.world.whole: train, or lamps.")] = "train",
) -> None:
    """Make the pairs that are missing of path-traced scenes; those of scenes that are not rendered are rendered."""
    for path in make_pairs(data, kept, out, scenes, part, first):
        typer.echo(path)


@app.command()
def train(
    pairs: Pairs = RUNS / "whole-pairs",
    runs: Annotated[Path, typer.Option(help="Folder for checkpoints and logs.")] = RUNS,
    steps: Annotated[int | None, typer.Option(min=1, help="Steps in all; the run's own number otherwise.")] = None,
    init_weights: Annotated[
        Path | None, typer.Option(help="Weights to begin from, kept by export --keep; the same ones to resume.")
    ] = None,
) -> None:
    """Train the network that is given the whole photo; resumes exactly."""
    config = WholeRunConfig() if steps is None else replace(WholeRunConfig(), steps=steps)
    typer.echo(train_whole(config, pairs=pairs, runs=runs, start=init_weights))


@app.command()
def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or its checkpoint.")] = RUNS / "whole",
    to: Annotated[Path, typer.Option("-o", "--out", metavar="FOLDER", help="Folder for whole.onnx.")] = WEIGHTS,
    keep: Annotated[
        Path | None, typer.Option(help="Also keep the weights in this .pt, to begin another training from.")
    ] = None,
) -> None:
    """Export a trained run as ONNX and check it against torch."""
    checkpoint = run / "checkpoint.pt" if run.is_dir() else run
    if keep is not None:
        keep_apart(checkpoint, keep)
    typer.echo(f"{to / 'whole.onnx'}: within {export_whole(checkpoint, to):.2g} of torch")
    if keep is not None:
        save_init_weights(checkpoint, keep, holds="net")
        typer.echo(keep)


if __name__ == "__main__":
    run_command(app)

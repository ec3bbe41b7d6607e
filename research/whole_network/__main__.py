"""python -m research.whole_network: commands train, export; pairs come from research.scenes.

Scores of an export: python -m research.world.whole score --model FOLDER, with light.onnx beside whole.onnx.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from anyprobe.cli.app import main as run_command
from anyprobe.train.checkpoint import keep_apart, save_init_weights
from research.whole_network.export import export_whole
from research.whole_network.looks import load_light_graph, make_looks, missing_looks
from research.whole_network.train import WholeRunConfig, looks_of, train_whole

RUNS = Path("runs")
WEIGHTS = Path("src/anyprobe/weights/lift")

app = typer.Typer(no_args_is_help=True)
Pairs = Annotated[Path, typer.Option(help="Folder of the pairs, see research.scenes.")]


@app.command()
def train(
    pairs: Pairs = RUNS / "scenes",
    left_out: Annotated[
        Path | None, typer.Option(help="Folder of pairs of the left-out part, scored while training.")
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder for checkpoints and logs.")] = RUNS,
    steps: Annotated[int | None, typer.Option(min=1, help="Steps in all; the run's own number otherwise.")] = None,
    growing: Annotated[bool, typer.Option(help="Also learn from pairs that are added meanwhile.")] = False,
    name: Annotated[str, typer.Option(help="Of the run's folder.")] = "whole",
    init_weights: Annotated[
        Path | None, typer.Option(help="Weights to begin from, kept by export --keep; the same ones to resume.")
    ] = None,
) -> None:
    """Train the network that is given the whole photo; resumes exactly."""
    config = WholeRunConfig(name=name, growing=growing)
    config = config if steps is None else replace(config, steps=steps)
    typer.echo(train_whole(config, pairs=pairs, runs=runs, start=init_weights, left_out=left_out))


@app.command()
def looks(
    pairs: Pairs = RUNS / "scenes",
    light: Annotated[Path, typer.Option(help="Weights of LightNet.")] = Path("training/lift.pt"),
    wait: Annotated[bool, typer.Option(help="Go on waiting for further pairs.")] = False,
) -> None:
    """Compute what LightNet answers to pairs, which training needs, into PAIRS-looks; goes on where it stopped."""
    graph = load_light_graph(light)
    while True:
        for source, target in missing_looks(pairs, looks_of(pairs)):
            make_looks(source, target, graph)
            typer.echo(target)
        if not wait:
            break
        time.sleep(20)


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

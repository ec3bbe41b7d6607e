"""python -m anyprobe_train.whole_network: commands train, export; pairs come from research.scenes.

Scores of an export: python -m research.world.whole score --model FOLDER, with light.onnx in it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.cli.options import bounded
from anyprobe_train.cli.run import Keep, Runs, Steps
from anyprobe_train.train.checkpoint import keep_apart, save_weights
from anyprobe_train.whole_network.whole_export import export_photo_net
from anyprobe_train.whole_network.whole_training import WholeRunConfig, load_photo_net, train_whole

ALL_RUNS = Path("runs")
WEIGHTS = Path("src/anyprobe/weights/lift")

app = new_app(__doc__)
Pairs = Annotated[Path, Parameter(help="Folder of the pairs, see research.scenes.")]


@app.command()
def train(
    *,
    init_weights: Annotated[
        list[Path], Parameter(help="Weights to begin from, repeat for those of each part; the same ones to resume.")
    ],
    pairs: Pairs = ALL_RUNS / "scenes",
    left_out: Annotated[
        Path | None, Parameter(help="Folder of pairs of the left-out part, scored while training.")
    ] = None,
    runs: Runs = ALL_RUNS,
    steps: Steps = None,
    growing: Annotated[bool, Parameter(help="Also learn from pairs that are added meanwhile.")] = False,
    name: Annotated[str, Parameter(help="Of the run's folder.")] = "whole",
    batch: Annotated[int | None, Parameter(help="Photos a step; the run's own number otherwise."), bounded(2)] = None,
    object_rate: Annotated[
        float | None, Parameter(help="Learning rate of what sees the object, in shares; 0: it stays."), bounded(0.0)
    ] = None,
    device: Annotated[str, Parameter(help="Of torch.")] = "cpu",
) -> None:
    """Train the networks that see the object and the whole photo; resumes exactly."""
    config = WholeRunConfig(name=name, growing=growing)
    config = replace(
        config,
        steps=steps or config.steps,
        batch=batch or config.batch,
        object_rate=config.object_rate if object_rate is None else object_rate,
    )
    path = train_whole(config, pairs=pairs, runs=runs, start=init_weights, left_out=left_out, device=device)
    print(path)


@app.command()
def export(
    run: Annotated[Path, Parameter(name="RUN", help="A run's folder, or its checkpoint.")] = ALL_RUNS / "whole",
    /,
    *,
    to: Annotated[Path, Parameter(name=("--out", "-o"), metavar="FOLDER", help="Folder for light.onnx.")] = WEIGHTS,
    start: Annotated[
        list[Path] | None, Parameter(help="Weights the run began from, for a mean with them; repeat for more.")
    ] = None,
    share: Annotated[float, Parameter(help="How much of the mean those are."), bounded(0.0, 1.0)] = 0.5,
    keep: Keep = None,
) -> None:
    """Export a trained run as ONNX and check it against torch."""
    checkpoint = run / "checkpoint.pt" if run.is_dir() else run
    if keep is not None:
        keep_apart(checkpoint, keep)
        save_weights(load_photo_net(checkpoint, start or (), share)[0].state_dict(), keep)
    print(f"{to}/light.onnx: within {export_photo_net(checkpoint, to, start or (), share):.2g} of torch")
    if keep is not None:
        print(keep)


if __name__ == "__main__":
    run_command(app)

"""python -m research.export_weights FOLDER --data DATA: the graph of `lift` as it ships."""

from __future__ import annotations

from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.estimate.runtime import Models, weights_folder
from anyprobe_train.train.export_onnx import Sureness, export_graphs
from research.export_weights.calibrate import calibrate, calibrate_errors
from research.export_weights.checkpoints import kept_checkpoint, mean_checkpoint
from research.left_out import left_out_pairs, left_out_world_pairs


def main(
    to: Annotated[Path, Parameter(name="FOLDER", help="Folder for light.onnx.")],
    /,
    *,
    data: Annotated[Path, Parameter(help="Folder with assets that no weights learn from, to calibrate on.")],
    runs: Annotated[Path, Parameter(help="Folder of the trained runs.")] = Path("runs"),
    kept: Annotated[
        Path | None, Parameter(help="Weights of the run whose graph ships, instead of its checkpoint.")
    ] = None,
    mean_with: Annotated[
        Path | None, Parameter(help="Kept weights from which the run began, to take the mean with.")
    ] = None,
) -> None:
    """Export the run `lift`, calibrated on pairs of assets that no weights learn from."""
    checkpoint = runs / "lift" / "checkpoint.pt"
    with TemporaryDirectory() as scratch:
        if kept is not None:
            graph = weights_folder("lift") / "light.onnx"
            checkpoint = kept_checkpoint(kept, graph, Path(scratch) / "kept.pt")
        if mean_with is not None:
            checkpoint = mean_checkpoint(checkpoint, mean_with, Path(scratch) / "mean.pt")
        folder, pairs = Path(scratch) / "graphs", runs / "cache" / "left_out"
        sureness = calibrated(checkpoint, folder, data, pairs)
        print("confidence: logit times {:.3g}, plus {:.3g}".format(*sureness.logit))
        print("errors of reflectance, level, colour: times {:.3g}, {:.3g}, {:.3g}".format(*sureness.errors))
        off = export_graphs(checkpoint, to, sureness)["light"]
        print(f"{to / 'light.onnx'}: within {off:.2g} of torch")


def calibrated(checkpoint: Path, folder: Path, data: Path, kept: Path) -> Sureness:
    """How a checkpoint's claims have to be corrected; its graph as learned is written into folder."""
    export_graphs(checkpoint, folder)
    models = Models(str(folder))
    clean = list(left_out_pairs(data, kept))
    errors = calibrate_errors(models, chain(clean, left_out_world_pairs(data, kept)))
    return Sureness(logit=calibrate(models, clean), errors=errors)


if __name__ == "__main__":
    run_command(main)

"""python -m anyprobe_train.mask_network: commands train, export."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.errors import InputError
from anyprobe_train.cli.run import Data, DryRun, Keep, Runs, Steps
from anyprobe_train.mask_network.mask_export import export_mask
from anyprobe_train.mask_network.mask_training import MaskRunConfig, small_mask_run, train_mask
from anyprobe_train.train.checkpoint import save_init_weights

RUNS_DIR = Path("runs")
WEIGHTS = Path("src/anyprobe/weights/mask")

app = new_app(__doc__)


@app.command()
def train(
    *,
    data: Data = None,
    runs: Runs = RUNS_DIR,
    steps: Steps = None,
    dry_run: DryRun = None,
    init_weights: Annotated[
        Path | None, Parameter(help="Weights to begin from, kept by export --keep; the same ones to resume.")
    ] = None,
) -> None:
    """Train the network that proposes the object; resumes exactly."""
    if dry_run is not None and steps is not None:
        raise InputError("expected one of them, got both", subject=("steps", "dry_run"))
    config = MaskRunConfig() if steps is None else replace(MaskRunConfig(), steps=steps)
    if dry_run is not None:
        config = small_mask_run(config, dry_run)
        (runs / config.name / "checkpoint.pt").unlink(missing_ok=True)
    print(train_mask(config, data=data, runs=runs, start=init_weights))


@app.command()
def export(
    run: Annotated[Path, Parameter(name="RUN", help="A run's folder, or its checkpoint.")] = RUNS_DIR / "mask",
    /,
    *,
    to: Annotated[Path, Parameter(name=("--out", "-o"), metavar="FOLDER", help="Folder for mask.onnx.")] = WEIGHTS,
    keep: Keep = None,
) -> None:
    """Export a trained run as ONNX and check it against torch."""
    checkpoint = run / "checkpoint.pt" if run.is_dir() else run
    if keep is not None:
        save_init_weights(checkpoint, keep)
    print(f"{to / 'mask.onnx'}: within {export_mask(checkpoint, to):.2g} of torch")
    if keep is not None:
        print(keep)


if __name__ == "__main__":
    run_command(app)

"""anyprobe-train run and export: from assets to networks, from networks to the package."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from anyprobe.cli.options import bounded
from anyprobe.core.spelling import did_you_mean
from anyprobe.errors import InputError, MissingExtra

_RUNS = Path("runs")
LIGHT_RUN, PAPER_RUN = "light", "paper"
"""Runs of the light network and of the paper's three, which have loops of their own."""
Data = Annotated[Path | None, Parameter(help="Folder with hdri/train and meshes/train.")]
Runs = Annotated[Path, Parameter(help="Folder for checkpoints, logs and caches.")]
Steps = Annotated[int | None, Parameter(help="Total number of steps; default: the run's."), bounded(1)]
DryRun = Annotated[int | None, Parameter(metavar="N", help="N small steps, to test a machine."), bounded(1)]
Keep = Annotated[Path | None, Parameter(help="Also save the weights to this .pt, for run --init-weights.")]
RunName = Annotated[str, Parameter(name="RUN", help="Named run; see docs/how-to/training.md.")]


def run(
    name: RunName = LIGHT_RUN,
    /,
    *,
    data: Data = None,
    runs: Runs = _RUNS,
    steps: Steps = None,
    dry_run: DryRun = None,
    init_weights: Annotated[
        Path | None,
        Parameter(help="Initial weights, written by anyprobe-train export --keep; give the same ones to resume."),
    ] = None,
    device: Annotated[str, Parameter(help="cpu or cuda.")] = "cpu",
    workers: Annotated[
        int, Parameter(help="Processes that make pairs ahead, so that a GPU need not wait."), bounded(0)
    ] = 0,
    setting: Annotated[str, Parameter(help="Sizes of the run paper: full, quarter, short, small or tiny.")] = "full",
) -> None:
    """Train a model on photos of a world that is made meanwhile. An interrupted run resumes exactly."""
    _refuse_mask(name)
    need_torch("training")
    if name == PAPER_RUN:
        from anyprobe_train.paper.reproduce import reproduce
        from anyprobe_train.paper.settings import setting_named

        if steps is not None or init_weights is not None:
            text = "expected neither with the run paper, whose setting says its steps, got one"
            raise InputError(text, subject=("steps", "init_weights"))
        if not reproduce(data, runs / name, setting_named(setting), threads=2, device=device, stop=dry_run):
            sys.exit(143)
        return
    if name != LIGHT_RUN:
        names = (LIGHT_RUN, PAPER_RUN)
        raise InputError(f"expected one of {', '.join(names)}{did_you_mean(name, names)}", source=f"run {name!r}")
    if steps is not None and dry_run is not None:
        raise InputError("expected one of them, got both", subject=("steps", "dry_run"))
    from anyprobe_train.light.command import train_light

    print(train_light(data, runs, steps, dry_run, device, workers, init_weights))


def _refuse_mask(name: str) -> None:
    if name == "mask":  # another command trains and exports it
        text = "expected a run that estimates light, got the network that proposes the object; "
        text += "train and export it in a clone, with python -m anyprobe_train.mask_network"
        raise InputError(text, source=f"run {name!r}")


def export(
    to: Annotated[Path, Parameter(name="FOLDER", help="Folder for the .onnx graphs.")],
    name: RunName = LIGHT_RUN,
    /,
    *,
    runs: Annotated[Path, Parameter(help="Folder of the trained runs.")] = _RUNS,
    keep: Keep = None,
) -> None:
    """Export a trained run as ONNX. The graphs are checked against torch."""
    _refuse_mask(name)
    need_torch("training")
    if name == PAPER_RUN:
        text = "expected one network, got the paper's three; export them with anyprobe-train paper --graphs FOLDER"
        raise InputError(text, source=f"run {name!r}")
    from anyprobe_train.light.light_export import export_lean
    from anyprobe_train.train.checkpoint import save_init_weights

    checkpoint = runs / name / "checkpoint.pt"
    if keep is not None:  # first: what training made is not lost where the export is refused
        save_init_weights(checkpoint, keep, with_pairs=True)
    print(f"{to / 'light.onnx'}: within {export_lean(checkpoint, to / 'light.onnx'):.2g} of torch")


def need_torch(what: str) -> None:
    """Raise MissingExtra if PyTorch is not installed; what: the purpose it is needed for."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise MissingExtra("torch", "torch", what, error, folder="./train") from error

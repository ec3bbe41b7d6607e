"""anyprobe-train run and export: from assets to networks, from networks to the package."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from anyprobe.cli.options import bounded
from anyprobe.errors import InputError, MissingExtra

_RUNS = Path("runs")
Data = Annotated[Path | None, Parameter(help="Folder with hdri/train and meshes/train.")]
RunName = Annotated[Literal["light", "mask", "paper"], Parameter(name="RUN", help="See docs/how-to/training.md.")]
"""Runs of the light network, of the network that proposes the object, and of the paper's three."""


def run(
    name: RunName = "light",
    /,
    *,
    data: Data = None,
    runs: Annotated[Path, Parameter(help="Folder for checkpoints, logs and caches.")] = _RUNS,
    steps: Annotated[int | None, Parameter(help="Total number of steps; default: the run's."), bounded(1)] = None,
    dry_run: Annotated[int | None, Parameter(metavar="N", help="N small steps, to test a machine."), bounded(1)] = None,
    init_weights: Annotated[
        Path | None,
        Parameter(help="Initial weights, written by anyprobe-train export --keep; give the same ones to resume."),
    ] = None,
    device: Annotated[str, Parameter(help="cpu or cuda; of the run mask cpu alone.")] = "cpu",
    workers: Annotated[
        int, Parameter(help="Processes that make pairs ahead, so that a GPU need not wait."), bounded(0)
    ] = 0,
    setting: Annotated[str, Parameter(help="Sizes of the run paper: full, quarter, short, small or tiny.")] = "full",
) -> None:
    """Train a model on photos of a world that is made meanwhile. An interrupted run resumes exactly."""
    need_torch("training")
    if name == "paper":
        from anyprobe_train.paper.reproduce import reproduce
        from anyprobe_train.paper.settings import setting_named

        if steps is not None or init_weights is not None:
            text = "expected neither with the run paper, whose setting says its steps, got one"
            raise InputError(text, subject=("steps", "init_weights"))
        if not reproduce(data, runs / name, setting_named(setting), threads=2, device=device, stop=dry_run):
            sys.exit(143)
        return
    if steps is not None and dry_run is not None:
        raise InputError("expected one of them, got both", subject=("steps", "dry_run"))
    if name == "mask":
        from anyprobe_train.mask_network.mask_training import MaskRunConfig, small_mask_run, train_mask

        if device != "cpu":
            raise InputError("expected cpu, which the run mask learns on", subject="device", source=device)
        config = MaskRunConfig() if steps is None else replace(MaskRunConfig(), steps=steps)
        if dry_run is not None:
            config = small_mask_run(config, dry_run)
            (runs / config.name / "checkpoint.pt").unlink(missing_ok=True)
        print(train_mask(config, data=data, runs=runs, start=init_weights))
        return
    from anyprobe_train.light.light_run import train_light

    print(train_light(data, runs, steps, dry_run, device, workers, init_weights))


def export(
    to: Annotated[Path, Parameter(name="FOLDER", help="Folder for the .onnx graphs.")],
    name: RunName = "light",
    /,
    *,
    runs: Annotated[Path, Parameter(help="Folder of the trained runs.")] = _RUNS,
    keep: Annotated[Path | None, Parameter(help="Also save the weights to this .pt, for run --init-weights.")] = None,
) -> None:
    """Export a trained run as ONNX. The graphs are checked against torch."""
    need_torch("training")
    if name == "paper":
        text = "expected one network, got the paper's three; export them with anyprobe-train paper --graphs FOLDER"
        raise InputError(text, source=f"run {name!r}")
    from anyprobe_train.light.light_export import export_lean
    from anyprobe_train.mask_network.mask_export import export_mask
    from anyprobe_train.train.checkpoint import save_init_weights

    checkpoint, path = runs / name / "checkpoint.pt", to / f"{name}.onnx"
    if keep is not None:  # first: what training made is not lost where the export is refused
        save_init_weights(checkpoint, keep, with_pairs=name == "light")
    print(f"{path}: within {(export_lean if name == 'light' else export_mask)(checkpoint, path):.2g} of torch")


def need_torch(what: str) -> None:
    """Raise MissingExtra if PyTorch is not installed; what: the purpose it is needed for."""
    try:
        import torch  # noqa: F401
    except ImportError as error:
        raise MissingExtra("torch", "torch", what, error, folder="./train") from error

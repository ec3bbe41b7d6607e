"""anyprobe train and anyprobe weights: from assets to networks, from networks to the package."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from anyprobe.cli.options import need_torch
from anyprobe.errors import InputError

if TYPE_CHECKING:
    from anyprobe.train.config import RunConfig
    from anyprobe.train.dataloader import ShardSource

RUNS = Path("runs")
RunName = Annotated[str, typer.Argument(metavar="RUN", help="Named run; see docs/training.md.")]


def train(
    run: RunName = "lift",
    data: Annotated[
        Path | None, typer.Option(help="Folder with hdri/train and meshes/train; else our own maps and shapes.")
    ] = None,
    runs: Annotated[Path, typer.Option(help="Folder for checkpoints, logs and caches.")] = RUNS,
    steps: Annotated[int | None, typer.Option(min=1, help="Steps in all; the run's own number otherwise.")] = None,
    dry_run: Annotated[int | None, typer.Option(min=1, metavar="N", help="N small steps, to try a machine.")] = None,
    init_weights: Annotated[
        Path | None,
        typer.Option(help="Weights to begin from, kept by anyprobe weights --keep; the same ones to resume."),
    ] = None,
    device: Annotated[str, typer.Option(help="cpu or cuda.")] = "cpu",
    shards: Annotated[
        Path | None,
        typer.Option(help="Learn from a dataset that anyprobe data render wrote, not from pairs made on the fly."),
    ] = None,
    workers: Annotated[
        int, typer.Option(min=0, help="Processes that make pairs ahead, for a GPU that should not wait for them.")
    ] = 0,
    compiled: Annotated[bool, typer.Option("--compile/--no-compile", help="Compile the renderer.")] = True,
) -> None:
    """Train a chain of networks; resumes exactly."""
    _refuse_mask(run)
    need_torch("training")
    from anyprobe.train import loop
    from anyprobe.train.config import RUNS as NAMED
    from anyprobe.train.config import smoke

    if steps is not None and dry_run is not None:
        raise InputError(f"--steps {steps}: expected it or --dry-run, which has its own, got both; leave one out")
    if run not in NAMED:
        raise InputError(f"run {run!r}: expected one of {', '.join(NAMED)}")
    chosen = NAMED[run]()
    if steps is not None:
        chosen = replace(chosen, steps=steps)
    if dry_run is not None:
        chosen = smoke(chosen, dry_run)
    pairs = None if shards is None else _rendered(shards, data, chosen, device, workers)
    path = loop.train(
        chosen, data=data, runs=runs, device=device, compiled=compiled, workers=workers, start=init_weights, pairs=pairs
    )
    typer.echo(path)


def _rendered(shards: Path, data: Path | None, chosen: RunConfig, device: str, workers: int) -> ShardSource:
    """The batches of a rendered dataset; InputError where the run cannot learn from it."""
    from anyprobe.train.dataloader import ShardSource

    if workers:
        raise InputError("--workers: expected pairs made on the fly, got --shards; leave one of them out")
    source = ShardSource(shards, data, chosen.pairs, device)
    if source.form < 2 and chosen.model != "paper":
        raise InputError(
            f"--shards {shards}: expected a dataset with normals (format 2) for {chosen.name}, got format "
            f"{source.form}; render it again, or train paper"
        )
    return source


def _refuse_mask(run: str) -> None:
    if run == "mask":
        raise InputError(
            "run 'mask': expected a run that estimates light, got the network that proposes the object; "
            "train and export it in a clone, with python -m research.mask_network"
        )


def weights(
    to: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder for the .onnx graphs.")],
    run: RunName = "lift",
    runs: Annotated[Path, typer.Option(help="Folder of the trained runs.")] = RUNS,
    mean_map: Annotated[Path | None, typer.Option(help="Also write the mean training map to this .exr.")] = None,
    data: Annotated[
        Path | None, typer.Option(help="Data the run was trained on, for the mean map or a calibration.")
    ] = None,
    keep: Annotated[
        Path | None, typer.Option(help="Also keep the weights in this .pt, to begin another training from.")
    ] = None,
    kept: Annotated[
        Path | None,
        typer.Option(help="Export the weights in this .pt, of the run whose graph ships, without its checkpoint."),
    ] = None,
    mean_with: Annotated[
        Path | None,
        typer.Option(help="Take the mean of the run's weights and those kept in this .pt, from which it began."),
    ] = None,
    calibrated: Annotated[
        bool,
        typer.Option("--calibrated", help="Make the confidence true on pairs of assets in --data that runs leave out."),
    ] = False,
    int8: Annotated[
        bool,
        typer.Option(
            "--int8", help="Convolutions of a lifting run in 8-bit numbers, of the range they have on such pairs."
        ),
    ] = False,
) -> None:
    """Export a trained run as ONNX and check it against torch."""
    _refuse_mask(run)
    for option, asked in (("--calibrated", calibrated), ("--int8", int8)):
        if asked and data is None:
            raise InputError(f"{option}: expected --data with assets to calibrate on, got none; add it")
    need_torch("training")
    from anyprobe.estimate.runtime import weights_folder
    from anyprobe.train.checkpoint import keep_apart, kept_checkpoint, mean_checkpoint, save_init_weights
    from anyprobe.train.config import RUNS as NAMED

    if mean_map is not None and run not in NAMED:
        raise InputError(
            f"--mean-map: expected one of the runs {', '.join(NAMED)}, whose maps are known, got {run}; leave it out"
        )
    if data is not None and not (calibrated or int8 or mean_map):
        raise InputError(
            f"--data {data}: expected --calibrated, --int8 or --mean-map, which read it, got none; leave it out"
        )
    from anyprobe.train.checkpoint import read_checkpoint
    from anyprobe.train.dataloader import make_pairs
    from anyprobe.train.export_onnx import write_mean_map

    checkpoint = runs / run / "checkpoint.pt"
    if keep is not None:
        keep_apart(checkpoint, keep)
    if mean_map is not None:
        read_checkpoint(checkpoint)  # there is one, or its pairs would be made in vain
        pairs = make_pairs(NAMED[run](), data, runs / "cache", "cpu")
    with TemporaryDirectory() as scratch:
        if kept is not None:
            if run != "lift":
                raise InputError(f"--kept: expected lift, whose kept weights ship, got {run}; leave it out")
            graph = weights_folder(run) / "light.onnx"
            checkpoint = kept_checkpoint(kept, graph, Path(scratch) / "kept.pt")
        if mean_with is not None:
            checkpoint = mean_checkpoint(checkpoint, mean_with, Path(scratch) / "checkpoint.pt")
        exported = _export_light(checkpoint, to, runs, data if calibrated else None, data if int8 else None)
        for stage, difference in exported.items():
            computed = "in floats, before its 8 bits, " if int8 else ""
            typer.echo(f"{to / (stage + '.onnx')}: {computed}within {difference:.2g} of torch")
        if keep is not None:
            save_init_weights(checkpoint, keep)
            typer.echo(keep)
    if mean_map is not None:
        write_mean_map(pairs, mean_map)
        typer.echo(mean_map)


def _export_light(
    checkpoint: Path, to: Path, runs: Path, calibrate_on: Path | None, ranges_on: Path | None
) -> dict[str, float]:
    """A chain's graphs, whole or not at all; ranges are of photos as the world gives them, confidence of clean ones."""
    from anyprobe.estimate.runtime import Models
    from anyprobe.evaluate.calibration import calibrate, calibrate_errors, left_out_pairs, left_out_world_pairs
    from anyprobe.train.export_onnx import AS_LEARNED, Sureness, export, lift_examples, quantize

    kept, sureness = runs / "cache" / "left_out", AS_LEARNED
    with TemporaryDirectory() as folder:
        as_learned = Path(folder)
        if calibrate_on is not None:  # it is asked how sure it is
            export(checkpoint, as_learned)
            models = Models(folder)
            sureness = Sureness(logit=calibrate(models, left_out_pairs(calibrate_on, kept)))
            typer.echo("confidence: logit times {:.3g}, plus {:.3g}".format(*sureness.logit))
            if models.takes_material:
                pairs = chain(left_out_pairs(calibrate_on, kept), left_out_world_pairs(calibrate_on, kept))
                sureness = replace(sureness, errors=calibrate_errors(models, pairs))
                typer.echo(
                    "errors of reflectance, level, colour: times {:.3g}, {:.3g}, {:.3g}".format(*sureness.errors)
                )
        if ranges_on is None:
            return export(checkpoint, to, sureness)
        exported = export(checkpoint, as_learned, sureness)
        if "light" not in exported:
            raise InputError(f"--int8: expected a run of lift, got one of {', '.join(exported)}; leave it out")
        examples = lift_examples(left_out_pairs(ranges_on, kept, conditions=1))
        changed = quantize(as_learned / "light.onnx", to / "light.onnx", examples)
        typer.echo(f"8 bits change maps by {changed:.2g} in display values, on the mean")
        return exported

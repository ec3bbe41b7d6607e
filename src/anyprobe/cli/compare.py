"""anyprobe compare: the paper's designs, its rivals, shipped models and baselines on one test set, into files."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.cli.results import RESULTS, commit, curves, open_designs, open_methods, tail, write_result
from anyprobe.errors import InputError
from anyprobe.evaluate.laboratory import LABORATORY

if TYPE_CHECKING:
    from anyprobe.train.design_methods import DesignMethods


def compare(
    hdri: Annotated[Path, typer.Option(help="Folder of held-out maps, as for evaluate.")],
    meshes: Annotated[Path, typer.Option(help="Folder of held-out shapes.")],
    run: Annotated[
        Path | None, typer.Option(help="Folder of the run that anyprobe train designs left; else no designs.")
    ] = None,
    hdr_run: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the run that anyprobe train hdr_curves left: its HDR network for all designs."
        ),
    ] = None,
    model: Annotated[
        list[str] | None,
        typer.Option(help="Bundled model or folder of graphs to set beside; repeat for more."),
    ] = None,
    pairs: Annotated[
        int, typer.Option(min=2, max=1000, help="The first so many of the frozen 1,000 pairs.")
    ] = 1000,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for the result files; default docs/results, or a folder in it."
        ),
    ] = None,
    kept: Annotated[
        Path | None, typer.Option(help="Folder that keeps rendered pairs for the next time.")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0, help="Stop after so long; the pairs scored by then count.")
    ] = None,
    remark: Annotated[str | None, typer.Option(help="What else the page should say of the run.")] = None,
    figures: Annotated[int, typer.Option(min=0, help="Pairs shown in the pictures; 0 draws none.")] = 8,
    laboratory: Annotated[
        bool,
        typer.Option(
            "--laboratory",
            help="Pairs of one camera, exact masks and eight materials; for a run of designs_laboratory.",
        ),
    ] = False,
    join: Annotated[
        bool,
        typer.Option("--join", help="Put these rows into the files that OUT has; others and pictures stay."),
    ] = False,
) -> None:
    """Score every method on the frozen test set; write table1.json, fig13.json ... and pictures for the report."""
    from anyprobe.dataset.catalog import load_maps, load_shapes
    from anyprobe.dataset.recipe import digest
    from anyprobe.dataset.stock import Stock
    from anyprobe.evaluate.figures import Figures
    from anyprobe.evaluate.irradiance_limits import IrradianceLimits
    from anyprobe.evaluate.joined import join_file
    from anyprobe.evaluate.kept_pairs import kept_pairs
    from anyprobe.evaluate.study import study
    from anyprobe.evaluate.tables import result_files
    from anyprobe.evaluate.test_set import FROZEN, read_recipes
    from anyprobe.evaluate.tolerance import Tolerance

    if join and run is not None:
        raise InputError(
            "--join: expected shipped models or folders of graphs alone, got --run too; leave one out"
        )
    out = out or (RESULTS / LABORATORY if laboratory else RESULTS)
    if hdr_run is not None and run is None:
        raise InputError("--hdr-run: expected --run too, whose designs it serves, got none; add it")
    designs = None if run is None else open_designs(run, laboratory, hdr_run)
    learned = None if run is None else curves(run / "log.csv")
    methods, trained = open_methods(model or [], designs, told=True)
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)

    def warn(line: str) -> None:
        talk.print(f"warning: {line}", soft_wrap=True)

    stock = Stock(load_maps(hdri, report=warn), load_shapes(meshes, report=warn))
    recipes = read_recipes(FROZEN)
    chosen = recipes[:pairs]
    if laboratory:
        kept = kept and kept / LABORATORY
    drawn = Figures(len(chosen), figures) if figures else None
    tolerance = None if designs is None else Tolerance(designs.mixed)
    limits = IrradianceLimits(irradiance_methods(model or [], designs))
    columns = (TextColumn("comparing"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=len(chosen))

        def watch(index, pair, estimates):
            if drawn is not None:
                drawn.add(index, pair, estimates)
            limits.add(pair, estimates)
            if tolerance is not None:
                tolerance.add(pair, estimates["direct"].ldr)
            progress.advance(task)

        result = study(until(kept_pairs(chosen, stock, kept, laboratory), minutes), methods, watch)
    about = {
        "command": _command(hdri, meshes, (run, hdr_run), model or [], result.count("all"), join, laboratory),
        "commit": commit(),
        "recipes": digest(recipes),
        **trained,
        **({"remark": remark} if remark else {}),
    }
    files = result_files(result, about) | {"irradiance": about | limits.result()}
    if join:
        files = {name: join_file(out / f"{name}.json", content) for name, content in files.items()}
    for name, content in files.items():
        write_result(out / f"{name}.json", content)
    if join:
        talk.print(
            f"{out}: rows of {', '.join(model or ['the baselines'])} joined; anyprobe report draws them together"
        )
        return
    if learned is not None:
        write_result(out / "gradual.json", about | learned)
    if tolerance is not None:
        write_result(out / "tolerance.json", about | tolerance.result())
    for path in [] if drawn is None else drawn.save(out):
        talk.print(str(path))
    talk.print(f"{out / 'table1.json'} and the others; anyprobe report draws them together")


def until(pairs: Iterator[Any], minutes: float | None) -> Iterator[Any]:
    """The pairs that begin within so many minutes; at least one."""
    start = time.monotonic()
    for pair in pairs:
        yield pair
        if minutes is not None and time.monotonic() - start > 60 * minutes:
            return


def irradiance_methods(models: list[str], designs: DesignMethods | None = None) -> list[str]:
    """Those with an irradiance image of their own; designs share one, that of `paper` unless it went on learning."""
    names = [Path(name).name for name in models]
    shown = designs is None or ("paper" in names and not designs.has_own_irradiance)
    return names if shown else ["irradiance", *names]


def _command(
    hdri: Path,
    meshes: Path,
    runs: tuple[Path | None, Path | None],
    models: list[str],
    pairs: int,
    join: bool,
    laboratory: bool,
) -> str:
    parts = [f"anyprobe compare --hdri {tail(hdri)} --meshes {tail(meshes)}"]
    parts += [f"{name} {tail(run)}" for name, run in zip(("--run", "--hdr-run"), runs, strict=True) if run]
    parts += [f"--model {Path(name).name}" for name in models]
    parts += [
        f"--pairs {pairs}",
        *(["--join"] if join else []),
        *(["--laboratory"] if laboratory else []),
    ]
    return " ".join(parts)

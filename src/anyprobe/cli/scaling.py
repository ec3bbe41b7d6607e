"""anyprobe scaling: the tiny designs after few pairs and after many, on the frozen test set's maps and shapes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.cli.need import need_torch
from anyprobe.cli.results import RESULTS, commit, curves, tail, write_result
from anyprobe.cli.train import RUNS
from anyprobe.errors import InputError


def scaling(
    hdri: Annotated[Path, typer.Option(help="Folder of held-out maps, as for evaluate.")],
    meshes: Annotated[Path, typer.Option(help="Folder of held-out shapes.")],
    runs: Annotated[Path, typer.Option(help="Folder of the trained runs.")] = RUNS,
    pairs: Annotated[
        int, typer.Option(min=2, max=1000, help="The first so many of the frozen 1,000 pairs.")
    ] = 1000,
    kept: Annotated[
        Path | None, typer.Option(help="Folder that keeps rendered pairs for the next time.")
    ] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for scaling.json.")] = RESULTS,
) -> None:
    """Score the runs world_* and laboratory_* found in the runs' folder, each on photos of its own kind."""
    need_torch("running the trained designs")
    from anyprobe.dataset.catalog import load_maps, load_shapes
    from anyprobe.dataset.recipe import digest
    from anyprobe.dataset.stock import Stock
    from anyprobe.evaluate.kept_pairs import kept_pairs
    from anyprobe.evaluate.laboratory import LABORATORY
    from anyprobe.evaluate.scaling import ScalingScores, changes
    from anyprobe.evaluate.study import CLUSTERED
    from anyprobe.evaluate.test_set import FROZEN, read_recipes
    from anyprobe.train.scaling import SCALING
    from anyprobe.train.tiny_methods import TinyMethods, trained_scaling
    from anyprobe.train.trial_methods import read_trial

    found = trained_scaling(runs)
    if not found:
        names = ", ".join(run.__name__ for run in SCALING)
        raise InputError(f"{runs}: expected one of the runs {names}, found none; train one first")
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)

    def warn(line: str) -> None:
        talk.print(f"warning: {line}", soft_wrap=True)

    stock = Stock(load_maps(hdri, report=warn), load_shapes(meshes, report=warn))
    recipes = read_recipes(FROZEN)
    chosen = recipes[:pairs]  # all of them clean
    methods = {name: TinyMethods(path) for name, path in found.items()}
    scores = {name: ScalingScores() for name in found}
    kinds = {name: name.startswith(LABORATORY) for name in found}
    columns = (TextColumn("comparing"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=len(chosen) * len(set(kinds.values())))
        for laboratory in sorted(set(kinds.values())):
            of_kind = [name for name, kind in kinds.items() if kind == laboratory]
            folder = kept and (kept / LABORATORY if laboratory else kept)
            for pair in kept_pairs(chosen, stock, folder, laboratory):
                for name in of_kind:
                    scores[name].add(methods[name](pair), pair.map_name, pair.shape_name)
                progress.advance(task)
    content = {
        "command": f"anyprobe scaling --hdri {tail(hdri)} --meshes {tail(meshes)} --pairs {len(chosen)}",
        "commit": commit(),
        "recipes": digest(recipes),
        "pairs": len(chosen),
        "standard_errors": CLUSTERED,
        "runs": {
            name: read_trial(path)
            | scores[name].result()
            | changes(curves(path.with_name("log.csv"))["columns"])
            for name, path in found.items()
        },
    }
    write_result(out / "scaling.json", content)
    talk.print(f"{out / 'scaling.json'}; anyprobe report puts it on the page")

"""anyprobe trials: every trained trial on pairs that none has learned from, beside the first."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.cli.need import need_torch
from anyprobe.cli.results import RESULTS, commit, write_result
from anyprobe.cli.train import RUNS
from anyprobe.errors import InputError


def trials(
    data: Annotated[
        Path, typer.Option(help="The data the trials learned from; scored on what its licences leave out.")
    ],
    runs: Annotated[Path, typer.Option(help="Folder of the trained runs.")] = RUNS,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for trials.json.")] = RESULTS,
) -> None:
    """Score every trial found in the runs' folder, pair by pair against lift_trial; print the table."""
    need_torch("running the trained trials")
    from anyprobe.evaluate.calibrate import PAIRS, SEED, left_out_pairs
    from anyprobe.evaluate.study import CLUSTERED
    from anyprobe.evaluate.trials import score_trials, trial_lines
    from anyprobe.train.trial_methods import read_trial, trained_trials, trial_method
    from anyprobe.train.trials import TRIALS

    found, first = trained_trials(runs), TRIALS[0].__name__
    if first not in found:
        raise InputError(f"{runs}: expected the run {first} that others are compared with, found none")
    methods = {name: trial_method(path) for name, path in found.items()}
    kept = runs / "cache" / "left_out"
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)
    columns = (TextColumn("comparing"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=2 * PAIRS)
        pairs = (pair for conditions in (0, 1) for pair in left_out_pairs(data, kept, conditions))
        scores = score_trials(pairs, methods, lambda: progress.advance(task))
    content = {
        "command": f"anyprobe trials --data {data.name} --runs {runs.name}",
        "commit": commit(),
        "pairs": PAIRS,
        "seed": SEED,
        "standard_errors": CLUSTERED,
        "trained": {name: read_trial(path) for name, path in found.items()},
        "rows": scores.result(),
    }
    write_result(out / "trials.json", content)
    typer.echo("\n".join(trial_lines(content)))
    talk.print(str(out / "trials.json"))

"""Progress bar and log.csv of a run."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LOG_STEPS = 25
"""Number of steps that a row of log.csv averages."""
Note = Callable[[int, int, dict[str, torch.Tensor], float], None]
"""Logs a step: so many are done, of so many pairs each; its losses and its learning rate."""


@contextmanager
def run_log(folder: Path, name: str, columns: tuple[str, ...], first: int, last: int, total: int) -> Iterator[Note]:
    """Open log.csv and the progress bar of a run of `total` steps that goes on after `first`, to stop at `last`."""
    path = folder / "log.csv"
    forget_after(path, first)
    shown = TextColumn(name), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(), TextColumn("{task.description}")
    with Progress(*shown, console=Console(file=sys.stderr)) as progress, path.open("a", encoding="utf-8") as log:
        task = progress.add_task("", total=total, completed=first)
        if first == 0:
            print("step", "pairs", *columns, "learning_rate", "pairs_per_second", sep=",", file=log, flush=True)
        history: list[torch.Tensor] = []
        since = time.monotonic()

        def note(step: int, pairs: int, losses: dict[str, torch.Tensor], rate: float) -> None:
            nonlocal since
            history.append(torch.stack([losses[name].detach() for name in columns]))
            progress.advance(task)
            if step % LOG_STEPS and step != last:
                return
            means = [f"{mean:.6f}" for mean in torch.stack(history).mean(dim=0).tolist()]
            speed = len(history) * pairs / (time.monotonic() - since)
            print(step, step * pairs, *means, f"{rate:.2e}", f"{speed:.1f}", sep=",", file=log, flush=True)
            progress.update(task, description=f"{' '.join(means)}  {speed:.0f} pairs/s")
            history.clear()
            since = time.monotonic()

        yield note


def forget_after(log: Path, step: int) -> None:
    """Drop logged rows after the last checkpoint, left by a kill."""
    if not log.is_file():
        return
    lines = log.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line[:1].isdigit() or int(line.split(",")[0]) <= step]
    log.write_text("".join(line + "\n" for line in (kept if step else [])), encoding="utf-8")

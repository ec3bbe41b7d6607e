"""Progress bar, log.csv and TensorBoard events of a run."""

from __future__ import annotations

import csv
import sys
import time
from pathlib import Path

import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.files.atomic import unwritable

LOG_STEPS = 25
"""Number of steps that a row of log.csv averages."""


def run_folder(runs: Path, name: str) -> Path:
    """Return the folder of a run, created if absent; OutputError if that fails."""
    folder = runs / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(f"--runs {runs}", folder, error) from error
    return folder


class RunLogger:
    """Context that logs a run: call `note` every step."""

    def __init__(self, folder: Path, name: str, columns: tuple[str, ...], first: int, last: int, total: int) -> None:
        """Continue at step `first` of a run of `total` steps, to stop at `last`."""
        self.columns, self.last = columns, last
        self._folder, self._first, self._total = folder, first, total
        shown = (
            TextColumn(name),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
        )
        self._progress = Progress(*shown, console=Console(file=sys.stderr))
        self._history: list[torch.Tensor] = []

    def __enter__(self) -> RunLogger:
        from torch.utils.tensorboard import SummaryWriter

        path = self._folder / "log.csv"
        forget_after(path, self._first)
        self._events = SummaryWriter(str(self._folder / "tensorboard"), purge_step=self._first + 1)
        self._log = path.open("a", newline="", encoding="utf-8")
        self._rows = csv.writer(self._log)
        if self._first == 0:
            self._rows.writerow(["step", "pairs", *self.columns, "learning_rate", "pairs_per_second"])
            self._log.flush()
        self._progress.start()
        self._task = self._progress.add_task("", total=self._total, completed=self._first)
        self._since = time.monotonic()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        self._log.close()
        self._events.close()

    def note(self, step: int, pairs: int, pairs_each: int, losses: dict[str, torch.Tensor], rate: float) -> None:
        """Log a step: `step` steps and `pairs` pairs are done, pairs_each of them in this step, at this rate."""
        self._history.append(torch.stack([losses[name].detach() for name in self.columns]))
        self._progress.advance(self._task)
        if step % LOG_STEPS and step != self.last:
            return
        means = torch.stack(self._history).mean(dim=0).tolist()
        now = time.monotonic()
        speed = len(self._history) * pairs_each / (now - self._since)
        values = [f"{mean:.6f}" for mean in means]
        self._rows.writerow([step, pairs, *values, f"{rate:.2e}", f"{speed:.1f}"])
        self._log.flush()
        for name, mean in zip(self.columns, means, strict=True):
            self._events.add_scalar(f"loss/{name}", mean, step)
        self._progress.update(self._task, description=f"{' '.join(values)}  {speed:.0f} pairs/s")
        self._history, self._since = [], now


def forget_after(log: Path, step: int) -> None:
    """Drop logged rows after the last checkpoint, left by a kill."""
    if not log.is_file():
        return
    lines = log.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line[:1].isdigit() or int(line.split(",")[0]) <= step]
    log.write_text("".join(line + "\n" for line in (kept if step else [])), encoding="utf-8")

"""Progress bar, log.csv, TensorBoard events and pictures of a run."""

from __future__ import annotations

import csv
import sys
import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch.nn import functional as F

from anyprobe.core.color import to_bytes
from anyprobe.files.atomic import unwritable
from anyprobe.pictures.images import write_png
from anyprobe_train.dataset.pair_source import Batch
from anyprobe_train.train.checkpoint import write_tensors

LOG_STEPS = 25
"""Number of steps that a row of log.csv averages."""
PICTURED = 4
"""Number of pairs in pictures, the first of the run's first batch."""


def run_folder(runs: Path, name: str) -> Path:
    """Return the folder of a run, created if absent; OutputError if that fails."""
    folder = runs / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(f"--runs {runs}", folder, error) from error
    return folder


class RunLogger:
    """Context that logs a run: call `see` and `note` every step, `draw` at every checkpoint."""

    def __init__(
        self, folder: Path, name: str, columns: tuple[str, ...], first: int, last: int, total: int, learner: Any = None
    ) -> None:
        """Continue at step `first` of a run of `total` steps, to stop at `last`.

        learner: if it has a method `pictures` (train.lift), checkpoints are drawn by it.
        """
        self.columns, self.last = columns, last
        self._learner = learner if hasattr(learner, "pictures") else None
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
        self._pairs: Batch | None = None

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

    def see(self, batch: Any) -> None:
        """Keep the pairs for pictures: those of the run's first batch, stored in its folder for later resumes.

        If the folder has none, the first batch at hand serves.
        """
        if self._pairs is not None or self._learner is None:
            return
        path = self._folder / "pictures.pt"
        self._pairs = _read_pairs(path, batch) if self._first > 0 else None
        if self._pairs is None:
            self._pairs = replace(batch, **{name: value[:PICTURED].clone() for name, value in _parts(batch)})
            write_tensors(path, dict(_parts(self._pairs)))

    def draw(self, step: int) -> None:
        """Draw the networks' output for these pairs, one row each, into pictures.png and TensorBoard.

        Nothing that the next step depends on changes: no statistics, no random numbers.
        """
        if self._pairs is None or self._learner is None:
            return
        self._learner.nets.eval()
        with torch.no_grad():
            sheet = side_by_side(self._learner.pictures(self._pairs))
        self._learner.nets.train()
        write_png(self._folder / "pictures.png", sheet)
        self._events.add_image("pictures", sheet, step, dataformats="HWC")


def side_by_side(pictures: tuple[torch.Tensor, ...]) -> np.ndarray:
    """Join pictures [N, 3, H, W] of display values into one [N h, W, 3] uint8: N rows, as high as the lowest."""
    height = min(picture.shape[2] for picture in pictures)
    scaled = [
        F.interpolate(picture.float(), size=(height, picture.shape[3] * height // picture.shape[2]), mode="area")
        for picture in pictures
    ]
    rows = torch.cat(scaled, dim=3).permute(0, 2, 3, 1)  # [N, h, W, 3]
    return to_bytes(rows.flatten(0, 1).cpu().numpy())


def _parts(batch: Batch) -> list[tuple[str, torch.Tensor]]:
    return [(field.name, getattr(batch, field.name)) for field in fields(batch)]


def _read_pairs(path: Path, like: Batch) -> Batch | None:
    """Read the pairs that `see` kept to the device of `like`; None if absent, damaged or of another release."""
    try:
        return Batch(**torch.load(path, map_location=like.photo.device, weights_only=True))
    except Exception:  # torch raises many kinds for an absent or a damaged file
        return None


def forget_after(log: Path, step: int) -> None:
    """Drop logged rows after the last checkpoint, left by a kill."""
    if not log.is_file():
        return
    lines = log.read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not line[:1].isdigit() or int(line.split(",")[0]) <= step]
    log.write_text("".join(line + "\n" for line in (kept if step else [])), encoding="utf-8")

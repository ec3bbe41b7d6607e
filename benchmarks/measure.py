"""What every part of the benchmark measures with: errors, best times, memory, the machine's name."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def relative_rmse(picture: np.ndarray, reference: np.ndarray, noise: float = 0.0) -> float:
    """RMSE over points and channels [P, 3] / mean of the reference.

    noise: the reference's own relative RMSE, independent of the picture's; taken out in quadrature.
    """
    error = np.sqrt(np.mean((np.asarray(picture, np.float64) - reference) ** 2)) / np.mean(reference)
    return float(np.sqrt(max(error**2 - noise**2, 0.0)))


class Converging:
    """The mean of independent renderings [P, 3], and how noisy that mean still is."""

    def __init__(self) -> None:
        self.count = 0
        self._halves: list[Any] = [0.0, 0.0]

    def add(self, picture: np.ndarray) -> None:
        """One more rendering, of the same number of samples as those before."""
        self._halves[self.count % 2] = self._halves[self.count % 2] + np.asarray(picture, np.float64)
        self.count += 1

    @property
    def mean(self) -> np.ndarray:
        """Of all renderings."""
        return (self._halves[0] + self._halves[1]) / self.count

    @property
    def noise(self) -> float:
        """Relative RMSE of the mean: half the difference of the two halves' means; at least two renderings."""
        even, odd = (self.count + 1) // 2, self.count // 2
        difference = self._halves[0] / even - self._halves[1] / odd
        return float(np.sqrt(np.mean(difference**2)) / 2 / np.mean(self.mean))


def best_time(call: Callable[[], Any], *, repetitions: int = 7, seconds: float = 1.0) -> float:
    """Seconds of the fastest call; at least three, then until both bounds or 20 x seconds are reached.

    A call's seconds are the lesser of the clock's and the processor's: one thread's wait for a core that
    other programs use does not count.
    """
    best, start, done = np.inf, time.perf_counter(), 0
    while True:
        before, worked = time.perf_counter(), time.process_time()
        call()
        worked, now = time.process_time() - worked, time.perf_counter()
        best, done = min(best, now - before, worked), done + 1
        enough = done >= repetitions and now - start >= seconds
        if enough or (done >= 3 and now - start >= 20 * seconds):
            return float(best)


def cpu_model() -> str:
    """The processor's name."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def tree(root: int) -> list[int]:
    """Return a process and all below it."""
    below = Path(f"/proc/{root}/task")
    children = [int(one) for task in below.iterdir() for one in (task / "children").read_text().split()]
    return [root, *(one for child in children for one in tree(child))]


def used_s(root: int) -> float:
    """Return seconds of processor time, ended children included."""
    fields = [Path(f"/proc/{one}/stat").read_text().rpartition(")")[2].split() for one in tree(root)]
    ticks = sum(sum(map(int, one[11:13])) for one in fields) + sum(map(int, fields[0][13:15]))
    return ticks / os.sysconf("SC_CLK_TCK")

"""Batches for training, made by several processes ahead of it: each photo is seen SEEN times, never twice in a round.

Batches that `batch.make_batch` makes are kept in groups of GROUP. Round r shuffles the photos of groups r - SEEN + 1 to
r into batches, while group r + 1 is made. What a step sees is a function of (seed, step) alone.
"""

from __future__ import annotations

import signal
from collections import deque
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import fields
from multiprocessing import get_context
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from anyprobe_train.world.batch import LightBatch, World, make_batch

SEEN = 4
"""Rounds in which each photo is seen, and groups in memory."""
GROUP = 8
"""Fresh batches in a group; of 32 photos each they take 45 MB."""

_WORLD: list[World] = []


def _open(data: Path, cache: Path, settings: dict[str, Any]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _WORLD.append(World.open(data, cache, **settings))


def _made(seed: int, k: int) -> LightBatch:
    return make_batch(_WORLD[0], seed, k)


class Feed:
    """Iterator of batches from step `step` on; `with` it, so that its processes end."""

    def __init__(
        self, data: Path, cache: Path, seed: int, *, workers: int = 1, step: int = 0, **settings: int | str
    ) -> None:
        """Start the processes. settings: of World.open."""
        self.seed, self.step = seed, step
        context, start = get_context("spawn"), (data, cache, settings)
        self._pool = ProcessPoolExecutor(workers, context, _open, start)
        self._round, self._offset = _round_of(step)
        self._pending: deque[Future[LightBatch]] = deque()
        self._groups: deque[list[LightBatch]] = deque(maxlen=SEEN)
        self._asked = max(self._round - SEEN + 1, 0) * GROUP
        self._ask((self._round + 1) * GROUP)
        for _ in range(min(self._round + 1, SEEN)):
            self._take_group()
        self._order = self._shuffled()

    def __enter__(self) -> Feed:
        """Return itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes; what they are making is thrown away."""
        self._pool.shutdown(wait=False, cancel_futures=True)

    def __iter__(self) -> Feed:
        """Return itself."""
        return self

    def __next__(self) -> LightBatch:
        """Return the batch of the next step, which waits if its photos are not made yet."""
        batches = [one for group in self._groups for one in group]
        size = len(batches[0].family)
        if self._offset * size >= len(self._order):
            self._round, self._offset = self._round + 1, 0
            self._take_group()
            self._order = self._shuffled()
            return next(self)
        chosen = self._order[self._offset * size : (self._offset + 1) * size]
        self._offset += 1
        self.step += 1
        which, row = np.divmod(chosen, size)
        return LightBatch(
            **{
                one.name: np.stack([getattr(batches[a], one.name)[b] for a, b in zip(which, row, strict=True)])
                for one in fields(LightBatch)
            }
        )

    def _ask(self, upto: int) -> None:
        """Let the processes make all batches before number `upto`."""
        while self._asked < upto:
            self._pending.append(self._pool.submit(_made, self.seed, self._asked))
            self._asked += 1

    def _take_group(self) -> None:
        self._groups.append([self._pending.popleft().result() for _ in range(GROUP)])
        self._ask(self._asked + (GROUP if len(self._pending) < GROUP else 0))

    def _shuffled(self) -> np.ndarray:
        count = sum(len(one.family) for group in self._groups for one in group)
        return np.random.default_rng((self.seed, 1, self._round)).permutation(count)


def _round_of(step: int) -> tuple[int, int]:
    """Return the round that a step belongs to, and its number in it: rounds have GROUP, 2 GROUP .. SEEN GROUP steps."""
    number = 0
    while step >= min(number + 1, SEEN) * GROUP:
        step -= min(number + 1, SEEN) * GROUP
        number += 1
    return number, step

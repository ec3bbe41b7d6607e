"""Batches for training, made by several processes ahead of it: each photo is seen SEEN times, never twice in a round.

Batches that `batch.make_batch` makes are kept in groups of GROUP. Round r shuffles the photos of groups r - SEEN + 1 to
r into batches, while group r + 1 is made. What a step sees is a function of (seed, step) alone.
"""

import signal
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import count
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe_train.world.batch import LightBatch, World, fieldwise, make_batch

SEEN = 4
"""Rounds in which each photo is seen, and groups in memory."""
GROUP = 8
"""Fresh batches in a group; of 32 photos each they take 45 MB."""

_WORLD: list[World] = []


def _open(data: Path | None, cache: Path, settings: dict[str, Any]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _WORLD.append(World.open(data, cache, **settings))


def _made(seed: int, k: int) -> LightBatch:
    return make_batch(_WORLD[0], seed, k)


def feed(
    data: Path | None, cache: Path, seed: int, *, workers: int = 1, step: int = 0, **settings: int
) -> Iterator[LightBatch]:
    """Yield batches from step `step` on, each once its photos are made; once closed, its processes end.

    settings: of World.open.
    """
    pool = ProcessPoolExecutor(workers, get_context("spawn"), _open, (data, cache, settings))

    def asked(group: int) -> list[Future[LightBatch]]:
        return [pool.submit(_made, seed, k) for k in range(group * GROUP, (group + 1) * GROUP)]

    try:
        begun, offset = _round_of(step)
        first = max(begun - SEEN + 1, 0)
        coming = deque(asked(group) for group in range(first, begun + 2))
        groups: deque[list[LightBatch]] = deque(maxlen=SEEN)
        for _ in range(first, begun):
            groups.append([one.result() for one in coming.popleft()])
        for number in count(begun):
            groups.append([one.result() for one in coming.popleft()])
            batches = [one for group in groups for one in group]
            size = len(batches[0].family)
            order = np.random.default_rng((seed, 1, number)).permutation(len(batches) * size)
            for start in range(offset * size, len(order), size):
                which, row = np.divmod(order[start : start + size], size)
                chosen = list(zip(which, row, strict=True))
                yield fieldwise(lambda *values, chosen=chosen: np.stack([values[a][b] for a, b in chosen]), *batches)
            offset = 0
            coming.append(asked(number + 2))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _round_of(step: int) -> tuple[int, int]:
    """Return the round that a step belongs to, and its number in it: rounds have GROUP, 2 GROUP .. SEEN GROUP steps."""
    number = 0
    while step >= min(number + 1, SEEN) * GROUP:
        step -= min(number + 1, SEEN) * GROUP
        number += 1
    return number, step

"""Is a rendered dataset still what its recipes give? Some pairs are rendered again and compared."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from pathlib import Path

import numpy as np

from anyprobe.dataset import shards
from anyprobe.dataset.local_engine import run_local
from anyprobe.dataset.render_job import Job, Make, shard_range
from anyprobe.dataset.samples import decode, same


def render_again(job: Job, task: tuple[int, tuple[int, ...]], tell: Callable[[int], None]) -> str:
    """What differs when some pairs of a shard (by number in the dataset) are rendered anew; empty if nothing."""
    shard, numbers = task
    renderer = job.renderer()
    stored = dict(shards.read_samples(shards.tar_path(job.folder, shard)))
    for count, number in enumerate(numbers, 1):
        sample = renderer.sample(renderer.recipe(number))
        if sample.key not in stored:
            return f"pair {number} ({sample.key}) is not in it"
        for name, data in sample.parts.items():
            old = stored[sample.key].get(name, b"")
            if not same(name, old, data):
                return f"{sample.key}.{name} differs when rendered again{_first_difference(name, old, data)}"
        tell(count)
    return ""


def _first_difference(name: str, old: bytes, new: bytes) -> str:
    if name != "json":
        return ""
    a, b = decode(name, old), decode(name, new)
    keys = [key for key in {**a, **b} if a.get(key) != b.get(key)]
    return f" ({', '.join(keys[:3])})"


def differing(
    folder: Path,
    data: Path | None,
    make: Make,
    among: Sequence[int],
    count: int,
    *,
    workers: int,
    say: Callable[[str], None],
) -> dict[int, str]:
    """What differs, by shard, when `count` random pairs of some shards are rendered again."""
    data = None if data is None else Path(os.path.abspath(data))
    job = Job(folder=Path(os.path.abspath(folder)), data=data, make=make)
    tasks = choose(job.plan, among, count)
    results = run_local(partial(render_again, job), tasks, lambda task, n: None, workers=workers, say=say)
    return {shard: wrong for (shard, _), wrong in results.items() if wrong}


def choose(plan: Mapping, among: Sequence[int], count: int) -> list[tuple[int, tuple[int, ...]]]:
    """So many pairs of some shards by lot, or all if they are fewer: (shard, numbers of its pairs)."""
    numbers = [number for shard in among for number in shard_range(plan, shard)]
    chosen = sorted(np.random.default_rng().permutation(numbers)[:count].tolist())
    return [
        (shard, tuple(group)) for shard, group in groupby(chosen, lambda number: number // plan["shard_size"])
    ]

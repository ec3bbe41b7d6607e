"""Pairs a second from a rendered dataset beside pairs made on the fly, in one process.

python benchmarks/shards.py SHARDS [--data DATA] [--batches 40]
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from anyprobe.learning.train.config import lift, smoke
from anyprobe.learning.train.dataloader import ShardSource, make_pairs

BATCH = 32


def rate(source, batches: int) -> float:
    """Pairs a second, the first batch not counted."""
    source.batch(0)
    start = time.perf_counter()
    for step in range(1, batches + 1):
        source.batch(step)
    return batches * BATCH / (time.perf_counter() - start)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shards", type=Path)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--batches", type=int, default=40)
    asked = parser.parse_args()
    small = smoke(lift())
    config = replace(small, pairs=replace(lift().pairs, batch=BATCH))
    rendered = rate(ShardSource(asked.shards, asked.data, config.pairs), asked.batches)
    made = rate(make_pairs(config, asked.data, Path("runs/cache"), "cpu"), asked.batches)
    print(f"rendered {rendered:.0f}, on the fly {made:.0f} pairs a second: {rendered / made:.2f} times as many")


if __name__ == "__main__":
    main()

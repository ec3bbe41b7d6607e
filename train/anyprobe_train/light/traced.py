"""Path-traced photos of the maps and shapes that are learned from, among those of the fast world."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe_train.light.left_out_light import kept_batches
from anyprobe_train.world.batch import LightBatch, fieldwise

SHARE = 0.6
"""Share of path-traced photos in a batch, where there are any."""


def traced_photos(folder: Path) -> LightBatch | None:
    """Return the photos that `python -m research.scenes light-pairs` kept in a folder; None where there are none."""
    kept = kept_batches(folder)
    return fieldwise(lambda *parts: np.concatenate(parts), *kept) if kept else None


def with_traced(batch: LightBatch, traced: LightBatch | None, size: int, seed: tuple[int, int]) -> LightBatch:
    """Return a batch filled up to a size by path-traced photos, drawn by the seed."""
    if traced is None:
        return batch
    rows = np.random.default_rng((*seed, 31)).choice(len(traced.family), size - len(batch.family))
    return fieldwise(lambda made, more: np.concatenate([made, more[rows]]), batch, traced)

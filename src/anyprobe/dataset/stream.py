"""Batches made ahead by worker processes, in order, the same as one process makes.

A step's arithmetic is many short loops: two processes of one thread each make more than
twice as many pairs a second as one process of two threads.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from torch.utils.data import DataLoader, Dataset

from anyprobe.dataset.local_engine import one_thread
from anyprobe.dataset.map_views import MapBatch, MapViews
from anyprobe.dataset.pairs import Batch, PairSource

AHEAD = 2
"""Batches that each worker keeps ready."""


class _Steps(Dataset):
    """A source's batches by step number; every process opens its own source at its first batch."""

    def __init__(self, open_source: Callable[[], PairSource | MapViews], steps: range) -> None:
        self.open_source, self.steps = open_source, steps
        self._source: PairSource | MapViews | None = None

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, index: int) -> Batch | MapBatch:
        if self._source is None:
            self._source = self.open_source()
        return self._source.batch(self.steps[index])


def stream(
    open_source: Callable[[], PairSource | MapViews], steps: range, workers: int
) -> Iterator[Batch | MapBatch]:
    """The batches of these steps, of pairs or of views of maps.

    Workers share nothing but the step's number; up to PairConfig.lanes of them shade nothing twice.

    Args:
        open_source: picklable; gives the source, on the CPU.
        workers: processes of one thread each; 0 makes the batches here, on this process's threads.
    """
    made = _Steps(open_source, steps)
    if workers == 0:
        return (made[index] for index in range(len(made)))
    batches = DataLoader(
        made,
        batch_size=None,
        num_workers=workers,
        prefetch_factor=AHEAD,
        multiprocessing_context="spawn",
        collate_fn=_as_it_is,
    )
    with one_thread():
        return iter(batches)


def _as_it_is(batch: Batch | MapBatch) -> Batch | MapBatch:
    return batch

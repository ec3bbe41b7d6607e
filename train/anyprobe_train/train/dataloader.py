"""Batches of pairs, made by this process or ahead of it by worker processes."""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch.utils.data import DataLoader, Dataset

from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store, own_map
from anyprobe_train.dataset.lighting import Illuminator, draw_variant
from anyprobe_train.dataset.pair_source import Batch, PairSource
from anyprobe_train.dataset.processes import one_thread
from anyprobe_train.dataset.surfaces import SurfaceSet, build_surfaces
from anyprobe_train.train.config import LightConfig, RunConfig

AHEAD = 2
"""Number of batches that each worker keeps ready."""


class _Steps(Dataset):
    """Batches of a source by step number; every process opens its own source at its first batch."""

    def __init__(self, open_source: Callable[[], PairSource], steps: range) -> None:
        self.open_source, self.steps = open_source, steps
        self._source: PairSource | None = None

    def __len__(self) -> int:
        return len(self.steps)

    def __getitem__(self, index: int) -> Batch:
        if self._source is None:
            self._source = self.open_source()
        return self._source.batch(self.steps[index])


def stream(open_source: Callable[[], PairSource], steps: range, workers: int) -> Iterator[Batch]:
    """Return the batches of these steps, made by worker processes.

    Workers share nothing but the step's number; up to PairConfig.lanes of them shade nothing twice.

    Args:
        open_source: picklable; gives the source, on the CPU.
        workers: processes of one thread each, one or more.
    """
    batches = DataLoader(
        _Steps(open_source, steps),
        batch_size=None,
        num_workers=workers,
        prefetch_factor=AHEAD,
        multiprocessing_context="spawn",
    )
    with one_thread():
        return iter(batches)


def make_pairs(
    config: RunConfig,
    data: Path | None,
    cache: Path,
    device: str,
    compiled: bool = True,
    store: AssetStore | None = None,
) -> PairSource:
    """Open the endless pairs of a run, over real assets of data/{hdri,meshes} if given, and procedural ones.

    Files that cannot be used are listed on stderr. store: of load_assets, if it is at hand.
    """
    store = store or load_assets(config.light, data)
    maps = make_maps(config.light, store)
    return PairSource(Illuminator(maps, device, compiled), _surfaces(config, store, cache), config.pairs)


def make_maps(light: LightConfig, store: AssetStore) -> list[np.ndarray]:
    """Collect real maps, procedural ones, and variants of all these."""
    radiance = [asset.radiance for asset in store.maps.values()] if light.real else []
    radiance += [own_map(light.seed, index).radiance for index in range(light.procedural)]
    rng = np.random.default_rng(light.seed)
    radiance += [draw_variant(rng, radiance) for _ in range(light.variants)]
    return radiance


def load_assets(light: LightConfig, data: Path | None) -> AssetStore:
    """Load the maps and shapes of a data folder that a run may learn from, none without a folder.

    Files that cannot be used are listed on stderr.
    """

    def warn(line: str) -> None:
        if multiprocessing.parent_process() is None:  # else it was said before
            print(f"warning: {line}", file=sys.stderr)

    return load_asset_store(data, "train", commercial_only=light.commercial_only, extra=light.extra, report=warn)


def name_assets(store: AssetStore) -> str:
    """Name maps and shapes in their order: how many, and 8 hex digits of SHA-256 over their ids."""
    ids = [*store.maps, "", *store.shapes]
    digits = hashlib.sha256(" ".join(ids).encode()).hexdigest()[:8]
    return f"{len(store.maps)} maps and {len(store.shapes)} shapes ({digits})"


def _surfaces(config: RunConfig, store: AssetStore, cache: Path, workers: int = 0) -> SurfaceSet:
    columns = (TextColumn("drawing shapes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=Console(stderr=True))
    task = progress.add_task("")

    def watch(done: int, total: int) -> None:
        progress.start()  # only where there is anything to draw
        progress.update(task, completed=done, total=total)

    try:
        return build_surfaces(list(store.shapes.values()), config.surfaces, cache, workers, watch)
    finally:
        progress.stop()


def open_batches(
    config: RunConfig,
    store: AssetStore,
    data: Path | None,
    cache: Path,
    device: str,
    compiled: bool,
    steps: range,
    workers: int,
) -> Iterator[Batch]:
    """Open the batches of steps on a device, made by this process, or ahead of it by `workers` others on the CPU.

    store: of load_assets; the others read their own from data.
    """
    if workers == 0:
        return map(make_pairs(config, data, cache, device, compiled, store).batch, steps)
    _surfaces(config, store, cache, workers)  # once, before all of them ask for it
    batches = stream(partial(make_pairs, config, data, cache, "cpu", compiled), steps, workers)
    return (batch.to(device) for batch in batches)

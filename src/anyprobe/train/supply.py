"""Supply (noun): the pairs that a run learns from, by its assets, its surfaces and as many processes as it is given."""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from anyprobe.dataset.lighting import Illuminator
from anyprobe.dataset.map_views import MapBatch, MapViews
from anyprobe.dataset.pairs import Batch, PairSource
from anyprobe.dataset.stock import Stock, load_stock, own_map
from anyprobe.dataset.stream import stream
from anyprobe.dataset.surfaces import SurfaceSet, build_surfaces
from anyprobe.dataset.variants import draw_variant
from anyprobe.train.config import LightConfig, RunConfig


def make_pairs(
    config: RunConfig, data: Path | None, cache: Path, device: str, compiled: bool = True
) -> PairSource | MapViews:
    """The endless pairs of a run, or views of its maps: real assets of data/{hdri,meshes} when given, and our own.

    Files that cannot be used are listed on stderr.
    """
    return _pairs(config, load_assets(config.light, data, sees_objects(config)), cache, device, compiled)


def _pairs(
    config: RunConfig, stock: Stock, cache: Path, device: str, compiled: bool
) -> PairSource | MapViews:
    maps = _maps(config.light, stock)
    if not _has_surfaces(config):
        return MapViews(maps, config.pairs, device)
    return PairSource(Illuminator(maps, device, compiled), _surfaces(config, stock, cache), config.pairs)


def _has_surfaces(config: RunConfig) -> bool:
    """Whether a run learns from objects; else it sees maps alone."""
    return config.model != "hdr"


def _maps(light: LightConfig, stock: Stock) -> list[np.ndarray]:
    """Real maps, our own, and what is made of all these."""
    radiance = [asset.radiance for asset in stock.maps.values()] if light.real else []
    radiance += [own_map(light.seed, index).radiance for index in range(light.procedural)]
    rng = np.random.default_rng(light.seed)
    radiance += [draw_variant(rng, radiance) for _ in range(light.variants)]
    return radiance


def sees_objects(config: RunConfig) -> bool:
    """Whether a run learns from photos of objects; the others see maps alone."""
    return config.model != "hdr"


def load_assets(light: LightConfig, data: Path | None, with_shapes: bool = True) -> Stock:
    """The maps and shapes of a data folder that a run may learn from, none without one.

    Files that cannot be used are listed on stderr.
    """
    worker = multiprocessing.parent_process() is not None

    def warn(line: str) -> None:
        print(f"warning: {line}", file=sys.stderr)

    return load_stock(
        data,
        "train",
        commercial_only=light.commercial_only,
        extra=light.extra,
        with_shapes=with_shapes,
        report=(lambda line: None) if worker else warn,  # it was said before
    )


def name_assets(stock: Stock) -> str:
    """Which maps and shapes these are, in their order: how many, and 8 hex digits of SHA-256 over their ids."""
    ids = [*stock.maps, "", *stock.shapes]
    digits = hashlib.sha256(" ".join(ids).encode()).hexdigest()[:8]
    return f"{len(stock.maps)} maps and {len(stock.shapes)} shapes ({digits})"


def _surfaces(config: RunConfig, stock: Stock, cache: Path, workers: int = 0) -> SurfaceSet:
    columns = (TextColumn("drawing shapes"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    progress = Progress(*columns, console=Console(stderr=True))
    task = progress.add_task("")

    def watch(done: int, total: int) -> None:
        progress.start()  # only where there is anything to draw
        progress.update(task, completed=done, total=total)

    try:
        return build_surfaces(list(stock.shapes.values()), config.surfaces, cache, workers, watch)
    finally:
        progress.stop()


def open_batches(
    config: RunConfig,
    stock: Stock,
    data: Path | None,
    cache: Path,
    device: str,
    compiled: bool,
    steps: range,
    workers: int,
) -> Iterator[Batch | MapBatch]:
    """The batches of steps on a device, made by this process, or ahead of it by so many others on the CPU.

    stock: of load_assets; the others read their own from data.
    """
    if workers == 0:
        return map(_pairs(config, stock, cache, device, compiled).batch, steps)
    if _has_surfaces(config):
        _surfaces(config, stock, cache, workers)  # once, before all of them ask for it
    made = stream(partial(make_pairs, config, data, cache, "cpu", compiled), steps, workers)
    return (batch.to(device) for batch in made)

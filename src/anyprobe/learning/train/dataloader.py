"""Batches of pairs: made on the fly, here or ahead in worker processes, or read from a rendered dataset."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import sys
from collections.abc import Callable, Iterator
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from torch.utils.data import DataLoader, Dataset

from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.given_material import MATERIAL_INPUTS
from anyprobe.learning.dataset.asset_store import AssetStore, load_asset_store, own_map
from anyprobe.learning.dataset.lighting import Illuminator, draw_variant
from anyprobe.learning.dataset.pair import LN_RANGE
from anyprobe.learning.dataset.pairs import Batch, PairConfig, PairSource
from anyprobe.learning.dataset.process_pools import one_thread
from anyprobe.learning.dataset.render_job import SETTINGS, num_shards, read_plan
from anyprobe.learning.dataset.samples import NORMALS, StoreRenderer, decode_normals, decode_part
from anyprobe.learning.dataset.shards import ShardIndex, is_done, read_index, tar_path
from anyprobe.learning.dataset.surfaces import SurfaceSet, build_surfaces
from anyprobe.learning.train.config import LightConfig, RunConfig
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink

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
    """Return the batches of these steps, of pairs or of views of maps.

    Workers share nothing but the step's number; up to PairConfig.lanes of them shade nothing twice.

    Args:
        open_source: picklable; gives the source, on the CPU.
        workers: processes of one thread each; 0 makes the batches here, on this process's threads.
    """
    source_batches = _Steps(open_source, steps)
    if workers == 0:
        return (source_batches[index] for index in range(len(source_batches)))
    batches = DataLoader(
        source_batches,
        batch_size=None,
        num_workers=workers,
        prefetch_factor=AHEAD,
        multiprocessing_context="spawn",
        collate_fn=_as_it_is,
    )
    with one_thread():
        return iter(batches)


def _as_it_is(batch: Any) -> Any:
    return batch


def make_pairs(config: RunConfig, data: Path | None, cache: Path, device: str, compiled: bool = True) -> PairSource:
    """Open the endless pairs of a run, over real assets of data/{hdri,meshes} if given, and procedural ones.

    Files that cannot be used are listed on stderr.
    """
    return _pairs(config, load_assets(config.light, data), cache, device, compiled)


def _pairs(config: RunConfig, store: AssetStore, cache: Path, device: str, compiled: bool) -> PairSource:
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
        return map(_pairs(config, store, cache, device, compiled).batch, steps)
    _surfaces(config, store, cache, workers)  # once, before all of them ask for it
    batches = stream(partial(make_pairs, config, data, cache, "cpu", compiled), steps, workers)
    return (batch.to(device) for batch in batches)


KEPT_LIGHTS = 64
"""Number of rotated maps that are cached, 100 kB each."""


class ShardSource:
    """Batches of a dataset's finished shards; batch k depends on the seed and k alone, as of pairs made on the fly.

    Every epoch has its own order of all pairs; the last ones that fill no batch are left out.
    """

    def __init__(self, folder: Path, data: Path | None, config: PairConfig, device: str = "cpu") -> None:
        """Open a folder of `anyprobe data render`; data: the assets it was rendered from, None if all were procedural.

        Raises:
            InputError: no dataset of objects, none of its shards finished, fewer pairs than a batch, or other assets.
        """
        plan = read_plan(folder)
        if plan["kind"] != "object":
            raise InputError(
                f"expected a dataset of objects, got one of {plan['kind']}s", subject="shards", source=folder
            )
        if plan["split"] != "train":
            raise InputError(
                f"expected a dataset of training assets, got one of split {plan['split']}; "
                "render one with --split train",
                subject="shards",
                source=folder,
            )
        if data is None and plan["procedural_maps"] < len(plan["maps"]):
            raise InputError(
                "expected --data with the assets it was rendered from, got none", subject="shards", source=folder
            )
        self.folder, self.config, self.device = folder, config, device
        done = [shard for shard in range(num_shards(plan)) if is_done(folder, shard)]
        self.indices: dict[int, ShardIndex] = {shard: read_index(folder, shard) for shard in done}
        self.keys = [(shard, key) for shard, index in self.indices.items() for key in index.parts]
        if len(self.keys) < config.batch:
            raise InputError(
                f"expected at least {config.batch} finished pairs, got {len(self.keys)}; "
                "render more with anyprobe data render --resume",
                subject="shards",
                source=folder,
            )
        self.store: AssetStore = StoreRenderer({name: plan[name] for name in SETTINGS}, data).store
        missing = {one["id"] for one in plan["maps"]} - self.store.maps.keys()
        if missing:
            raise InputError(
                f"expected in --data the {len(plan['maps'])} maps it was rendered from, got all but {len(missing)}",
                subject="shards",
                source=folder,
            )
        self._light = lru_cache(maxsize=KEPT_LIGHTS)(self._turned_map)

    @property
    def identity(self) -> str:
        """Identity of the pairs: how many, and 8 hex digits of SHA-256 over their keys."""
        digits = hashlib.sha256(" ".join(key for _, key in self.keys).encode()).hexdigest()[:8]
        return f"{len(self.keys)} rendered pairs ({digits})"

    def batch(self, step: int) -> Batch:
        """Read the pairs of step number `step`."""
        size = self.config.batch
        epoch, place = divmod(step, len(self.keys) // size)
        order = np.random.default_rng((self.config.seed, 3, epoch)).permutation(len(self.keys))
        chosen = [self.keys[k] for k in order[place * size : (place + 1) * size]]
        rows = [self._pair(*shard_and_key) for shard_and_key in chosen]
        arrays = {name: torch.from_numpy(np.stack([row[name] for row in rows])) for name in rows[0]}
        absent = {
            "given_normals_rotation": torch.zeros(size, 3, 3),
            "surroundings": torch.zeros(size, 4, MAP_HEIGHT, 2 * MAP_HEIGHT),
            "material": torch.zeros(size, MATERIAL_INPUTS),
            "given_material": torch.zeros(size, MATERIAL_INPUTS),
        }
        return Batch(**arrays, **absent).to(self.device)

    def _pair(self, shard: int, key: str) -> dict[str, np.ndarray]:
        """Read a pair as the arrays of Batch, channels first."""
        parts = {}
        with tar_path(self.folder, shard).open("rb") as stream:
            for name, (offset, size) in self.indices[shard].parts[key].items():
                stream.seek(offset)
                parts[name] = decode_part(name, stream.read(size))
        fields = parts["json"]
        light = self._light(fields["map_id"], json.dumps(fields["map_from_camera"]))
        radiance = light * np.asarray(fields["gain"], np.float32)
        normals = decode_normals(parts[NORMALS])
        images: dict[str, Any] = {
            "photo": parts["photo.png"] / np.float32(255),
            "irradiance": parts["irradiance.png"] / np.float32(255),
            "ldr": response(radiance),
            "ln_radiance": np.log(np.clip(radiance, 1e-6, None)).clip(*LN_RANGE),
            "normals": normals,
        }
        rows = {name: np.ascontiguousarray(value.transpose(2, 0, 1), np.float32) for name, value in images.items()}
        return rows | {name: np.asarray(fields[name], np.float32) for name in ("alpha", "tan_half")}

    def _turned_map(self, map_id: str, map_from_camera: str) -> np.ndarray:
        """Return a map rotated to a pair's camera frame, [64, 128, 3]."""
        turn = np.array(json.loads(map_from_camera))
        return np.asarray(shrink(rotate(self.store.map(map_id).radiance, turn.T), MAP_HEIGHT), np.float32)

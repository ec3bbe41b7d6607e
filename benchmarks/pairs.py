"""Training pairs a second, beside rendering them one by one, point by point; and memory over many."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch
from measure import held_mb

from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.files.cores import one_thread
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.catalog import load_maps, load_shapes
from anyprobe_train.dataset.pair import render_pair
from anyprobe_train.dataset.pair_source import LN_RANGE, Batch, PairConfig, PairSource
from anyprobe_train.dataset.recipe import MATERIAL_CHOICES, VIEWPOINTS, Recipe
from anyprobe_train.train.config import RunConfig
from anyprobe_train.train.dataloader import make_pairs, stream

MEMORY_POINTS = 50
"""Readings of the memory, spread evenly over the pairs."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Setup:
    """Where and how pairs are made.

    data: folder with hdri and meshes, None for assets of our own; quick: six maps and shapes, fewer views.
    cores: as many processes of one thread each on the CPU; a GPU is fed by this process.
    """

    data: Path | None
    device: str
    compiled: bool
    quick: bool
    cache: Path
    cores: int

    @property
    def workers(self) -> int:
        """Processes beside this one."""
        return self.cores if self.device == "cpu" else 0

    def config(self) -> RunConfig:
        """Pairs as PairConfig, SurfaceConfig and LightConfig have them by default."""
        config = RunConfig(name="pairs", steps=1, pairs=PairConfig(seed=11))
        if not self.quick:
            return config
        return replace(
            config, surfaces=replace(config.surfaces, views=1, procedural=6), light=replace(config.light, procedural=6)
        )

    def open_source(self) -> PairSource:
        """The pairs themselves."""
        warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
        return make_pairs(self.config(), self.data, self.cache, self.device, self.compiled)

    def batches(self, last: int) -> Iterator[Batch]:
        """Batches 0 to last - 1, by the workers."""
        return stream(self.open_source, range(last), self.workers)


def count_pairs(batches: Iterator[Batch], config: PairConfig, seconds: float) -> tuple[int, float]:
    """Pairs made in whole periods of the pool's renewal for at least so many seconds, and the seconds."""
    period = config.lanes * max(1, config.group * config.reuse // config.batch)
    for _ in range(2 * period):  # compiles, fills every worker's pool
        next(batches)
    steps, start = 0, time.perf_counter()
    while True:
        for _ in range(period):
            last = next(batches)
            steps += 1
        if last.photo.is_cuda:
            torch.cuda.synchronize()
        elapsed = time.perf_counter() - start
        if elapsed >= seconds:
            return steps * config.batch, elapsed


def straight_pair(recipe: Recipe, store: AssetStore) -> tuple[np.ndarray, ...]:
    """One pair the straightforward way, in NumPy: rasterise the shape, shade its points, turn the map.

    Returns:
        photo [S, S, 4], irradiance [S, S, 3], ldr and ln radiance [64, 128, 3].
    """
    pair = render_pair(recipe, store)
    ldr = response(pair.radiance, MEAN_CURVE)
    return pair.photo, pair.irradiance, ldr, np.clip(np.log(np.clip(pair.radiance, 1e-6, None)), *LN_RANGE)


def count_straight_pairs(data: Path | None, seconds: float) -> tuple[int, float]:
    """Pairs of straight_pair in so many seconds, over all of small_store, and the seconds."""
    store = small_store(data)
    map_ids, shape_ids = list(store.maps), list(store.shapes)

    def one(k: int) -> None:
        recipe = Recipe(
            map_id=map_ids[k % len(map_ids)],
            shape_id=shape_ids[k % len(shape_ids)],
            material=k % MATERIAL_CHOICES,
            view=k % VIEWPOINTS,
            conditions=1,
            seed=k,
        )
        straight_pair(recipe, store)

    for k in range(len(map_ids)):  # their pyramids
        one(k)
    count, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        one(count)
        count += 1
    return count, time.perf_counter() - start


def small_store(data: Path | None) -> AssetStore:
    """Four maps and eight shapes: of data/{hdri,meshes}/train, else our own."""
    if data is None:
        return load_asset_store(None, "train", procedural_maps=4, procedural_shapes=8)
    maps, shapes = load_maps(data / "hdri" / "train"), load_shapes(data / "meshes" / "train")
    return AssetStore(maps[:4], shapes[:8])


def measure_speed(setup: Setup, seconds: float) -> dict[str, Any]:
    """The pairs part's line."""
    config = setup.config()
    pairs, elapsed = count_pairs(setup.batches(10**9), config.pairs, seconds)
    with one_thread(), ProcessPoolExecutor(setup.cores, mp_context=get_context("spawn")) as pool:
        runs = [pool.submit(count_straight_pairs, setup.data, seconds / 3) for _ in range(setup.cores)]
        straight = [run.result() for run in runs]
    speed, straight_speed = pairs / elapsed, sum(count / spent for count, spent in straight)
    return {
        "part": "pairs",
        "device": setup.device,
        "workers": setup.workers,
        "assets": "our own" if setup.data is None else f"{setup.data.name} and our own",
        "batch": config.pairs.batch,
        "pairs": pairs,
        "seconds": round(elapsed, 2),
        "pairs_per_second": round(speed, 2),
        "straight_pairs": sum(count for count, _ in straight),
        "straight_pairs_per_second": round(straight_speed, 3),
        "speedup": round(speed / straight_speed, 2),
    }


def measure_memory(setup: Setup, pairs: int) -> dict[str, Any]:
    """The memory part's line: what this process and its workers hold while `pairs` pairs go by, none kept."""
    config = setup.config().pairs
    warm = 2 * config.lanes * max(1, config.group * config.reuse // config.batch)
    steps = max(2, -(-pairs // config.batch))
    marks = set(np.linspace(0, steps, min(MEMORY_POINTS, steps) + 1).astype(int).tolist())
    batches = setup.batches(warm + steps)
    for _ in range(warm):
        next(batches)
    made, held = [0], [held_mb()]
    for step in range(1, steps + 1):
        next(batches)
        if step in marks:
            made.append(step * config.batch)
            held.append(held_mb())
    slope = float(np.polyfit(made, held, 1)[0])
    result = {
        "part": "memory",
        "device": setup.device,
        "workers": setup.workers,
        "pairs": steps * config.batch,
        "start_mb": round(held[0], 1),
        "held_mb": {str(count): round(mb, 1) for count, mb in list(zip(made, held, strict=True))[5::5]},
        "peak_mb": round(max(held), 1),
        "growth_mb_per_10000_pairs": round(slope * 1e4, 2),
    }
    if setup.device == "cuda":
        result["gpu_peak_mb"] = round(torch.cuda.max_memory_allocated() / 1e6, 1)
    return result

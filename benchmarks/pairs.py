"""Training pairs a second, beside rendering them one by one, point by point; and memory over many."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from measure import peak_rss_mb, rss_mb

from anyprobe.core.response import MEAN_CURVE, response
from anyprobe.dataset.catalog import load_maps, load_shapes
from anyprobe.dataset.pair import render_pair
from anyprobe.dataset.pairs import LN_RANGE, PairSource
from anyprobe.dataset.recipe import MATERIALS, VIEWPOINTS, Recipe
from anyprobe.dataset.stock import Stock, load_stock
from anyprobe.train.config import RUNS
from anyprobe.train.loop import make_pairs

MEMORY_POINTS = 50
"""Readings of the memory, spread evenly over the pairs."""


def open_source(
    data: Path | None, device: str, compiled: bool, quick: bool, cache: Path, threads: int
) -> PairSource:
    """The pairs that `anyprobe train paper` learns from; quick: six maps and shapes of our own, fewer views."""
    warnings.filterwarnings("ignore", message="Dynamo detected a call to a `functools.lru_cache`")
    torch.set_num_threads(threads)
    config = RUNS["paper"]()
    if quick:
        config = replace(
            config,
            surfaces=replace(config.surfaces, views=1, procedural=6),
            light=replace(config.light, procedural=6),
        )
    return make_pairs(config, data, cache, device, compiled)


def _finish(source: PairSource) -> None:
    if source.device.startswith("cuda"):
        torch.cuda.synchronize()


def count_pairs(source: PairSource, seconds: float) -> tuple[int, float]:
    """Pairs made in whole periods of the pool's renewal for at least so many seconds, and the seconds."""
    period = max(1, source.config.group * source.config.reuse // source.config.batch)
    for step in range(2 * period):  # compiles, fills the pool
        source.batch(step)
    _finish(source)
    step, start = 2 * period, time.perf_counter()
    while True:
        for _ in range(period):
            source.batch(step)
            step += 1
        _finish(source)
        elapsed = time.perf_counter() - start
        if elapsed >= seconds:
            return (step - 2 * period) * source.config.batch, elapsed


def straight_pair(recipe: Recipe, stock: Stock) -> tuple[np.ndarray, ...]:
    """One pair the straightforward way, in NumPy: rasterise the shape, shade its points, turn the map.

    Returns:
        photo [S, S, 4], irradiance [S, S, 3], ldr and ln radiance [64, 128, 3].
    """
    pair = render_pair(recipe, stock)
    ldr = response(pair.radiance, MEAN_CURVE)
    return pair.photo, pair.irradiance, ldr, np.clip(np.log(np.clip(pair.radiance, 1e-6, None)), *LN_RANGE)


def count_straight_pairs(stock: Stock, seconds: float) -> tuple[int, float]:
    """Pairs of straight_pair in so many seconds, over all of the stock, and the seconds."""
    map_ids, shape_ids = list(stock.maps), list(stock.shapes)

    def one(k: int) -> None:
        recipe = Recipe(
            kind="object",
            map_id=map_ids[k % len(map_ids)],
            shape_id=shape_ids[k % len(shape_ids)],
            material=k % MATERIALS,
            view=k % VIEWPOINTS,
            conditions=1,
            seed=k,
        )
        straight_pair(recipe, stock)

    for k in range(len(map_ids)):  # their pyramids
        one(k)
    count, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        one(count)
        count += 1
    return count, time.perf_counter() - start


def small_stock(data: Path | None) -> Stock:
    """Four maps and eight shapes: of data/{hdri,meshes}/train, else our own."""
    if data is None:
        return load_stock(None, "train", procedural_maps=4, procedural_shapes=8)
    maps, shapes = load_maps(data / "hdri" / "train"), load_shapes(data / "meshes" / "train")
    return Stock(maps[:4], shapes[:8])


def measure_speed(
    data: Path | None, device: str, compiled: bool, quick: bool, cache: Path, threads: int, seconds: float
) -> dict[str, Any]:
    """The pairs part's line."""
    source = open_source(data, device, compiled, quick, cache, threads)
    pairs, elapsed = count_pairs(source, seconds)
    straight, straight_elapsed = count_straight_pairs(small_stock(data), seconds / 3)
    speed, straight_speed = pairs / elapsed, straight / straight_elapsed
    return {
        "part": "pairs",
        "device": device,
        "assets": "our own" if data is None else f"{data.name} and our own",
        "maps": len(source.illuminator.pyramids),
        "surfaces": len(source.surfaces.normals),
        "batch": source.config.batch,
        "pairs": pairs,
        "seconds": round(elapsed, 2),
        "pairs_per_second": round(speed, 2),
        "straight_pairs": straight,
        "straight_pairs_per_second": round(straight_speed, 3),
        "speedup": round(speed / straight_speed, 2),
    }


def measure_memory(
    data: Path | None, device: str, compiled: bool, quick: bool, cache: Path, threads: int, pairs: int
) -> dict[str, Any]:
    """The memory part's line: resident memory while `pairs` pairs go by, none of them kept."""
    source = open_source(data, device, compiled, quick, cache, threads)
    batch = source.config.batch
    period = max(1, source.config.group * source.config.reuse // batch)
    for step in range(2 * period):
        source.batch(step)
    steps = max(2, -(-pairs // batch))
    marks = set(np.linspace(0, steps, min(MEMORY_POINTS, steps) + 1).astype(int).tolist())
    made, held = [0], [rss_mb()]
    for step in range(1, steps + 1):
        source.batch(2 * period + step - 1)
        if step in marks:
            made.append(step * batch)
            held.append(rss_mb())
    slope = float(np.polyfit(made, held, 1)[0])
    result = {
        "part": "memory",
        "device": device,
        "pairs": steps * batch,
        "rss_start_mb": round(held[0], 1),
        "rss_end_mb": round(held[-1], 1),
        "peak_mb": round(peak_rss_mb(), 1),
        "growth_mb_per_10000_pairs": round(slope * 1e4, 2),
    }
    if device.startswith("cuda"):
        result["gpu_peak_mb"] = round(torch.cuda.max_memory_allocated() / 1e6, 1)
    return result

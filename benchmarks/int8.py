"""The shipped graph in whole numbers beside the same weights in floats: times by turns, and how far the answers differ.

    python benchmarks/whole_numbers.py            # one JSON object a line: an engine and a number of threads

The float graph is made of training/lift.pt. Photos are of our own shapes under our own maps.
"""

from __future__ import annotations

import argparse
import json
import statistics
import time
import warnings
from dataclasses import asdict
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch

from anyprobe.dataset.asset_store import AssetStore, own_map
from anyprobe.dataset.catalog import ShapeAsset
from anyprobe.dataset.pair import Pair, render_pair
from anyprobe.dataset.recipe import balanced_recipes
from anyprobe.estimate.runtime import ENGINES, Models, file_hashes
from anyprobe.render.shapes import figure
from anyprobe.train.checkpoint import load_init_weights
from anyprobe.train.config import lift
from anyprobe.train.export_onnx import export_graphs
from anyprobe.train.lift import Lift

ROOT = Path(__file__).parents[1]
PHOTOS = 8
SEED = 2_000_011
"""Of maps, shapes and recipes that no training used."""


def main() -> None:
    """Print a line for each engine and number of threads."""
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--engines", nargs="+", default=["onnxruntime"], choices=ENGINES)
    arguments.add_argument("--threads", nargs="+", type=int, default=[1, 2])
    arguments.add_argument("--rounds", type=int, default=100)
    options = arguments.parse_args()
    pairs = own_pairs()
    with TemporaryDirectory() as folder:
        write_float_graph(Path(folder))
        for engine in options.engines:
            for threads in options.threads:
                models = {kind: Models(name, threads, engine) for kind, name in (("float", folder), ("int8", "lift"))}
                print(json.dumps(compare(models, pairs, options.rounds) | {"engine": engine, "threads": threads}))


def own_pairs() -> list[Pair]:
    """Photos of our own figures under our own maps."""
    maps = [own_map(SEED, index) for index in range(PHOTOS)]
    meshes = [figure(np.random.default_rng((SEED, index))) for index in range(PHOTOS)]
    shapes = [
        ShapeAsset(id=f"{index:08x}", name=f"figure {index}", licence="own", mesh=mesh)
        for index, mesh in enumerate(meshes)
    ]
    store = AssetStore(maps, shapes)
    return [render_pair(recipe, store) for recipe in balanced_recipes(store, PHOTOS, SEED)]


def write_float_graph(folder: Path) -> None:
    """folder/light.onnx of training/lift.pt."""
    nets = Lift.networks(lift().lift)
    load_init_weights(nets, ROOT / "training" / "lift.pt")
    config = json.dumps(asdict(lift()))
    checkpoint = folder / "checkpoint.pt"
    torch.save({"nets": nets.state_dict(), "step": 0, "pairs": 0, "config": config}, checkpoint)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        export_graphs(checkpoint, folder)


def compare(models: dict[str, Models], pairs: list[Pair], rounds: int) -> dict:
    """Medians of both by turns, in ms, their ratio, and the mean difference of display values and irradiance."""
    answers = {kind: [model(pair.crop, pair.tan_half) for pair in pairs] for kind, model in models.items()}
    both = list(zip(answers["float"], answers["int8"], strict=True))
    times: dict[str, list[float]] = {kind: [] for kind in models}
    for k in range(rounds):
        pair = pairs[k % len(pairs)]
        for kind, model in models.items():
            start = time.perf_counter()
            model(pair.crop, pair.tan_half)
            times[kind].append(1e3 * (time.perf_counter() - start))
    median = {kind: statistics.median(seen) for kind, seen in times.items()}
    return {
        "graph": file_hashes("lift")["light"],
        "float_ms": round(median["float"], 2),
        "int8_ms": round(median["int8"], 2),
        "ratio": round(median["float"] / median["int8"], 2),
        "ldr_difference": round(float(np.mean([np.abs(a.ldr - b.ldr).mean() for a, b in both])), 4),
        "irradiance_difference": round(
            float(np.mean([np.abs(a.irradiance - b.irradiance).mean() for a, b in both])), 4
        ),
    }


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()

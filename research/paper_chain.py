"""The paper's chain beside other models: is its LDR map more than a mean, is Eq. 7's HDR branch used.

    python -m research.paper_chain DATA                               # the frozen pairs
    python -m research.paper_chain DATA --part world --kept DIR       # path-traced, see research.world
    python -m research.paper_chain DATA --part left-out --kept DIR    # to choose by
    python -m research.paper_chain DATA --part frozen_public.txt      # of anyprobe_train.assets test

One flat colour and the blurred truths are made of the truth itself: they say what the figures' scale is. Spread is the
standard deviation over the pairs of a pixel of the LDR map, mean over pixels; above .8 is the share of pixels that Eq.
8 gives to the HDR branch. Standard errors by map and shape. The last rows are the first model less each other one, pair
by pair.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import Models
from anyprobe.light.reconstruct import THRESHOLD
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import load_maps, load_shapes
from anyprobe_train.dataset.pair import Pair
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.evaluate.methods import Method, baselines, model_methods, truth_methods
from anyprobe_train.evaluate.scoring import FROZEN, score_pairs
from anyprobe_train.evaluate.standard_errors import clustered_error
from research.kept_pairs import kept_pairs
from research.left_out import left_out_pairs
from research.world.pairs import world_pairs

FIGURES = {
    "ldr_rmse": "LDR RMSE",
    "ldr_gain_rmse": "after best gain",
    "ldr_ssim": "SSIM",
    "total_power_stops": "power, stops",
    "dominant_light_deg": "dominant light, mean",
}
PAIRS = 300


def pairs_of(part: str, data: Path, kept: Path | None) -> list[Pair]:
    """The frozen test pairs, the first PAIRS; the world test pairs, path-traced; those of assets that nothing learns
    from; or those of a list of recipes."""
    if part == "frozen" or Path(part).is_file():
        store = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))
        return list(kept_pairs(read_recipes(FROZEN if part == "frozen" else part)[:PAIRS], store, kept))
    if part == "left-out":
        return list(left_out_pairs(data, kept))
    if part == "world":
        return list(world_pairs(data, "test", kept))
    raise InputError(
        "expected frozen, world, left-out or a file of recipes, got another; name one", subject="part", source=part
    )


def spread(maps: list[np.ndarray]) -> float:
    """Mean over the pixels of LDR maps [H, 2H, 3] of the standard deviation over the maps."""
    return float(np.std(np.stack(maps), axis=0).mean())


def above(maps: list[np.ndarray]) -> float:
    """Share of the pixels in which Eq. 8 is not zero."""
    return float(np.mean([ldr.max(axis=-1) > THRESHOLD for ldr in maps]))


def differences(rows: list[dict], others: list[dict], maps: list[str], shapes: list[str]) -> list[str]:
    """Of each of FIGURES the mean over the pairs of what one model has more than another, and its standard error."""
    cells = []
    for figure in FIGURES:
        more = [row[figure] - other[figure] for row, other in zip(rows, others, strict=True)]
        cells.append(f"{np.mean(more):+.4f} +- {clustered_error(more, maps, shapes):.4f}")
    return cells


def main(
    data: Path,
    model: Annotated[list[str] | None, typer.Option(help="Name or folder of a model; may be repeated.")] = None,
    part: Annotated[str, typer.Option(help="frozen, world, left-out or a file of recipes.")] = "frozen",
    kept: Annotated[Path | None, typer.Option(help="Folder of rendered pairs.")] = None,
) -> None:
    """Print the table."""
    pairs = pairs_of(part, data, kept)
    methods: dict[str, Method] = {}
    for name in model or ["paper", "lift"]:
        methods[name] = next(iter(model_methods(Models(name, threads=1), name).values()))
    methods |= {"mean map": baselines()["mean map"], **truth_methods()}
    maps: dict[str, list[np.ndarray]] = {name: [] for name in methods}

    def watch(index: int, pair: Pair, estimates: dict) -> None:
        for name, one in estimates.items():
            maps[name].append(one.ldr)

    scores = score_pairs(track(pairs), methods, watch=watch)
    names = "".join(f" {heading} |" for heading in FIGURES.values())
    print(f"\n| {part}, {len(pairs)} pairs |{names} spread | above .8 |\n|---|{'---|' * (len(FIGURES) + 2)}")
    for name, rows in scores.rows.items():
        cells = [
            f"{np.mean(values):.3f} +- {clustered_error(values, scores.maps, scores.shapes):.3f}"
            for values in ([row[figure] for row in rows] for figure in FIGURES)
        ]
        print(f"| {name} | " + " | ".join([*cells, f"{spread(maps[name]):.3f}", f"{above(maps[name]):.3f}"]) + " |")
    true = [response(pair.radiance) for pair in pairs]
    print(f"| truth |{' |' * len(FIGURES)} {spread(true):.3f} | {above(true):.3f} |")
    (first, own), *others = scores.rows.items()
    for name, rows in others:
        print(f"| {first} - {name} | " + " | ".join(differences(own, rows, scores.maps, scores.shapes)) + " | | |")


if __name__ == "__main__":
    run_command(lambda: typer.run(main))

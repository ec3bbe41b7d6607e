"""What normals of depth are worth beside true ones: rendered pairs of the frozen test set, depth as sensors have it.

    python -m research.depth_normals DATA            # 60 pairs, evenly out of the 1,000

Depth is of the rendered surface along the camera's axis: exact, with noise of 0.5 % of the distance, as an 8-bit
picture of 0 to twice the distance, and as phones store it: an 8-bit picture of the disparity from half to twice the
distance, that also with a fifth of its mean too much, as disparity of relative accuracy may have. Errors are of the
normals that are known; without any, of the network's guesses.
"""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.cli.app import main as run_command
from anyprobe.estimate.depth_normals import normals_from_depth
from anyprobe.estimate.normals_hint import SHORTEST
from anyprobe.estimate.runtime import NORMALS_SIZE, Models
from anyprobe.learning.dataset.asset_store import AssetStore
from anyprobe.learning.dataset.catalog import load_maps, load_shapes
from anyprobe.learning.dataset.pair import Pair, _draw, _look, render_pair
from anyprobe.learning.dataset.recipe import read_recipes
from anyprobe.learning.evaluate.methods import true_normals
from anyprobe.learning.evaluate.scoring import FROZEN, score

PAIRS = 60
FIGURES = ("ldr_rmse", "dominant_light_deg")


def depths_of(pair: Pair, store: AssetStore) -> dict[str, np.ndarray]:
    """Depth images [S, S], zero beside the object, by what a sensor does to them."""
    rng = pair.recipe.rng()
    _, surface = _look(store.shape(pair.recipe.shape_id).mesh, _draw(pair.recipe, rng), pair.shape_name)
    exact = np.zeros(surface.mask.shape)
    exact[surface.mask] = surface.depth
    middle = float(np.median(surface.depth))
    noise = np.random.default_rng(pair.recipe.seed % 2**32).standard_normal(exact.shape)
    low, high = 0.5 / middle, 2.0 / middle
    disparity = np.round(np.clip((1 / np.where(exact > 0, exact, middle) - low) / (high - low), 0, 1) * 255) / 255
    disparity = low + (high - low) * disparity
    return {
        "exact depth": exact,
        "depth, noise 0.5 %": exact * (1 + 0.005 * noise),
        "depth, 8 bits": np.round(np.clip(exact / (2 * middle), 0, 1) * 255).astype(np.uint8),
        "disparity, 8 bits": np.where(exact > 0, 1 / disparity, 0),
        "disparity, 8 bits, offset": np.where(exact > 0, 1 / (disparity + 0.2 / middle), 0),
    }


def errors_deg(normals: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Angles where both are known."""
    known = normals.any(axis=-1) & true.any(axis=-1)
    return np.degrees(np.arccos(np.clip((normals[known] * true[known]).sum(axis=-1), -1, 1)))


def main(data: Path, pairs: Annotated[int, typer.Option()] = PAIRS) -> None:
    """Print the table."""
    store = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))
    models = Models(threads=1)
    found: dict[str, dict[str, list]] = defaultdict(lambda: defaultdict(list))
    recipes = read_recipes(FROZEN)
    for recipe in recipes[:: max(1, len(recipes) // pairs)][:pairs]:
        pair = render_pair(recipe, store)
        true = true_normals(pair)
        given: dict[str, np.ndarray | None] = {"none": None, "true normals": true}
        fov_deg = float(np.degrees(2 * np.arctan(pair.tan_half)))
        for name, depth in depths_of(pair, store).items():
            normals = normals_from_depth(depth, pair.crop[..., 3], fov_deg).normals
            given[name] = None if normals is None else _small(normals)
        for name, normals in given.items():
            outputs = models(pair.crop, pair.tan_half, normals)
            row, scores = found[name], score(outputs.radiance, pair.radiance)
            for figure in FIGURES:
                row[figure].append(scores[figure])
            seen = outputs.normals if normals is None else normals
            if name == "none" or normals is not None:
                row["error"].append(np.median(errors_deg(seen, true)))
                row["p90"].append(np.percentile(errors_deg(seen, true), 90))
            if name != "none":
                share = 0.0 if normals is None else normals.any(axis=-1).sum() / true.any(axis=-1).sum()
                row["known"].append(share)
                row["left"].append(normals is None)
    print("| normals given | LDR RMSE | dominant light, median | error, median | 90th percentile | known | left out |")
    print("|---|---|---|---|---|---|---|")
    for name, row in found.items():
        known = f"{np.mean(row['known']):.0%} | {sum(row['left'])}" if "known" in row else "| "
        print(
            f"| {name} | {np.mean(row['ldr_rmse']):.3f} | {np.median(row['dominant_light_deg']):.1f} "
            f"| {np.mean(row['error']):.1f} | {np.mean(row['p90']):.1f} | {known} |"
        )


def _small(normals: np.ndarray) -> np.ndarray:
    """[128, 128, 3] as models take them, see evaluate.methods.true_normals."""
    step = len(normals) // NORMALS_SIZE
    mean = normals.reshape(NORMALS_SIZE, step, NORMALS_SIZE, step, 3).mean(axis=(1, 3))
    length = np.linalg.norm(mean, axis=-1, keepdims=True)
    return np.where(length > SHORTEST, mean / np.maximum(length, SHORTEST), 0.0).astype(np.float32)


if __name__ == "__main__":
    run_command(lambda: typer.run(main))

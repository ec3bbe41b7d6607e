"""python -m research.compare: models and baselines on the frozen test set, by every published figure, into a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from rich.progress import track

from anyprobe.cli.app import main as run_command
from anyprobe.cli.options import bounded
from anyprobe.estimate.runtime import Models, model_id
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import load_maps, load_shapes
from anyprobe_train.dataset.recipe import digest, read_recipes, require_assets
from anyprobe_train.evaluate.methods import baselines, model_methods
from anyprobe_train.evaluate.scoring import FROZEN, GROUPS, OF_FROZEN, score_pairs
from research.compare.figures import score_pair
from research.compare.study import difference, means
from research.kept_pairs import kept_pairs
from research.model_names import titles_of
from research.results import commit, write_result

AHEAD = ("ldr_rmse", "sphere_rmse", "relight_rmse")
"""Figures by which the first model is set against each other method, pair by pair."""


def compare(
    *,
    hdri: Annotated[Path, Parameter(help="Folder of held-out maps, as for anyprobe-train evaluate.")],
    meshes: Annotated[Path, Parameter(help="Folder of held-out shapes.")],
    model: Annotated[list[str] | None, Parameter(help="Bundled model or folder of graphs; repeat for more.")] = None,
    pairs: Annotated[int, Parameter(help="The first so many pairs."), bounded(2, 1000)] = 1000,
    recipes: Annotated[
        Path | None, Parameter(help="List of pairs in the place of the frozen ones, such as DIR/frozen_public.txt.")
    ] = None,
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="File to write.")] = Path("runs/compare.json"),
    kept: Annotated[Path | None, Parameter(help="Folder that keeps rendered pairs for the next time.")] = None,
) -> None:
    """Score every method on the frozen test set or a list of pairs, by every figure of docs/reference/evaluation.md."""
    names = model or [DEFAULT_MODEL]
    methods = baselines()
    titles = titles_of(names)
    for name, title in zip(names, titles, strict=True):
        methods |= model_methods(Models(name), title)
    store = AssetStore(load_maps(hdri), load_shapes(meshes))
    chosen = read_recipes(recipes or FROZEN)[:pairs]
    advice = OF_FROZEN if recipes is None else "give the folders that they are made from"
    require_assets(chosen, store, recipes or FROZEN, advice)
    progress = track(kept_pairs(chosen, store, kept), "comparing", total=len(chosen))
    scores = score_pairs(progress, methods, score_pair)
    first = titles[0]
    write_result(
        out,
        {
            "commit": commit(),
            "models": {Path(name).name: model_id(name) for name in names},
            "recipes": digest(chosen),
            "groups": {
                group: {method: means(scores, method, group) for method in methods}
                for group in GROUPS
                if any(group in member for member in scores.groups)
            },
            "differences": {
                other: {name: difference(scores, first, other, name) for name in AHEAD}
                for other in methods
                if other != first
            },
        },
    )
    print(out)


if __name__ == "__main__":
    run_command(compare)

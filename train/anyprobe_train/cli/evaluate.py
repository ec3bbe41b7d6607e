"""anyprobe-train evaluate: a model beside trivial baselines, on held-out maps and shapes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter
from rich.console import Console
from rich.progress import track
from rich.table import Table

from anyprobe.cli.app import print_table
from anyprobe.cli.options import bounded, folder_option
from anyprobe.errors import InputError
from anyprobe.inputs.settings import DEFAULT_MODEL, SETTINGS
from anyprobe.notices import give

if TYPE_CHECKING:
    from anyprobe_train.dataset.asset_store import AssetStore
    from anyprobe_train.dataset.pair import Pair
    from anyprobe_train.dataset.recipe import Recipe
    from anyprobe_train.evaluate.methods import Estimate, Method

PAIRS = 200
SEED = 2020
Conditions = Literal["clean", "world"]
"""Conditions of test photos, as in dataset.recipe.CONDITIONS."""
CELL = 64
"""Side of a picture in the grid of pictures.png [pixels]."""


def evaluate(
    *,
    hdri: Annotated[Path, Parameter(help="Folder of held-out maps (.exr, .hdr; manifest.csv says indoor/outdoor).")],
    meshes: Annotated[Path, Parameter(help="Folder of held-out shapes (.ply, .obj, ...).")],
    pairs: Annotated[int, Parameter(help="Test pairs to render."), bounded(4)] = PAIRS,
    seed: Annotated[int, Parameter(help="Seed of the test set.")] = SEED,
    frozen: Annotated[bool, Parameter(name="--frozen", help="Take the first of the 1,000 frozen recipes.")] = False,
    recipes: Annotated[
        Path | None, Parameter(help="Take the pairs of a list, one recipe per line, such as frozen_public.txt.")
    ] = None,
    conditions: Annotated[
        Conditions, Parameter(help="clean photos; world: as phones take them, with noise, JPEG, blur, rough masks.")
    ] = "clean",
    hints: Annotated[
        bool, Parameter(name="--hints", help="Also score with true normals, material and surroundings given.")
    ] = False,
    write_photos: Annotated[
        Path | None, Parameter(help="Folder to write photos, masks and cameras to, by key; nothing is scored.")
    ] = None,
    predictions: Annotated[
        Path | None, Parameter(help="Folder of maps KEY.exr or KEY.hdr to score in the model's place.")
    ] = None,
    out: Annotated[Path, folder_option("Folder for scores.json and pictures.png.")] = Path("evaluation"),
    model: Annotated[str, Parameter(help=SETTINGS["model"].help)] = DEFAULT_MODEL,
) -> None:
    """Score a model, or any program's maps, on a test set. Renders it, scores two baselines too, and prints tables."""
    conflicts = (
        (seed != SEED and frozen, f"--seed {seed}", "pairs drawn at random", "--frozen"),
        (seed != SEED and recipes, f"--seed {seed}", "pairs drawn at random", "--recipes"),
        (frozen and recipes, "--frozen", "one list of pairs", "--recipes"),
        (recipes and conditions != "clean", f"--conditions {conditions}", "pairs whose list says none", "--recipes"),
        (predictions and write_photos, "--predictions", "photos written earlier", "--write-photos"),
        (write_photos and hints, "--hints", "pairs to score", "--write-photos"),
        (write_photos and model != DEFAULT_MODEL, "--model", "pairs to score", "--write-photos"),
        (predictions and hints, "--hints", "a model that takes hints", "--predictions"),
        (predictions and model != DEFAULT_MODEL, "--model", "a model's maps to score", "--predictions"),
    )
    for is_given, option, expected, other in conflicts:
        if is_given:
            raise InputError(f"expected {expected}, got {other}; leave one of them out", source=option)
    from anyprobe.estimate.runtime import model_id
    from anyprobe.files.atomic import atomic_files, atomic_path
    from anyprobe.pictures.images import write_png
    from anyprobe_train.dataset.pair import render_pair
    from anyprobe_train.dataset.recipe import digest
    from anyprobe_train.evaluate.benchmark import write_pair
    from anyprobe_train.evaluate.methods import baselines, truth_methods
    from anyprobe_train.evaluate.scoring import METRICS, score_pairs

    console = Console(stderr=True, markup=False, emoji=False, highlight=False)
    drawn = None if frozen or recipes else seed
    chosen, store = _test_set(hdri, meshes, pairs, drawn, recipes, conditions, console)
    title = Path(model).name if predictions is None else predictions.resolve().name
    rendered = (render_pair(one, store) for one in track(chosen, "evaluating", console=console))
    if write_photos is not None:
        with atomic_files(write_photos) as scratch:  # all of them, or none
            for pair in rendered:
                write_pair(scratch, pair)
        console.print(f"{write_photos}: {len(chosen)} photos; write the maps into another folder, named by key")
        return
    judged = _judged(predictions, [one.key for one in chosen], model, title, hints)
    watch = Watch(judged, title, len(chosen))
    scores = score_pairs(rendered, judged | baselines() | truth_methods(), watch=watch)
    result = {
        "settings": {
            "pairs": len(chosen),
            **({"recipes": recipes.name} if recipes is not None else {"frozen": True} if frozen else {"seed": seed}),
            **({} if recipes is not None else {"conditions": conditions}),
        },
        "model": model_id(model) if predictions is None else title,
        "recipes": digest(chosen),
        "maps": [asset.name for asset in store.maps.values()],
        "shapes": [asset.name for asset in store.shapes.values()],
        "better": METRICS,
        **watch.result(),
        "scores": scores.table(),
        "standard_errors": scores.standard_errors(),
    }
    with atomic_path(out / "scores.json") as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_png(out / "pictures.png", np.concatenate(watch.rows).astype(np.float32))
    _print(result["scores"], result["standard_errors"])
    if result["irradiance"] is not None:
        values = ", ".join(f"{name} {value:.4f}" for name, value in result["irradiance"].items())
        Console(highlight=False).print(f"irradiance image: {values}", soft_wrap=True)
    if result["confidence"] is not None:
        _print_confidence(title, result["confidence"], result["confidence_with_hints"])
    console.print(f"{out / 'scores.json'}, {out / 'pictures.png'}")


def _judged(predictions: Path | None, keys: list[str], model: str, title: str, hints: bool) -> dict[str, Method]:
    """Return the method to judge beside the baselines: maps of a folder, or a model."""
    from anyprobe.estimate.runtime import Models
    from anyprobe_train.evaluate.benchmark import read_predictions
    from anyprobe_train.evaluate.methods import Estimate, baselines, model_methods, truth_methods

    if predictions is not None:
        if title in baselines() | truth_methods():
            raise InputError(f"expected a folder named after its program, got {title!r}; rename it", source=predictions)
        maps = read_predictions(predictions, keys)
        return {title: lambda pair: Estimate.of_map(maps[pair.recipe.key])}
    runtime = Models(model)
    if hints and not runtime.takes:
        text = f"expected a model that takes normals, got {title}"
        raise InputError(text, subject="hints", remedy=give(model=DEFAULT_MODEL))
    return model_methods(runtime, title, hints)


def _test_set(
    hdri: Path, meshes: Path, pairs: int, seed: int | None, path: Path | None, conditions: Conditions, console: Console
) -> tuple[list[Recipe], AssetStore]:
    """Return `pairs` recipes, drawn by seed, or from the list at path, or the frozen ones; and the assets they name."""
    from anyprobe_train.dataset.asset_store import AssetStore
    from anyprobe_train.dataset.catalog import load_maps, load_shapes
    from anyprobe_train.dataset.recipe import CONDITIONS, balanced_recipes, read_recipes, require_assets
    from anyprobe_train.evaluate.scoring import FROZEN, OF_FROZEN

    def warn(line: str) -> None:
        console.print(f"warning: {line}", soft_wrap=True)

    listed = read_recipes(path or FROZEN) if seed is None else []
    if seed is None and pairs > len(listed):
        name = "--frozen" if path is None else path.name
        text = f"expected at most {len(listed)}, the pairs of {name}, got more; ask for fewer"
        raise InputError(text, subject="pairs", source=pairs)
    store = AssetStore(load_maps(hdri, report=warn), load_shapes(meshes, report=warn))
    advice = f"{OF_FROZEN}, or leave out --frozen" if path is None else "give the folders that they are made from"
    require_assets(listed[:pairs], store, path or "--frozen", advice)
    recipes = listed[:pairs] if seed is None else balanced_recipes(store, pairs, seed)
    if path is not None:
        return recipes, store  # a list says the conditions of its pairs
    return [replace(recipe, conditions=CONDITIONS.index(conditions)) for recipe in recipes], store


class Watch:
    """Record of all pairs with their estimates: calibration, the irradiance image, and pictures (paper, Fig. 11)."""

    def __init__(self, judged: Iterable[str], title: str, pairs: int) -> None:
        from anyprobe_train.evaluate.calibration import Calibration

        self.title, self.calibrations = title, {name: Calibration() for name in judged}
        self.irradiance: list[dict[str, float]] = []
        self.every = max(1, pairs // 16) | 1  # odd: even steps would show a few shapes only
        self.rows: list[np.ndarray] = []

    def __call__(self, index: int, pair: Pair, estimates: Mapping[str, Estimate]) -> None:
        from anyprobe.core.response import response
        from anyprobe_train.evaluate.metrics import psnr, rmse, ssim
        from anyprobe_train.evaluate.scoring import groups_of

        # whole picture, as in the paper's Table 1
        estimated = estimates[self.title].irradiance
        if estimated is not None:
            images = estimated, pair.irradiance / 255.0
            self.irradiance.append({"psnr": psnr(*images), "rmse": rmse(*images), "ssim": ssim(*images)})
        for name, calibration in self.calibrations.items():
            estimate = estimates[name]
            if estimate.confidence is not None:
                calibration.add(estimate.confidence, estimate.ldr, response(pair.radiance), groups_of(pair))
        if index % self.every == 0:
            self.rows.append(_cells(pair, estimates))

    def result(self) -> dict[str, Any]:
        """Return the mean figures of the irradiance image, None if there is none, and the model's confidence, without
        and with hints."""
        found = {name: calibration.result() for name, calibration in self.calibrations.items()}
        irradiance = {
            name: round(sum(row[name] for row in self.irradiance) / len(self.irradiance), 5)
            for name in next(iter(self.irradiance), {})
        }
        confidence = found.pop(self.title)
        return {"irradiance": irradiance or None, "confidence": confidence, "confidence_with_hints": found}


def _cells(pair: Pair, estimates: Mapping[str, Estimate]) -> np.ndarray:
    """Draw photo and true irradiance, then map, silver and mirror sphere of the truth and of each method, side by side:
    display values [CELL, W, 3]."""
    from anyprobe.core.response import response
    from anyprobe.render.spheres import mirror, silver

    cells = [pair.photo[::2, ::2, :3] / 255.0, pair.irradiance[::2, ::2] / 255.0]
    for radiance in (pair.radiance, *(one.lights for one in estimates.values())):
        cells.append(response(radiance))
        cells += [response(sphere(radiance, CELL)) for sphere in (silver, mirror)]
    return np.concatenate(cells, axis=1)


def _print(table: dict, errors: dict) -> None:
    from anyprobe_train.evaluate.scoring import HEADINGS

    show = Console(highlight=False)
    for group in next(iter(table.values())):
        print_table(show, _sheet(group, table, group, HEADINGS))
    means = {name: heading for name, heading in HEADINGS.items() if name in errors[next(iter(errors))]["all"]}
    print_table(show, _sheet("standard errors of all, by map and shape", errors, "all", means))


def _sheet(title: str, table: dict, group: str, headings: Mapping[str, str]) -> Table:
    """Return a table of a group's figures, one row per method."""
    sheet = Table("method", *headings.values(), title=title, title_justify="left")
    for method, groups in table.items():
        values = (groups[group][name] for name in headings)
        sheet.add_row(method, *("" if value is None else f"{value:.3f}" for value in values))
    return sheet


def _print_confidence(title: str, confidence: dict, hints: dict[str, dict]) -> None:
    """Print a row for all pixels, one for each group, and one for each prior (of all pixels)."""
    rows = {title: confidence, **confidence["groups"], **hints}
    sheet = Table(
        "confidence",
        *("claimed", "right", "ECE", "Brier", "log loss", "AUC"),
        title="confidence, in brackets: of a constant, the share of all pixels right (an oracle)",
        title_justify="left",
    )
    for row, figures in rows.items():
        columns = (f"{figures[name]:.3f} ({figures['constant'][name]:.3f})" for name in ("error", "brier", "log_loss"))
        auc = "" if figures["auc"] is None else f"{figures['auc']:.3f} (0.500)"
        sheet.add_row(row, f"{figures['claimed']:.3f}", f"{figures['right']:.3f}", *columns, auc)
    print_table(Console(highlight=False), sheet)

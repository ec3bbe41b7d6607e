"""anyprobe evaluate: a model beside trivial baselines, on maps and shapes it never saw."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from anyprobe.cli.data import Conditions
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import DEFAULT_ENGINE, DEFAULT_MODEL, ENGINES, LIFT_STAGES

if TYPE_CHECKING:
    from anyprobe.dataset.asset_store import AssetStore
    from anyprobe.dataset.pair import Pair
    from anyprobe.dataset.recipe import Recipe
    from anyprobe.evaluate.methods import Estimate, Method

UNPRINTED = ("total_power_stops", "ldr_rmse_seen", "ldr_rmse_unseen")
"""Metrics that are in scores.json alone."""
PAIRS = 200
SEED = 2020
WIDTH = 260
"""Characters of a printed line: no name of a row or a column is cut or broken."""
PATHS = 128
"""Paths per pixel of a path-traced photo."""
CELL = 64
"""Side of a picture in the grid [pixels]."""


def evaluate(
    hdri: Annotated[Path, typer.Option(help="Folder of held-out maps (.exr, .hdr; manifest.csv says indoor/outdoor).")],
    meshes: Annotated[Path, typer.Option(help="Folder of held-out shapes (.ply, .obj, ...).")],
    pairs: Annotated[int, typer.Option(min=4, help="Test pairs to render.")] = PAIRS,
    seed: Annotated[int, typer.Option(help="Seed of the test set.")] = SEED,
    frozen: Annotated[bool, typer.Option("--frozen", help="Take the first of the 1,000 frozen recipes.")] = False,
    conditions: Annotated[
        Conditions, typer.Option(help="clean photos; world: as phones take them, with noise, JPEG, blur, rough masks.")
    ] = "clean",
    noisy_masks: Annotated[
        bool, typer.Option("--noisy-masks", help="Masks 3 pixels too wide or narrow, with 5 % holes.")
    ] = False,
    path_traced: Annotated[
        bool, typer.Option("--path-traced", help="Photos by Mitsuba 3, with self-shadowing and interreflection.")
    ] = False,
    textured: Annotated[bool, typer.Option("--textured", help="Objects with mild texture or two materials.")] = False,
    hints: Annotated[
        bool, typer.Option("--hints", help="Also score with true normals, material and surroundings given.")
    ] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for scores.json and pictures.png.")] = Path(
        "evaluation"
    ),
    model: Annotated[str, typer.Option(help="Bundled model or folder of ONNX graphs.")] = DEFAULT_MODEL,
    engine: Annotated[str, typer.Option(help=f"Engine: {', '.join(ENGINES)}.")] = DEFAULT_ENGINE,
) -> None:
    """Score a model and two baselines on a test set. Renders a fixed test set and prints the table."""
    if frozen and seed != SEED:
        raise InputError(f"--seed {seed}: expected pairs that are drawn, got --frozen; leave one of them out")
    if textured and path_traced:
        raise InputError("--textured: expected photos that anyprobe shades, got --path-traced; leave one of them out")
    from anyprobe.dataset.pair import render_pair
    from anyprobe.dataset.recipe import digest
    from anyprobe.estimate.runtime import Models, model_id
    from anyprobe.evaluate.methods import baselines, model_methods, with_noisy_mask
    from anyprobe.evaluate.scoring import METRICS, score_pairs
    from anyprobe.files.atomic import atomic_path
    from anyprobe.files.images import write_png

    trace = None
    if path_traced:
        from anyprobe.relight.path_traced import open_mitsuba, trace_mesh

        open_mitsuba()  # one clear line where it cannot run
        trace = partial(trace_mesh, num_paths=PATHS)
    runtime, title = Models(model, engine=engine), Path(model).name
    if hints and runtime.stages != LIFT_STAGES:
        raise InputError(f"--hints: expected a model that takes normals, got {title}; use {DEFAULT_MODEL}")
    methods = model_methods(runtime, title, hints) | baselines()
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)
    recipes, store = _test_set(hdri, meshes, pairs, None if frozen else seed, conditions, talk)
    photos = (render_pair(recipe, store, trace, textured=textured) for recipe in recipes)
    watch = Watch(methods, title, len(recipes))
    columns = (TextColumn("evaluating"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=len(recipes))

        def seen(index: int, pair: Pair, estimates: dict[str, Estimate]) -> None:
            watch(index, pair, estimates)
            progress.advance(task)

        scores = score_pairs(map(with_noisy_mask, photos) if noisy_masks else photos, methods, watch=seen)
    result = {
        "settings": {
            "pairs": len(recipes),
            **({"frozen": True} if frozen else {"seed": seed}),
            "conditions": conditions,
            "noisy_masks": noisy_masks,
            "path_traced": path_traced,
            "textured": textured,
            "engine": engine,
        },
        "model": model_id(model),
        "recipes": digest(recipes),
        "maps": [asset.name for asset in store.maps.values()],
        "shapes": [asset.name for asset in store.shapes.values()],
        "better": METRICS,
        **watch.result(),
        "scores": scores.table(),
    }
    with atomic_path(out / "scores.json") as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_png(out / "pictures.png", np.concatenate(watch.rows).astype(np.float32))
    _print(result["scores"], result["irradiance"])
    if result["confidence"] is not None:
        _print_confidence(title, result["confidence"], result["confidence_with_hints"])
    talk.print(f"{out / 'scores.json'}, {out / 'pictures.png'}")


def _test_set(
    hdri: Path, meshes: Path, pairs: int, seed: int | None, conditions: Conditions, talk: Console
) -> tuple[list[Recipe], AssetStore]:
    """Recipes of so many pairs, drawn by seed or the frozen ones, and the assets they name."""
    from anyprobe.dataset.asset_store import AssetStore
    from anyprobe.dataset.catalog import load_maps, load_shapes
    from anyprobe.dataset.recipe import balanced_recipes, read_recipes
    from anyprobe.dataset.samples import CONDITIONS
    from anyprobe.evaluate.scoring import FROZEN

    def warn(line: str) -> None:
        talk.print(f"warning: {line}", soft_wrap=True)

    listed = read_recipes(FROZEN) if seed is None else []
    if seed is None and pairs > len(listed):
        raise InputError(
            f"--pairs {pairs}: expected at most the {len(listed)} pairs that --frozen has, got more; ask for fewer"
        )
    store = AssetStore(load_maps(hdri, report=warn), load_shapes(meshes, report=warn))
    recipes = listed[:pairs] if seed is None else balanced_recipes(store, pairs, seed)
    return [replace(one, conditions=CONDITIONS.index(conditions)) for one in recipes], store


class Watch:
    """Sees every pair with its estimates: calibration, the irradiance image, and a grid of pictures."""

    def __init__(self, methods: Mapping[str, Method], title: str, pairs: int) -> None:
        from anyprobe.evaluate.calibration import Calibration

        judged = (
            name for name in methods if name == title or name.startswith(f"{title}, ") and name.endswith(" given")
        )
        self.title, self.calibrations = title, {name: Calibration() for name in judged}
        self.irradiance: list[dict[str, float]] = []
        self.every = max(1, pairs // 16) | 1  # odd: even steps would show a few shapes only
        self.rows: list[np.ndarray] = []

    def __call__(self, index: int, pair: Pair, estimates: Mapping[str, Estimate]) -> None:
        from anyprobe.core.response import response
        from anyprobe.evaluate.metrics import psnr, rmse, ssim
        from anyprobe.evaluate.scoring import groups_of

        # whole picture, as in the paper's Table 1
        images = estimates[self.title].irradiance, pair.irradiance / 255.0
        self.irradiance.append({"psnr": psnr(*images), "rmse": rmse(*images), "ssim": ssim(*images)})
        for name, calibration in self.calibrations.items():
            one = estimates[name]
            if one.confidence is not None:
                calibration.add(one.confidence, one.ldr, response(pair.radiance), groups_of(pair))
        if index % self.every == 0:
            self.rows.append(_cells(pair, estimates))

    def result(self) -> dict[str, Any]:
        """Means of the irradiance image's figures, and the confidence of the model, alone and with hints."""
        found = {name: one.result() for name, one in self.calibrations.items()}
        irradiance = {
            name: round(sum(one[name] for one in self.irradiance) / len(self.irradiance), 5)
            for name in self.irradiance[0]
        }
        confidence = found.pop(self.title)
        return {"irradiance": irradiance, "confidence": confidence, "confidence_with_hints": found}


def _cells(pair: Pair, estimates: Mapping[str, Estimate]) -> np.ndarray:
    """Photo and true irradiance, then map, silver and mirror sphere of the truth and of each method, side by side:
    display values [CELL, W, 3]."""
    from anyprobe.core.response import response
    from anyprobe.render.spheres import mirror, silver

    cells = [pair.photo[::2, ::2, :3] / 255.0, pair.irradiance[::2, ::2] / 255.0]
    for radiance in (pair.radiance, *(one.lights for one in estimates.values())):
        cells.append(response(radiance))
        cells += [response(sphere(radiance, CELL)) for sphere in (silver, mirror)]
    return np.concatenate(cells, axis=1)


def _print(table: dict, irradiance: dict[str, float]) -> None:
    from anyprobe.evaluate.scoring import METRICS

    show = Console(highlight=False, width=WIDTH)
    columns = [name for name in METRICS if name not in UNPRINTED]
    titles = [name.replace("_deg", "").replace("_stops", "") for name in columns]
    for group in next(iter(table.values())):
        sheet = Table("method", *titles, title=group, title_justify="left")
        for method, groups in table.items():
            sheet.add_row(method, *[f"{groups[group][name]:.3f}" for name in columns])
        show.print(sheet)
    show.print("irradiance image: " + ", ".join(f"{name} {value:.4f}" for name, value in irradiance.items()))


def _print_confidence(title: str, confidence: dict, hints: dict[str, dict]) -> None:
    """A row for all pixels, for each group and, of all pixels, for each prior."""
    rows = {title: confidence, **confidence["groups"], **hints}
    sheet = Table(
        "confidence",
        *("claimed", "right", "ECE", "Brier", "log loss", "AUC"),
        title="confidence, in brackets: of a constant, the share of all pixels right (an oracle)",
        title_justify="left",
    )
    for row, one in rows.items():
        beside = (f"{one[name]:.3f} ({one['constant'][name]:.3f})" for name in ("error", "brier", "log_loss"))
        auc = "" if one["auc"] is None else f"{one['auc']:.3f} (0.500)"
        sheet.add_row(row, f"{one['claimed']:.3f}", f"{one['right']:.3f}", *beside, auc)
    Console(highlight=False, width=WIDTH).print(sheet)

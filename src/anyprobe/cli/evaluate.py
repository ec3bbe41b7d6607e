"""anyprobe evaluate: the shipped model beside trivial baselines, on maps and shapes it never saw."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from anyprobe.cli.evaluate_real import evaluate_real
from anyprobe.errors import InputError
from anyprobe.infer.engines import DEFAULT_ENGINE, ENGINES
from anyprobe.infer.runtime import DEFAULT_MODEL, LIFT_STAGES, SPREAD

COLUMNS = (
    "ldr_psnr",
    "ldr_rmse",
    "ldr_ssim",
    "ln_hdr_rmse",
    "angle_diffuse_deg",
    "angle_silver_deg",
    "angle_mirror_deg",
    "si_rmse_diffuse",
    "si_rmse_silver",
    "si_rmse_mirror",
    "main_light_deg",
    "main_light_median_deg",
    "flux_median_stops",
)
PAIRS = 200
SEED = 2020
WIDTH = 230
"""Of what is printed, in characters: no name of a row or a column is cut or broken."""
PATHS = 128
"""Through each pixel of a path-traced photo; what noise is left is a dim room's."""


class Conditions(StrEnum):
    """How the test photos are taken; the members are dataset.samples.CONDITIONS."""

    clean = "clean"
    world = "world"


def evaluate(
    hdri: Annotated[
        Path | None,
        typer.Option(help="Folder of held-out maps (.exr, .hdr; manifest.csv says indoor/outdoor)."),
    ] = None,
    meshes: Annotated[Path | None, typer.Option(help="Folder of held-out shapes (.ply, .obj, ...).")] = None,
    pairs: Annotated[int, typer.Option(min=4, help="Test pairs to render.")] = PAIRS,
    seed: Annotated[int, typer.Option(help="Seed of the test set.")] = SEED,
    frozen: Annotated[
        bool, typer.Option("--frozen", help="The first of the 1,000 recipes that never change.")
    ] = False,
    conditions: Annotated[
        Conditions,
        typer.Option(help="clean photos, or as the world gives them: noise, JPEG, blur, rough masks."),
    ] = Conditions.clean,
    noisy_masks: Annotated[
        bool, typer.Option("--noisy-masks", help="Cut every object out 3 pixels wrong, with 5 % holes.")
    ] = False,
    path_traced: Annotated[
        bool,
        typer.Option("--path-traced", help="Photos by Mitsuba 3: objects shadow and mirror themselves."),
    ] = False,
    textured: Annotated[
        bool,
        typer.Option(
            "--textured",
            help="Objects of mild texture or of two materials, other than what the paper assumes.",
        ),
    ] = False,
    told: Annotated[
        bool,
        typer.Option("--told", help="Also with true normals, true materials and what is around told."),
    ] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for scores.json and pictures.png.")] = Path(
        "evaluation"
    ),
    model: Annotated[
        list[str] | None,
        typer.Option(help="Bundled model, or a folder of graphs; with --real repeat for more."),
    ] = None,
    engine: Annotated[
        str, typer.Option(help=f"What computes it: one of {', '.join(ENGINES)}.")
    ] = DEFAULT_ENGINE,
    real: Annotated[
        Path | None,
        typer.Option(help="Folder of real photos with measured maps or known lamps instead."),
    ] = None,
    run: Annotated[
        Path | None, typer.Option(help="With --real: also the trained designs of a run's folder.")
    ] = None,
) -> None:
    """Render a fixed test set, score the model and two baselines, print the table."""
    models = model or [DEFAULT_MODEL]
    if real is not None:
        others = {
            "--hdri": hdri,
            "--meshes": meshes,
            "--pairs": pairs != PAIRS,
            "--seed": seed != SEED,
            "--frozen": frozen,
            "--conditions": conditions != Conditions.clean,
            "--noisy-masks": noisy_masks,
            "--path-traced": path_traced,
            "--textured": textured,
            "--told": told,
            "--engine": engine != DEFAULT_ENGINE,
        }
        for option, given in others.items():
            if given:
                raise InputError(
                    f"{option}: expected test pairs to render, got --real; leave one of them out"
                )
        evaluate_real(real, models, run, out)
        return
    if len(models) > 1 or run is not None:
        given = "--run" if run is not None else f"{len(models)} times --model"
        raise InputError(
            f"expected one model and no designs without --real DIR, got {given}; compare sets more beside"
        )
    name = models[0]
    if hdri is None or meshes is None:
        raise InputError(
            "expected --hdri DIR and --meshes DIR of held-out assets, or --real DIR, got neither"
        )
    if frozen and seed != SEED:
        raise InputError(f"--seed {seed}: expected pairs that are drawn, got --frozen; leave one of them out")
    if textured and path_traced:
        raise InputError(
            "--textured: expected photos that anyprobe shades, got --path-traced; leave one of them out"
        )
    from anyprobe.dataset.catalog import load_maps, load_shapes
    from anyprobe.dataset.pair import render_pair
    from anyprobe.dataset.plan import balanced_recipes
    from anyprobe.dataset.recipe import digest
    from anyprobe.dataset.samples import CONDITIONS
    from anyprobe.dataset.stock import Stock
    from anyprobe.evaluate.baselines import chrome_ball, mean_map
    from anyprobe.evaluate.calibration import Calibration
    from anyprobe.evaluate.methods import TOLD
    from anyprobe.evaluate.noisy_masks import with_noisy_mask
    from anyprobe.evaluate.pictures import PictureGrid
    from anyprobe.evaluate.protocol import METRICS
    from anyprobe.evaluate.protocol import run as run_methods
    from anyprobe.evaluate.test_set import FROZEN, read_recipes
    from anyprobe.files.atomic import atomic_path
    from anyprobe.files.images import write_png
    from anyprobe.infer.runtime import Models, model_id

    listed = read_recipes(FROZEN) if frozen else []
    if frozen and pairs > len(listed):
        raise InputError(
            f"--pairs {pairs}: expected at most the {len(listed)} pairs that --frozen has, got more; ask for fewer"
        )
    trace = _tracer() if path_traced else None
    runtime = Models(name, engine=engine)
    lifts = runtime.stages == LIFT_STAGES
    spread = runtime.with_lamps(SPREAD) if lifts else None
    title = Path(name).name
    if told and not lifts:
        raise InputError(
            f"--told: expected a model that can be told normals, got {title}; use {DEFAULT_MODEL}"
        )
    irradiance_scores, calibration = [], Calibration()
    asked = {f"{title}, told {what}": given for what, given in TOLD.items() if told}
    calibration_told = {row: Calibration() for row in asked}

    def network(pair):
        outputs = runtime(pair.crop, pair.tan_half)
        irradiance_scores.append(irradiance_score(outputs.irradiance, pair.irradiance / 255.0))
        _judge(calibration, outputs, pair)
        return outputs.radiance

    methods = {
        title: network,
        **({f"{title}, lamps {SPREAD}": partial(_radiance_told, spread, set())} if spread else {}),
        **{
            row: partial(_radiance_told, runtime, asked[row], calibration=calibration_told[row])
            for row in asked
        },
        "mean map": lambda pair: mean_map(),
        "chrome ball": lambda pair: chrome_ball(pair.crop),
    }
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)

    def warn(line: str) -> None:
        talk.print(f"warning: {line}", soft_wrap=True)

    stock = Stock(load_maps(hdri, report=warn), load_shapes(meshes, report=warn))
    recipes = listed[:pairs] if frozen else balanced_recipes(stock, pairs, seed)
    recipes = [replace(recipe, conditions=CONDITIONS.index(conditions.value)) for recipe in recipes]
    pairs = len(recipes)
    columns = (TextColumn("evaluating"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    grid = PictureGrid(every=max(1, pairs // 16) | 1)  # odd: even steps would show a few shapes only
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=pairs)

        def watch(index, pair, estimates):
            grid.add(index, pair, estimates)
            progress.advance(task)

        rendered = (render_pair(recipe, stock, trace, textured=textured) for recipe in recipes)
        scores = run_methods(map(with_noisy_mask, rendered) if noisy_masks else rendered, methods, watch)
    table = scores.table()
    irradiance = {
        name: round(sum(one[name] for one in irradiance_scores) / pairs, 5) for name in irradiance_scores[0]
    }
    result = {
        "command": f"anyprobe evaluate --hdri {hdri.name} --meshes {meshes.name} --pairs {pairs} "
        + ("--frozen" if frozen else f"--seed {seed}")
        + ("" if conditions is Conditions.clean else f" --conditions {conditions.value}")
        + (" --noisy-masks" if noisy_masks else "")
        + (" --path-traced" if path_traced else "")
        + (" --textured" if textured else "")
        + (" --told" if told else "")
        + ("" if name == DEFAULT_MODEL else f" --model {Path(name).name}")
        + ("" if engine == DEFAULT_ENGINE else f" --engine {engine}"),
        "model": model_id(name),
        "recipes": digest(recipes),
        "maps": [asset.name for asset in stock.maps.values()],
        "shapes": [asset.name for asset in stock.shapes.values()],
        "better": METRICS,
        "irradiance": irradiance,
        "confidence": calibration.result(),
        "confidence_told": {row: calibration_told[row].result() for row in calibration_told},
        "scores": table,
    }
    with atomic_path(out / "scores.json") as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_png(out / "pictures.png", grid.picture())
    _print(table, irradiance)
    if result["confidence"] is not None:
        _print_confidence(title, result["confidence"], result["confidence_told"])
    talk.print(f"{out / 'scores.json'}, {out / 'pictures.png'}")


def _judge(calibration, outputs, pair) -> None:
    """Count what a model claims of its map, if it claims anything."""
    from anyprobe.core.response import response
    from anyprobe.evaluate.groups import groups_of

    if outputs.confidence is not None:
        calibration.add(outputs.confidence, outputs.ldr, response(pair.radiance), groups_of(pair))


def _radiance_told(models, told: set[str], pair, calibration=None):
    from anyprobe.evaluate.methods import run_told

    outputs = run_told(models, pair, told)
    if calibration is not None:
        _judge(calibration, outputs, pair)
    return outputs.radiance


def _tracer() -> Callable:
    """Mitsuba's paths, or one clear line where it cannot run."""
    from anyprobe.relight.path_traced import open_mitsuba, trace_mesh

    open_mitsuba()
    return partial(trace_mesh, num_paths=PATHS)


def irradiance_score(estimate, truth) -> dict[str, float]:
    """PSNR, RMSE and SSIM of the irradiance image, whole picture as in the paper's Table 1."""
    from anyprobe.evaluate.metrics import psnr, rmse, ssim

    return {"psnr": psnr(estimate, truth), "rmse": rmse(estimate, truth), "ssim": ssim(estimate, truth)}


def _print(table: dict, irradiance: dict[str, float]) -> None:
    show = Console(highlight=False, width=WIDTH)
    for group in next(iter(table.values())):
        titles = [name.replace("_deg", "").replace("_stops", "") for name in COLUMNS]
        sheet = Table("method", *titles, title=group, title_justify="left")
        for method, groups in table.items():
            sheet.add_row(method, *[f"{groups[group][name]:.3f}" for name in COLUMNS])
        show.print(sheet)
    show.print("irradiance image: " + ", ".join(f"{name} {value:.4f}" for name, value in irradiance.items()))


def _print_confidence(title: str, confidence: dict, told: dict[str, dict]) -> None:
    """A row for all pixels, for each group and, of all pixels, for each thing told."""
    rows = {title: confidence, **confidence["groups"], **told}
    sheet = Table(
        "confidence",
        *("claimed", "right", "ECE", "Brier", "log loss", "AUC"),
        title="confidence, in brackets: a constant's, the share of all pixels right, which nobody knows beforehand",
        title_justify="left",
    )
    for row, one in rows.items():
        beside = (f"{one[name]:.3f} ({one['constant'][name]:.3f})" for name in ("error", "brier", "log_loss"))
        auc = "" if one["auc"] is None else f"{one['auc']:.3f} (0.500)"
        sheet.add_row(row, f"{one['claimed']:.3f}", f"{one['right']:.3f}", *beside, auc)
    Console(highlight=False, width=WIDTH).print(sheet)

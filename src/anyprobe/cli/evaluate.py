"""anyprobe evaluate: the shipped model beside trivial baselines, on maps and shapes it never saw."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from anyprobe.infer.runtime import DEFAULT_MODEL

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
)


def evaluate(
    hdri: Annotated[
        Path, typer.Option(help="Folder of held-out maps (.exr, .hdr; manifest.csv says indoor/outdoor).")
    ],
    meshes: Annotated[Path, typer.Option(help="Folder of held-out shapes (.ply, .obj, ...).")],
    pairs: Annotated[int, typer.Option(min=4, help="Test pairs to render.")] = 200,
    seed: Annotated[int, typer.Option(help="Seed of the test set.")] = 2020,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for scores.json and pictures.png.")] = Path(
        "evaluation"
    ),
    model: Annotated[str, typer.Option(help="Bundled model.")] = DEFAULT_MODEL,
) -> None:
    """Render a fixed test set, score the model and two baselines, print the table."""
    from anyprobe.dataset.catalog import load_maps, load_shapes
    from anyprobe.evaluate.baselines import chrome_ball, mean_map
    from anyprobe.evaluate.cases import draw_cases
    from anyprobe.evaluate.pictures import PictureGrid
    from anyprobe.evaluate.protocol import METRICS, run
    from anyprobe.files.atomic import atomic_path
    from anyprobe.files.images import write_png
    from anyprobe.infer.runtime import Models, model_id
    from anyprobe.light.reconstruct import reconstruct

    models = Models(model)
    irradiance_scores = []

    def network(case):
        outputs = models(case.photo)
        irradiance_scores.append(irradiance_score(outputs.irradiance, case.irradiance))
        return reconstruct(outputs.ldr, outputs.ln_radiance)

    methods = {
        model: network,
        "mean map": lambda case: mean_map(),
        "chrome ball": lambda case: chrome_ball(case.photo),
    }
    maps, shapes = load_maps(hdri), load_shapes(meshes)
    talk = Console(stderr=True)
    columns = (TextColumn("evaluating"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    grid = PictureGrid(every=max(1, pairs // 16) | 1)  # odd: even steps would show a few shapes only
    with Progress(*columns, console=talk) as progress:
        task = progress.add_task("", total=pairs)

        def watch(index, case, estimates):
            grid.add(index, case, estimates)
            progress.advance(task)

        scores = run(draw_cases(maps, shapes, pairs, seed), methods, watch)
    table = scores.table()
    irradiance = {
        name: round(sum(one[name] for one in irradiance_scores) / pairs, 5) for name in irradiance_scores[0]
    }
    result = {
        "command": f"anyprobe evaluate --hdri {hdri.name} --meshes {meshes.name} --pairs {pairs} --seed {seed}",
        "model": model_id(model),
        "maps": [asset.name for asset in maps],
        "shapes": [asset.name for asset in shapes],
        "better": METRICS,
        "irradiance": irradiance,
        "scores": table,
    }
    with atomic_path(out / "scores.json") as temporary:
        temporary.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    write_png(out / "pictures.png", grid.picture())
    _print(table, irradiance)
    talk.print(f"{out / 'scores.json'}, {out / 'pictures.png'}", highlight=False)


def irradiance_score(estimate, truth) -> dict[str, float]:
    """PSNR, RMSE and SSIM of the irradiance image, whole picture as in the paper's Table 1."""
    from anyprobe.evaluate.metrics import psnr, rmse, ssim

    return {"psnr": psnr(estimate, truth), "rmse": rmse(estimate, truth), "ssim": ssim(estimate, truth)}


def _print(table: dict, irradiance: dict[str, float]) -> None:
    show = Console(highlight=False, width=190)
    for group in next(iter(table.values())):
        sheet = Table(
            "method", *[name.replace("_deg", "") for name in COLUMNS], title=group, title_justify="left"
        )
        for method, groups in table.items():
            sheet.add_row(method, *[f"{groups[group][name]:.3f}" for name in COLUMNS])
        show.print(sheet)
    show.print("irradiance image: " + ", ".join(f"{name} {value:.4f}" for name, value in irradiance.items()))

"""anyprobe evaluate-masks: how well objects are found, told nothing, a click or a box, beside baselines."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import track
from rich.table import Table

from anyprobe.cli.options import need_torch
from anyprobe.errors import InputError


def evaluate_masks(
    data: Annotated[
        Path | None, typer.Option(help="Folder with hdri/test and meshes/test to render scenes of.")
    ] = None,
    scenes: Annotated[int, typer.Option(min=1, help="Scenes to render.")] = 200,
    photos: Annotated[
        Path | None, typer.Option(help="Folder of photos NAME.* with NAME_mask.png beside them.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the rendered scenes.")] = 2020,
    graph: Annotated[Path | None, typer.Option(help="Another mask network than the bundled one.")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for masks.json and overlays.")] = Path(
        "evaluation"
    ),
    overlays: Annotated[int, typer.Option(help="So many overlays of each told kind are drawn.")] = 16,
) -> None:
    """Score the mask network and baselines by IoU on rendered scenes, on photos, or on both."""
    from anyprobe.evaluate.masks import iou, methods, photo_cases
    from anyprobe.files.atomic import atomic_path
    from anyprobe.files.images import write_png
    from anyprobe.masks.overlay import draw_overlay
    from anyprobe.masks.propose import MaskNetwork

    if data is None and photos is None:
        raise InputError("evaluate-masks: expected --data DIR, --photos DIR or both, got neither")
    talk = Console(stderr=True, markup=False, emoji=False, highlight=False)
    compared = methods(MaskNetwork(graph))
    sets = {}
    if data is not None:
        need_torch("rendering scenes")
        from anyprobe.dataset.asset_store import load_asset_store
        from anyprobe.evaluate.mask_scenes import rendered_cases

        sets["scenes"] = rendered_cases(load_asset_store(data, "test", commercial_only=False), scenes, seed)
    if photos is not None:
        sets["photos"] = photo_cases(photos)
    scores: dict[str, dict[str, dict[str, float]]] = {}
    for group, cases in sets.items():
        scores[group] = {}
        total = scenes if group == "scenes" else None
        for number, case in enumerate(track(cases, group, total=total, console=talk)):
            found = {name: find(case) for name, find in compared.items()}
            scores[group][case.name] = {name: iou(mask, case.mask) for name, mask in found.items()}
            for name, mask in found.items():
                if number < overlays and name.endswith("network, GrabCut"):
                    given = name.split(":")[0]
                    empty = np.zeros(case.mask.shape, np.float32)
                    on = [case.click] if given == "click" else []
                    shown = draw_overlay(case.rgb, empty if mask is None else mask, on)
                    write_png(out / "overlays" / f"{case.name}_{given}.png", shown)
    with atomic_path(out / "masks.json") as temporary:
        temporary.write_text(json.dumps({"seed": seed, "iou": scores}, indent=1) + "\n", encoding="utf-8")
    show = Console(highlight=False, width=120)
    for group, rows in scores.items():
        if not rows:
            raise InputError(f"{photos}: expected photos with NAME_mask.png beside them, found none")
        sheet = Table(
            "told: method",
            "mean IoU",
            "median",
            "IoU >= 0.8",
            title=f"{group}, {len(rows)}",
            title_justify="left",
        )
        for name in compared:
            values = np.array([row[name] for row in rows.values()])
            sheet.add_row(
                name,
                f"{values.mean():.3f}",
                f"{np.median(values):.3f}",
                f"{100 * (values >= 0.8).mean():.0f} %",
            )
        show.print(sheet)
    talk.print(f"{out / 'masks.json'}, {out / 'overlays'}")

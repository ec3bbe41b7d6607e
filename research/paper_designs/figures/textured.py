"""Fig. 16: objects that are not of one material, and what `paper` makes of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.asset_store import AssetStore
from anyprobe.dataset.catalog import allows_commercial_use, load_maps, load_shapes
from anyprobe.dataset.pair import render_pair
from anyprobe.dataset.recipe import read_recipes
from anyprobe.estimate.runtime import Models
from anyprobe.evaluate.metrics import rmse, ssim
from anyprobe.evaluate.scoring import FROZEN
from research.paper_designs.figures.sheet import Tile, save, sheet

ROWS, MEASURED = 4, 40


def draw_textured(data: Path, out: Path) -> None:
    """Draw the first frozen pairs, textured, whose assets may be published; print figures of the first MEASURED, as
    they are and textured."""
    store = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))
    paper, rows = Models("paper", threads=1), []
    known = [one for one in read_recipes(FROZEN) if one.map_id in store.maps and one.shape_id in store.shapes]
    figures: dict[bool, list[list[float]]] = {False: [], True: []}
    for recipe in known[:MEASURED]:
        shown = []
        for textured in (False, True):
            pair = render_pair(recipe, store, textured=textured)
            found = paper(pair.crop, pair.tan_half)
            true_image, truth, ldr = pair.irradiance / 255.0, response(pair.radiance), found.ldr.clip(0, 1)
            errors = [rmse(found.irradiance, true_image), rmse(ldr, truth), ssim(ldr, truth)]
            figures[textured].append(errors)
            mask = pair.photo[..., 3:] > 0
            shown.append(Tile(picture=np.where(mask, pair.crop[..., :3], 1.0)))
            shown.append(Tile(picture=np.where(mask, found.irradiance, 1.0), corner=f"{errors[0]:.3f}"))
        shown.append(Tile(picture=np.where(mask, true_image, 1.0)))
        shown += [Tile(picture=ldr, corner=f"{errors[1]:.3f}"), Tile(picture=truth)]
        licences = store.map(recipe.map_id).licence, store.shape(recipe.shape_id).licence
        if len(rows) < ROWS and all(map(allows_commercial_use, licences)):
            rows.append(shown)
    for textured, values in figures.items():
        means = np.mean(values, axis=0)
        what = "textured or of two materials" if textured else "one material"
        print(
            f"{what}: irradiance RMSE {means[0]:.4f}, LDR RMSE {means[1]:.4f}, SSIM {means[2]:.4f}; {len(values)} pairs"
        )
    titles = ["one material", "irradiance", "textured", "irradiance", "true irradiance", "LDR map, textured", "truth"]
    save(sheet(titles, rows), out / "figure_16.png")

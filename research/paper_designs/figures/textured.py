"""Fig. 16: objects that are not of one material, and what `paper` makes of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.runtime import Models
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import allows_commercial_use, load_maps, load_shapes
from anyprobe_train.dataset.pair import Pair, render_pair
from anyprobe_train.dataset.recipe import read_recipes
from anyprobe_train.dataset.textured import draw_texture, lay, locate
from anyprobe_train.evaluate.metrics import rmse, ssim
from anyprobe_train.evaluate.scoring import FROZEN
from research.paper_designs.figures.sheet import Tile, save, sheet

ROWS, MEASURED = 4, 40
ONE, MANY = "one material", "textured"


def draw_textured(data: Path, out: Path) -> None:
    """Draw the first frozen pairs, each of another map, whose assets may be published, as they are and textured; print
    figures of the first MEASURED."""
    store = AssetStore(load_maps(data / "hdri" / "test"), load_shapes(data / "meshes" / "test"))
    paper, rows, drawn = Models("paper", threads=1), [], set()
    known = [one for one in read_recipes(FROZEN) if one.map_id in store.maps and one.shape_id in store.shapes]
    figures: dict[str, list[list[float]]] = {ONE: [], MANY: []}
    for recipe in known[:MEASURED]:
        pair = render_pair(recipe, store)
        truth, true_image = response(pair.radiance), pair.irradiance / 255.0
        tiles = []
        for name, shown in ((ONE, pair), (MANY, textured(pair))):
            found, mask = paper(shown.crop, shown.tan_half), shown.photo[..., 3:] > 0
            ldr = found.ldr.clip(0, 1)
            figures[name].append([rmse(found.irradiance, true_image), rmse(ldr, truth), ssim(ldr, truth)])
            tiles.append(Tile(picture=np.where(mask, shown.crop[..., :3], 1.0)))
            tiles.append(Tile(picture=np.where(mask, found.irradiance, 1.0), corner=f"{figures[name][-1][0]:.3f}"))
            tiles.append(Tile(picture=ldr, corner=f"{figures[name][-1][1]:.3f}"))
        tiles += [Tile(picture=np.where(mask, true_image, 1.0)), Tile(picture=truth)]
        licences = store.map(recipe.map_id).licence, store.shape(recipe.shape_id).licence
        if len(rows) < ROWS and recipe.map_id not in drawn and all(map(allows_commercial_use, licences)):
            drawn.add(recipe.map_id)
            rows.append(tiles)
    for name, values in figures.items():
        means = np.mean(values, axis=0)
        print(
            f"{name}: irradiance RMSE {means[0]:.4f}, LDR RMSE {means[1]:.4f}, SSIM {means[2]:.4f}; {len(values)} pairs"
        )
    titles = [ONE, "irradiance", "LDR map", MANY, "irradiance", "LDR map", "true irradiance", "true LDR map"]
    save(sheet(titles, rows), out / "figure_16.jpg")


def textured(pair: Pair) -> Pair:
    """The pair with a texture of full contrast printed on its object: all that it reflects is multiplied by it."""
    rng, normals = np.random.default_rng(pair.recipe.seed % 2**32), np.asarray(pair.normals, np.float32)
    mask = normals.any(axis=-1)
    pattern = lay(draw_texture(rng), locate(normals)[mask], normals[mask], rng)
    photo, pattern = pair.photo.copy(), pattern / np.maximum(pattern.mean(axis=0), 1e-3)
    shown = response(inverse_response(photo[mask, :3] / 255.0) * pattern)
    photo[mask, :3] = np.round(shown.clip(0, 1) * 255)
    return replace(pair, photo=photo)

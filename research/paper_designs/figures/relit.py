"""Fig. 14: a virtual object in the light that each of the three methods estimates, and in the true light."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from anyprobe.core.response import inverse_response
from anyprobe.light.environment import MAP_HEIGHT
from research.compare.figures import relight_scores, relit
from research.paper_designs.blocks import picture_of
from research.paper_designs.figures.sheet import Tile, save, sheet
from research.paper_designs.figures.trained import (
    MEASURED,
    METHODS,
    Maps,
    Trained,
    judged_batch,
    judged_pairs,
    maps_of,
    photo_of,
)

ROWS = 2
"""Pairs shown of each material group."""


def draw_relit(one: Trained, out: Path) -> None:
    """Draw the object beside the photo, and print the mean RMSE of its display values over test pairs.

    Ours is lit by Eq. 7, the rivals by their LDR maps through the inverse curve: neither says what is above white. The
    true light is the test pair's, above white too.
    """
    rows, errors = [], {name: [] for name in METHODS}
    side, map_rows = one.run.scale.side, one.run.scale.rows
    for specular in (True, False):
        batch = judged_batch(one, judged_pairs(one, specular, ROWS, shown=True))
        maps = maps_of(one.nets, batch, side, map_rows)
        for k, photo in enumerate(photo_of(batch, side)):
            lights = _lights(maps, batch.ln_radiance, map_rows, k)
            scores = relight_scores(lights)
            row = [Tile(picture=photo, caption="specular" if specular else "diffuse")]
            shown = relit(lights)
            row += [
                Tile(picture=picture, corner=f"{score['relight_rmse']:.3f}")
                for picture, score in zip(shown[1:], scores, strict=True)
            ]
            rows.append([*row, Tile(picture=shown[0])])
        every = judged_batch(one, judged_pairs(one, specular, MEASURED))
        maps = maps_of(one.nets, every, side, map_rows)
        for k in range(len(every.light)):
            scores = relight_scores(_lights(maps, every.ln_radiance, map_rows, k))
            for name, score in zip(METHODS, scores, strict=True):
                errors[name].append(score["relight_rmse"])
    for name, values in errors.items():
        print(f"{METHODS[name]}: RMSE of the relit object {np.mean(values):.4f}, {len(values)} pairs")
    save(sheet(["photo", *METHODS.values(), "true light"], rows), out / "figure_14.jpg")


def _lights(maps: Maps, ln_radiance, rows: int, k: int) -> list[np.ndarray]:
    """Radiance maps of pair k, the truth first, then METHODS; each pixel repeated up to MAP_HEIGHT rows."""
    truth = picture_of(ln_radiance[k : k + 1], rows)[0].permute(1, 2, 0).float().exp().numpy()
    lights = [truth]
    for name in METHODS:
        lights.append(maps.radiance[k] if name == "ours" else inverse_response(maps.ldr[name][k]))
    times = MAP_HEIGHT // rows
    return [np.repeat(np.repeat(one, times, axis=0), times, axis=1).astype(np.float32) for one in lights]

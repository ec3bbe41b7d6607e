"""Fig. 14: a virtual object in the light that each of the methods estimates, and in the true light."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from anyprobe_train.dataset.pair import Pair
from research.compare.figures import relight_scores, relit
from research.paper_designs.figures.half_size import DESIGNS, METHODS, NOTE, RELIT, HalfSize, kept_scores
from research.paper_designs.figures.rivals import estimates, on_white
from research.paper_designs.figures.sheet import Tile, save, sheet


def draw_relit(half: HalfSize, pairs: Iterable[Pair], out: Path) -> None:
    """Draw the object beside the photos, and print the kept mean RMSE of its display values over 1,000 frozen pairs.

    Ours is lit by Eq. 7, the rivals by their LDR maps through the inverse curve: neither says what is above white. The
    true light is the pair's, above white too.
    """
    rows = []
    for pair in pairs:
        lights = _lights(half, pair)
        row = [Tile(picture=on_white(pair.crop), caption="specular" if pair.specular else "diffuse")]
        pictures = relit(lights)
        for picture, score in zip(pictures[1:], relight_scores(lights), strict=True):
            row.append(Tile(picture=picture, corner=f"{score['relight_rmse']:.3f}"))
        rows.append([*row, Tile(picture=pictures[0], caption=pair.map_name)])
    kept = kept_scores(RELIT)["all"]
    values = {row["design"]: row["relight_rmse"] for row in kept["rows"]}
    for name, title in DESIGNS.items():
        print(f"{title}: RMSE of the relit object {values[name]:.3f}, {kept['pairs']} pairs")
    save(sheet(["photo", *METHODS, "true light"], rows, NOTE), out / "figure_14.jpg")


def _lights(half: HalfSize, pair: Pair) -> list[np.ndarray]:
    """Radiance maps, the truth first, then METHODS."""
    return [pair.radiance, *(one.lights for one in estimates(half, pair).values())]

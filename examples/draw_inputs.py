"""Draw docs/inputs.png: what normals, material and surroundings change in the light of five photos.

    python examples/draw_inputs.py

Our own figures under our own maps, with seeds that no training used. Each row: photo, true light, then the
estimate from the photo alone and with each input of evaluate.methods.GIVEN_HINTS; each light as environment map and as
a white and a silver sphere.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.estimate.runtime import Models
from anyprobe.render.spheres import diffuse, silver
from anyprobe_train.dataset.asset_store import AssetStore, own_map
from anyprobe_train.dataset.catalog import ShapeAsset
from anyprobe_train.dataset.drawn_shapes import figure
from anyprobe_train.dataset.pair import render_pair
from anyprobe_train.dataset.recipe import balanced_recipes
from anyprobe_train.evaluate.methods import GIVEN_HINTS, run_with_hints

TITLES = ("photo", "true light", "photo alone", *GIVEN_HINTS)
ROWS, CELL, GAP, TOP = 5, 64, 10, 16
SEED = 2_000_011


def main(path: Path) -> None:
    """Render the pairs, estimate with each input, write the sheet."""
    maps = [own_map(SEED, index) for index in range(ROWS)]
    shapes = [
        ShapeAsset(
            id=f"{index:08x}", name=f"figure {index}", licence="own", mesh=figure(np.random.default_rng((SEED, index)))
        )
        for index in range(ROWS)
    ]
    store = AssetStore(maps, shapes)
    models = Models()
    rows = []
    for recipe in balanced_recipes(store, ROWS, SEED):
        pair = render_pair(recipe, store)
        lights = [
            pair.radiance,
            *(run_with_hints(models, pair, given).radiance for given in (set(), *GIVEN_HINTS.values())),
        ]
        photo = pair.photo[..., :3].reshape(CELL, 2, CELL, 2, 3).mean(axis=(1, 3)) / 255
        rows.append([photo, *(look(radiance) for radiance in lights)])
    widths = [cell.shape[1] for cell in rows[0]]
    sheet = np.ones((TOP + ROWS * (CELL + 2), sum(widths) + GAP * (len(widths) - 1), 3), np.float32)
    for r, row in enumerate(rows):
        x = 0
        for cell in row:
            y = TOP + r * (CELL + 2)
            sheet[y : y + CELL, x : x + cell.shape[1]] = cell
            x += cell.shape[1] + GAP
    image = Image.fromarray(to_bytes(sheet))
    draw, font, x = ImageDraw.Draw(image), ImageFont.load_default(11), 0
    for title, width in zip(TITLES, widths, strict=True):
        draw.text((x, 1), title, fill=(0, 0, 0), font=font)
        x += width + GAP
    image.save(path, optimize=True)


def look(radiance: np.ndarray) -> np.ndarray:
    """A light as one picture [64, 256, 3]: the map, a white sphere and a silver sphere."""
    return np.concatenate(
        [response(v).clip(0, 1) for v in (radiance, diffuse(radiance, CELL), silver(radiance, CELL))], axis=1
    )


if __name__ == "__main__":
    main(Path(__file__).parent.parent / "docs" / "inputs.png")

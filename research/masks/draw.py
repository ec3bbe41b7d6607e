"""Draw docs/masks.png: what is found when nothing, a click, two clicks or a box is told.

    python -m research.masks.draw

Scenes of our own shapes under our own maps that no training has seen; the upper row is what was
given, the lower one what `anyprobe mask` shows.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from PIL import Image, ImageDraw

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import to_bytes
from anyprobe.estimate.sheet import draw_overlay
from anyprobe.masks.find import find_mask
from anyprobe.pictures.images import read_image
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.mask_network.composites import draw_scene
from anyprobe_train.mask_network.examples import cover_box, unasked_target
from anyprobe_train.mask_network.foregrounds import TexturePool, ViewSource

SIZE = 480
TILE = 240
GAP = 6
SEED = 77
"""Seed of the scenes; those that show one clear object are taken in turn."""


SHEET = Path(__file__).parents[2] / "docs" / "masks.png"


def main(*, path: Annotated[Path, Parameter(name="-o", help="The sheet.")] = SHEET) -> None:
    """Render scenes, ask four ways, write the sheet."""
    rng = np.random.default_rng(SEED)
    store = load_asset_store(None, "test", procedural_maps=4, seed=SEED)
    textures = TexturePool(SEED, 40, [one.radiance for one in store.maps.values()])
    views = ViewSource(store, textures, SEED, size=256)
    columns = []
    number = 0
    while len(columns) < 4:
        scene = draw_scene(rng, views.view(number), views.textures, SIZE)
        number += 1
        target = unasked_target(scene)
        if target is None or scene.bounds != (0, SIZE, 0, SIZE) or len(scene.covers) < 2:
            continue
        rgb = scene.photo.permute(1, 2, 0).numpy()
        columns.append(_column(rgb, scene.covers.numpy(), target, len(columns), cover_box(scene.covers[target])))
    Image.fromarray(np.concatenate(columns, axis=1)).quantize(192).save(path, optimize=True)


def _column(rgb: np.ndarray, covers: np.ndarray, target: int, kind: int, box) -> np.ndarray:
    """The photo with what is told over the mask that is found, [2 TILE + 3 GAP, TILE + GAP, 3] uint8."""
    on, off = _middle(covers[target]), _middle(np.delete(covers, target, axis=0).sum(axis=0))
    hints = [{}, {"click": [on]}, {"click": [on], "exclude": [off]}, {"box": tuple(map(float, box))}][kind]
    found = find_mask(read_image(rgb), **hints)
    clicks = hints.get("click", ()), hints.get("exclude", ())
    given = Image.fromarray(to_bytes(draw_overlay(rgb, np.ones(rgb.shape[:2], np.float32), *clicks)))
    if "box" in hints:
        ImageDraw.Draw(given).rectangle(hints["box"], outline=(26, 255, 102), width=3)
    shown = Image.fromarray(to_bytes(draw_overlay(rgb, found.mask)))
    column = Image.new("RGB", (TILE + GAP, 2 * TILE + 3 * GAP), "white")
    for row, picture in enumerate((given, shown)):
        column.paste(picture.resize((TILE, TILE), Image.Resampling.LANCZOS), (GAP // 2, GAP + row * (TILE + GAP)))
    return np.asarray(column)


def _middle(cover: np.ndarray) -> tuple[float, float]:
    """The covered pixel nearest to the cover's centre of mass."""
    rows, columns = np.nonzero(cover > 0.9)
    nearest = np.hypot(rows - rows.mean(), columns - columns.mean()).argmin()
    return float(columns[nearest]) + 0.5, float(rows[nearest]) + 0.5


if __name__ == "__main__":
    run_command(main)

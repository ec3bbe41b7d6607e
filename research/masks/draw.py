"""Draw docs/masks.png: what is found when nothing, a click, two clicks or a box is told.

    python -m research.masks.draw --data DATA

Photos of the fast world in scenes that no training has seen; the upper row is what was given, the lower one what
`anyprobe mask` shows.
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
from anyprobe.masks.check import object_box
from anyprobe.masks.find import find_mask
from anyprobe.pictures.images import read_image
from anyprobe_train.mask_network.examples import unasked_target
from anyprobe_train.mask_network.scenes import draw_scene, photograph
from anyprobe_train.world.batch import World

SIZE = 320
TILE = 240
GAP = 6
SEED = 77
"""Seed of the scenes; those that show one clear object are taken in turn."""


SHEET = Path(__file__).parents[2] / "docs" / "masks.png"


def main(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri/train and meshes/train.")],
    path: Annotated[Path, Parameter(name="-o", help="The sheet.")] = SHEET,
) -> None:
    """Photograph scenes, ask four ways, write the sheet."""
    rng = np.random.default_rng(SEED)
    world = World.open(data, Path("runs/world"))
    columns = []
    number = 0
    while len(columns) < 4:
        scene = draw_scene(world, SEED, number, SIZE)
        number += 1
        half = min(scene.frame.tangents)
        shot = photograph(rng, scene, (-half, half, half, -half), SIZE)
        target = unasked_target(shot)
        if target is None or (shot.covers.sum(axis=(1, 2)) > TILE).sum() < 2:
            continue
        columns.append(_column(shot.photo, shot.covers, target, len(columns), object_box(shot.covers[target])))
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

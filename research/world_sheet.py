"""python -m research.world_sheet --data DATA --cache DIR: forty photos that the light network learns from, each over
the light that its answer is compared with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from PIL import Image

from anyprobe.cli.app import main as run_command
from anyprobe.core.color import to_bytes
from anyprobe.core.response import response
from anyprobe.files.atomic import atomic_path
from anyprobe_train.world.batch import World, make_batch

COLUMNS, ROWS, SEED = 8, 5, 7
PHOTO_PX = 128
"""Width of a photo, and of the map under it."""


def main(
    *,
    data: Annotated[Path, Parameter(help="Folder with hdri and meshes.")],
    cache: Annotated[Path, Parameter(help="Folder of the world, as runs/world of a training.")],
    out: Annotated[Path, Parameter(name=("--out", "-o"), help="Picture to write.")] = Path("runs/training.jpg"),
) -> None:
    """Draw photos of batch 0: squares around them, without a mask's outline."""
    batch = make_batch(World.open(data, cache, batch=COLUMNS * ROWS), SEED, 0)
    high = PHOTO_PX + PHOTO_PX // 2
    sheet = np.zeros((ROWS * high, COLUMNS * PHOTO_PX, 3), np.uint8)
    for number, (photo, truth) in enumerate(zip(batch.context[..., :3], batch.truth, strict=True)):
        y, x = number // COLUMNS * high, number % COLUMNS * PHOTO_PX
        square = Image.fromarray(photo).resize((PHOTO_PX, PHOTO_PX), Image.Resampling.BICUBIC)
        sheet[y : y + PHOTO_PX, x : x + PHOTO_PX] = square
        light = to_bytes(response(truth.astype(np.float32)))
        sheet[y + PHOTO_PX : y + high, x : x + PHOTO_PX] = Image.fromarray(light).resize((PHOTO_PX, PHOTO_PX // 2))
    with atomic_path(out) as temporary:
        Image.fromarray(sheet).save(temporary, "JPEG", quality=85)
    print(out)


if __name__ == "__main__":
    run_command(main)

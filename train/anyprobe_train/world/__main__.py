"""python -m anyprobe_train.world: commands prepare, speed, sheet."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.cli.app import new_app
from anyprobe.cli.options import bounded

app = new_app(__doc__)
DataFolder = Annotated[Path, Parameter(help="Folder with hdri and meshes.")]
Cache = Annotated[Path, Parameter(help="Folder for what is made once.")]


@app.command()
def prepare(
    *,
    data: DataFolder,
    cache: Cache,
    files: Annotated[int, Parameter(help="Files of views, 48 in each."), bounded(1)] = 64,
    every: Annotated[int, Parameter(help="Make one of so many: for several processes."), bounded(1)] = 1,
    first: Annotated[int, bounded(0)] = 0,
) -> None:
    """Make maps, places, covers and views that are missing."""
    from anyprobe_train.world.batch import World

    world = World.open(data, cache)
    for number in range(first, files, every):
        print(world.views.make(number))


@app.command()
def speed(*, data: DataFolder, cache: Cache, batches: int = 4, batch: int = 32, profile: bool = False) -> None:
    """Print milliseconds of the processor for each photo, of batches after the first."""
    import cProfile
    import pstats

    from anyprobe_train.world.batch import World, make_batch

    world = World.open(data, cache, batch=batch)
    make_batch(world, 0, 0)
    profiler = cProfile.Profile()
    start = time.process_time()
    if profile:
        profiler.enable()
    for k in range(1, batches + 1):
        make_batch(world, 0, k)
    if profile:
        profiler.disable()
        pstats.Stats(profiler).sort_stats("tottime").print_stats(25)
    print(f"{1000 * (time.process_time() - start) / batches / batch:.1f} ms a photo")


@app.command()
def sheet(
    out: Path,
    /,
    *,
    data: DataFolder,
    cache: Cache,
    seed: int = 1,
    count: int = 40,
    family: str | None = None,
    files: int = 64,
) -> None:
    """Draw photos with their objects' windows, what is seen, and the true light."""
    from PIL import Image

    from anyprobe.core.response import response
    from anyprobe_train.world.batch import PHOTO_FAMILIES, World, make_batch

    world = World.open(data, cache, first=files)
    tiles: list[np.ndarray] = []
    k = 0
    while len(tiles) < count:
        batch = make_batch(world, seed, k)
        k += 1
        for n in range(len(batch.family)):
            if family is not None and PHOTO_FAMILIES[batch.family[n]] != family:
                continue
            truth = np.round(255 * np.clip(response(batch.truth[n].astype(np.float32)), 0, 1)).astype(np.uint8)
            side = np.zeros((128, 184, 3), np.uint8)
            side[:64, :128], side[64:, :128] = truth, batch.seen[n, ..., :3]
            side[8:56, 132:180] = batch.crop[n, ::2, ::2, :3]
            side[72:120, 132:180] = np.uint8(batch.normals[n].astype(int) + 128)
            left = np.zeros((128, 104, 3), np.uint8)
            left[16:112, 4:100] = batch.context[n, ..., :3]
            tiles.append(np.hstack([left, side]))
    rows = [np.hstack(tiles[i : i + 4]) for i in range(0, count - count % 4, 4)]
    Image.fromarray(np.vstack(rows)).save(out)
    print(out)


if __name__ == "__main__":
    run_command(app)

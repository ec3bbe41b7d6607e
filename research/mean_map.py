"""python -m research.mean_map DATA: the mean training map, the baseline of `anyprobe-train evaluate`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter
from cyclopts.types import ExistingDirectory

from anyprobe.cli.app import main as run_command
from anyprobe.maps.radiance import write_exr
from anyprobe_train.world.batch import World, make_batch

SEED, BATCHES = 7, 64
LN_LOW = -7.0
"""Least ln radiance that counts."""


def mean_map(maps: Iterable[np.ndarray]) -> np.ndarray:
    """Return exp(mean ln radiance) of batches of maps [N, H, 2H, 3], in the camera's frame and photos' exposure."""
    means = [np.log(np.maximum(one.astype(np.float32), np.exp(LN_LOW))).mean(axis=0) for one in maps]
    return np.exp(np.mean(means, axis=0)).astype(np.float32)


def main(
    data: Annotated[ExistingDirectory, Parameter(help="Folder with hdri and meshes.")],
    /,
    *,
    to: Annotated[Path, Parameter(name="-o", help="The .exr.")] = Path("src/anyprobe/weights/mean_map.exr"),
    runs: Annotated[Path, Parameter(help="Folder of the trained runs, for the cache.")] = Path("runs"),
) -> None:
    """Write the mean map of the light network's photos."""
    world = World.open(data, runs / "world")
    write_exr(to, mean_map(make_batch(world, SEED, k).truth for k in range(BATCHES)))
    print(to)


if __name__ == "__main__":
    run_command(main)

"""python -m research.export_weights.mean_map: the mean training map, the baseline of `anyprobe-train evaluate`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import torch
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.errors import InputError
from anyprobe.maps.radiance import write_exr
from anyprobe_train.dataset.pair_source import PairSource
from anyprobe_train.train.config import RUNS
from anyprobe_train.train.dataloader import make_pairs

STRIDE = 6
"""Steps between two batches that count: neighbouring ones share lights."""


def write_mean_map(source: PairSource, path: Path, batches: int = 64) -> None:
    """Write exp(mean ln radiance) over pairs, in the camera's frame and the photos' exposure units, as .exr."""
    total = torch.zeros(())
    for k in range(batches):
        total = total + source.batch(k * STRIDE).ln_radiance.mean(dim=0).cpu()
    mean = torch.exp(total / batches).permute(1, 2, 0).numpy()
    write_exr(path, np.ascontiguousarray(mean))


def main(
    to: Annotated[Path, Parameter(name="FILE.exr")] = Path("src/anyprobe/weights/mean_map.exr"),
    /,
    *,
    run: Annotated[str, Parameter(help=f"Run whose pairs count: {', '.join(RUNS)}.")] = "lift",
    data: Annotated[Path | None, Parameter(help="Data the run was trained on; else procedural maps.")] = None,
    runs: Annotated[Path, Parameter(help="Folder of the trained runs, for the cache.")] = Path("runs"),
) -> None:
    """Write the mean map of a run's pairs."""
    if run not in RUNS:
        raise InputError(f"expected one of {', '.join(RUNS)}, got {run!r}", subject="run")
    write_mean_map(make_pairs(RUNS[run](), data, runs / "cache", "cpu"), to)
    print(to)


if __name__ == "__main__":
    run_command(main)

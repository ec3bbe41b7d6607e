"""The geometric mean of the training maps: the first baseline of every evaluation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from anyprobe.dataset.pairs import PairSource
from anyprobe.files.radiance import write_exr


def write_mean_map(source: PairSource, path: Path, batches: int = 64) -> None:
    """exp(mean ln radiance) over pairs, in the camera's frame and the photos' exposure units, as .exr."""
    stride = 6  # neighbouring batches share lights
    total = torch.zeros(())
    for k in range(batches):
        total = total + source.batch(k * stride).ln_radiance.mean(dim=0).cpu()
    mean = torch.exp(total / batches).permute(1, 2, 0).numpy()
    write_exr(path, np.ascontiguousarray(mean))

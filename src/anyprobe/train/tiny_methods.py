"""Trained tiny designs as functions of a pair, with the truth at their size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.dataset.surfaces import thin
from anyprobe.evaluate.scaling import Shown
from anyprobe.nets.tiny_nets import ROWS, SIZE
from anyprobe.train.loop import load_nets
from anyprobe.train.scaling import SCALING
from anyprobe.train.tiny_designs import IMAGE, TINY


def trained_scaling(runs: Path) -> dict[str, Path]:
    """The checkpoints of those runs of scaling that a folder has, in the order they are told in."""
    paths = {run.__name__: runs / run.__name__ / "checkpoint.pt" for run in SCALING}
    return {name: path for name, path in paths.items() if path.is_file()}


class TinyMethods:
    """Every tiny design of a checkpoint on pairs."""

    def __init__(self, checkpoint: Path) -> None:
        self.nets = load_nets(checkpoint)

    @torch.no_grad()
    def __call__(self, pair: Pair) -> Shown:
        """All designs' maps, and those of the ones that see irradiance from the true image, as "<design>, told"."""
        photo = _thinned(pair.crop)
        mask = photo[:, 3:]
        truth = _thinned(pair.irradiance.astype(np.float32) / 255.0) * mask
        seen = self.nets[IMAGE](photo).clip(0, 1)
        maps = {}
        for name, design in TINY.items():
            if design.sees_irradiance:
                maps[f"{name}, told"] = self.nets[name](torch.cat([truth, mask], dim=1))
                maps[name] = self.nets[name](torch.cat([seen, mask], dim=1))
            else:
                maps[name] = self.nets[name](photo)
        return Shown(
            maps={name: _picture(one) for name, one in maps.items()},
            irradiance=_picture(seen),
            true_map=small_map(response(pair.radiance)),
            true_irradiance=_picture(truth),
        )


def small_map(ldr: np.ndarray) -> np.ndarray:
    """An LDR map [64, 128, 3] at the size of a tiny design's, [16, 32, 3]."""
    maps = torch.from_numpy(np.ascontiguousarray(ldr, np.float32)).permute(2, 0, 1)[None]
    return _picture(F.avg_pool2d(maps, maps.shape[2] // ROWS))


def _thinned(picture: np.ndarray) -> torch.Tensor:
    """[128, 128, C] -> [1, C, 32, 32]."""
    planes = thin(picture.transpose(2, 0, 1), len(picture) // SIZE)
    return torch.from_numpy(np.ascontiguousarray(planes, np.float32))[None]


def _picture(planes: torch.Tensor) -> np.ndarray:
    return planes[0].permute(1, 2, 0).numpy()

"""Paper Eq. 6: targets that sharpen from epoch to epoch, for every map at once."""

from __future__ import annotations

import torch

from anyprobe.light.filtering import blur_cosine_power
from research.paper_designs.scale import EPOCHS

BLOCK = 512


def epoch_of(progress: float) -> int:
    """1 to 11, of the share of a run's steps that are done, [0, 1)."""
    return 1 + int(progress * EPOCHS)


def sharpness(epoch: int) -> float:
    """beta e with beta = e^2: 1, 8, ... 1331."""
    return float(epoch**3)


def filtered(ldr: torch.Tensor, epoch: int) -> torch.Tensor:
    """Maps [L, 3, H, 2H] uint8 as the epoch shows them, float16 in [0, 1]."""
    blocks = []
    for part in ldr.split(BLOCK):
        blurred = blur_cosine_power(part.float().permute(0, 2, 3, 1) / 255.0, sharpness(epoch))
        blocks.append(blurred.permute(0, 3, 1, 2).half())
    return torch.cat(blocks)

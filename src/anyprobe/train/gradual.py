"""Paper Eq. 6 in training: targets that sharpen from epoch to epoch."""

from __future__ import annotations

import torch

from anyprobe.light.filtering import blur_cosine_power

NUM_EPOCHS = 11
GRADUAL_SHARE = 0.7
"""Share of the steps that the 11 filtered epochs take where a run says nothing else; the rest sees the map itself."""


def sharpness(progress: float, share: float = GRADUAL_SHARE) -> float | None:
    """beta e with beta = e^2: 1, 8, ... 1331 over the epochs; None when the map is left alone.

    progress: share of the run's steps done, [0, 1). share: of the steps that the epochs take. The paper
    ends with the 11th epoch, a share of 1; the steps after it, on unfiltered maps, are ours.
    """
    epoch = 1 + int(progress / share * NUM_EPOCHS)
    return None if epoch > NUM_EPOCHS else float(epoch**3)


def gradual_target(ldr: torch.Tensor, progress: float, share: float = GRADUAL_SHARE) -> torch.Tensor:
    """The LDR map [N, 3, H, 2H] as the epoch at this progress shows it; share: see sharpness."""
    exponent = sharpness(progress, share)
    if exponent is None:
        return ldr
    return blur_cosine_power(ldr.permute(0, 2, 3, 1), exponent).permute(0, 3, 1, 2)

"""Sect. 3.5's schedule and the targets that sharpen with it (Eq. 6)."""

import math

import torch

from anyprobe.light.filtering import blur_cosine_power
from anyprobe.paper.equations import EPOCHS, filter_exponent

RATE, DECAY, BETAS = 1e-3, 1e-4, (0.9, 0.999)
"""Adam's learning rate, weight decay (its L2 penalty) and momenta."""
RISE = 500
"""Steps over which the rate rises, at most a twentieth of a run. The paper's is fixed."""
FALL, LOWEST_RATE = 0.3, 0.01
"""Share of a run over which the rate falls along a cosine, and what is left of it."""


def rate_at(step: int, steps: int) -> float:
    """Return the learning rate of step 0 to steps - 1."""
    rise = min(1.0, (step + 1) / max(1, min(RISE, steps // 20)))
    fall = max(0.0, step / steps - (1.0 - FALL)) / FALL
    return RATE * rise * (LOWEST_RATE + (1.0 - LOWEST_RATE) * 0.5 * (1.0 + math.cos(math.pi * fall)))


def epoch_of(step: int, steps: int) -> int:
    """Return the paper's e, 1 to 11, of step 0 to steps - 1: elevenths of the run."""
    return 1 + step * EPOCHS // steps


def filtered_target(ldr: torch.Tensor, epoch: int) -> torch.Tensor:
    """Filter maps [N, 3, R, 2 R] as the epoch shows them (Eq. 6)."""
    return blur_cosine_power(ldr.float().permute(0, 2, 3, 1), filter_exponent(epoch)).permute(0, 3, 1, 2)

"""Photo -> light in two stages: a first that sees the object, a second that never sees more than its points.

Either is trained without the other, so that a second stage is swapped in behind a frozen first one.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from anyprobe.learning.nets.emitter_head import EmitterHead
from anyprobe.light.environment import MAP_HEIGHT
from research.second_stage.net import FINE, SIZE, SecondGuess, grown


def points(
    photo: torch.Tensor,
    normals: torch.Tensor,
    known: torch.Tensor,
    tan_half: torch.Tensor,
    root_alpha: torch.Tensor,
    material: torch.Tensor,
) -> tuple[torch.Tensor, ...]:
    """A photo and normals [N, 3, 64, 64] as the second stage takes them, all but the surroundings."""
    weight = F.avg_pool2d(photo[:, 3:], int(photo.shape[2]) // SIZE)
    seen = F.avg_pool2d(photo[:, :3], int(photo.shape[2]) // SIZE) / weight.clip(min=1e-3)
    normals = F.avg_pool2d(normals, int(normals.shape[2]) // SIZE)
    normals = normals * torch.rsqrt(normals.square().sum(dim=1, keepdim=True).clip(min=1e-8))
    root_alpha = torch.lerp(root_alpha, material[:, 7:], material[:, :1])
    return seen, weight, normals, known.amax(dim=(2, 3)), tan_half, root_alpha, material


def light_of(guess: SecondGuess, emitters: EmitterHead) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Radiance [N, 3, 64, 128] up to white, and what is above it at its most likely places, and in the mean."""
    times = MAP_HEIGHT // FINE
    logit = grown(guess.emitter_logit, times)
    shown = torch.exp(grown(guess.ln_shown, times).clip(max=0.0))
    return shown, emitters.mode(guess.ln_above, logit), emitters.expected(guess.ln_above, logit)

"""Emitters: radiance above white, as total power and a distribution over directions.

A light source covers few pixels, so a pixel-wise loss never asks for its full brightness, and an
unsure network trained on it paints none. Total power is one number, and cross entropy asks for
the probability of each direction, however unsure.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.nets.blocks import two_layers, wrap

POWER_FLOOR = 0.1
"""Power added to the power above white before its logarithm [sr of white]; less than this hardly counts."""
HEIGHT = 16
"""Rows of the map at which directions are weighed against each other."""
REACH_DEG, ROUND_DEG = 40.0, 10.0
"""Reach and rounding [degrees] of a candidate position's worth: exp(-sqrt(angle^2 + ROUND^2) / REACH) of the light at
an angle from it."""
_LIKELY, NEAR = 2.0, 48.0
"""Exponents of a direction's probability and of its worth as a candidate, in `mode`."""
_DISCS = 2
"""Number of discs that `mode` places. One puts all power in the wrong place where it errs; each more is an invented
highlight."""
DISC_DEG = 4.0
"""Radius of the discs [degrees], the smallest that always covers a pixel centre."""
LEAST = 1e-6
"""Likelihood added to every direction [share of the likeliest's], so that something is always left."""


def worth_matrix() -> torch.Tensor:
    """Compute the worth of each of the 2 HEIGHT^2 directions as a candidate for each other; symmetric."""
    d = pixel_directions(HEIGHT).reshape(-1, 3).astype(np.float64)
    angles = np.degrees(np.arccos(np.clip(d @ d.T, -1.0, 1.0)))
    return torch.from_numpy(np.exp(-np.hypot(angles, ROUND_DEG) / REACH_DEG).astype(np.float32))


def likelihood(logit: torch.Tensor) -> torch.Tensor:
    """Return each direction's likelihood in shares of the highest, [N, 1, 64, 128], never zero.

    Means over 3 x 3 pixels, across the seam: pixel shuffle leaves a grain of 2 x 2.
    """
    even = F.avg_pool2d(F.pad(wrap(logit, 1), (0, 0, 1, 1), mode="replicate"), 3, stride=1)
    return torch.exp(even - logit.amax(dim=(2, 3), keepdim=True)) + LEAST


class EmitterHead(nn.Module):
    """code [N, C] -> ln(power + POWER_FLOOR) [N, 3] in sr of white; then `expected` and `mode` place it."""

    solid_angles: torch.Tensor
    directions: torch.Tensor
    worth: torch.Tensor

    def __init__(self, code: int) -> None:
        super().__init__()
        self.power = two_layers(code, 3)
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).expand(-1, 2 * MAP_HEIGHT)
        self.register_buffer("solid_angles", angles[None, None].contiguous(), persistent=False)
        directions = torch.from_numpy(pixel_directions(MAP_HEIGHT)).permute(2, 0, 1)[None]
        self.register_buffer("directions", directions.float().contiguous(), persistent=False)
        self.register_buffer("worth", worth_matrix(), persistent=False)

    def forward(self, code: torch.Tensor) -> torch.Tensor:
        return self.power(code).float()

    def expected(self, ln_power: torch.Tensor, logit: torch.Tensor) -> torch.Tensor:
        """Return radiance [N, 3, 64, 128] with the power spread by probability: the mean over all positions.

        logit: [N, 1, 64, 128], ln of power per steradian up to a constant.
        """
        return self.above(ln_power)[:, :, None, None] * self.density(logit)

    def density(self, logit: torch.Tensor) -> torch.Tensor:
        """Return the density of the power over directions, [N, 1, 64, 128]; its integral is 1."""
        spread = torch.exp(logit - logit.amax(dim=(2, 3), keepdim=True))
        return spread / (spread * self.solid_angles).sum(dim=(2, 3), keepdim=True)

    def mode(self, ln_power: torch.Tensor, logit: torch.Tensor) -> torch.Tensor:
        """Return the same power in _DISCS discs at the most likely positions, each with the likelihood near it."""
        left = likelihood(logit) * self.solid_angles
        left = left / left.sum(dim=(2, 3), keepdim=True)
        discs = torch.zeros_like(left)  # power per steradian, of a total of 1 at the end
        for number in range(_DISCS):
            cosine = (self.directions * self.likeliest(left)).sum(dim=1, keepdim=True).clamp(-1.0, 1.0)
            disc = F.relu(cosine - math.cos(math.radians(DISC_DEG)))
            disc = disc / (disc * self.solid_angles).sum(dim=(2, 3), keepdim=True)
            near = torch.ones_like(cosine) if number == _DISCS - 1 else (1.0 + cosine) / 2.0
            discs = discs + disc * (left * near).sum(dim=(2, 3), keepdim=True)
            left = left * (1.0 - near)
        return self.above(ln_power)[:, :, None, None] * discs

    def likeliest(self, share: torch.Tensor) -> torch.Tensor:
        """Return unit directions [N, 3, 1, 1] near most of the likelihood; share: of each pixel [N, 1, 64, 128]."""
        step = MAP_HEIGHT // HEIGHT
        coarse = F.avg_pool2d(share, step)
        coarse = coarse / coarse.sum(dim=(2, 3), keepdim=True)
        worth = (coarse.flatten(2) @ self.worth).unflatten(2, (HEIGHT, 2 * HEIGHT))
        worth = F.interpolate(wrap(worth, 2), scale_factor=step, mode="bilinear", align_corners=False)
        worth = worth[..., 2 * step : -2 * step]
        score = _LIKELY * torch.log(share / self.solid_angles) + NEAR * torch.log(worth)
        weight = torch.exp(score - score.amax(dim=(2, 3), keepdim=True)) * self.solid_angles
        return F.normalize((weight * self.directions).sum(dim=(2, 3), keepdim=True), dim=1)

    @staticmethod
    def above(ln_power: torch.Tensor) -> torch.Tensor:
        """Return the power above white [N, 3]."""
        return (torch.exp(ln_power) - POWER_FLOOR).clamp(min=0.0)

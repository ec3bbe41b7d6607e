"""Radiance above white: how much flux, from where, and the lamps a map is given for it.

A lamp covers few pixels, so errors of pixels never tell a network to make it bright, and an
unsure network that follows them paints no lamp at all. Flux is one number, and cross
entropy asks for the probability of each direction, however unsure.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT

FLUX_FLOOR = 0.1
"""Added to the flux above white [sr of white] before its logarithm: a lamp of less hardly counts."""
HEIGHT = 16
"""Rows at which directions are weighed against one another."""
REACH_DEG, ROUND_DEG = 40.0, 10.0
"""A guess is worth exp(-sqrt(angle^2 + ROUND^2) / REACH) of the light that is so far from it."""
LIKELY, NEAR = 2.0, 48.0
"""Powers of how likely a direction is, and of what it is worth as a guess, that lamps are drawn with."""


def worth_matrix() -> torch.Tensor:
    """What each of the 2 HEIGHT^2 directions is worth as a guess of each, [guess, truth]."""
    d = pixel_directions(HEIGHT).reshape(-1, 3).astype(np.float64)
    angles = np.degrees(np.arccos(np.clip(d @ d.T, -1.0, 1.0)))
    return torch.from_numpy(np.exp(-np.hypot(angles, ROUND_DEG) / REACH_DEG).astype(np.float32))


class Lamps(nn.Module):
    """code [N, C] -> ln(flux + FLUX_FLOOR) [N, 3] in sr of white; then `expected` and `drawn` place it."""

    def __init__(self, code: int) -> None:
        super().__init__()
        self.flux = nn.Sequential(nn.Linear(code, 64), nn.LeakyReLU(0.1), nn.Linear(64, 3))
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).expand(-1, 2 * MAP_HEIGHT)
        self.register_buffer("solid_angles", angles[None, None].contiguous(), persistent=False)
        self.register_buffer("worth", worth_matrix(), persistent=False)

    def forward(self, code: torch.Tensor) -> torch.Tensor:
        return self.flux(code).float()

    def expected(self, ln_flux: torch.Tensor, logit: torch.Tensor) -> torch.Tensor:
        """Radiance [N, 3, 64, 128] with the flux spread as likely as it is: the mean over all that may be.

        logit: [N, 1, 64, 128], ln of flux a steradian but for a constant.
        """
        return self._radiance(ln_flux, logit)

    def drawn(self, ln_flux: torch.Tensor, logit: torch.Tensor) -> torch.Tensor:
        """The same flux in lamps as small as they are sure, where a guess is nearest to all that may be."""
        power = torch.exp(logit - logit.amax(dim=(2, 3), keepdim=True)) * self.solid_angles
        step = MAP_HEIGHT // HEIGHT
        share = F.avg_pool2d(power, step)
        share = share / share.sum(dim=(2, 3), keepdim=True)
        worth = F.linear(share.flatten(2), self.worth).unflatten(2, (HEIGHT, 2 * HEIGHT))
        worth = torch.cat([worth[..., -2:], worth, worth[..., :2]], dim=3)
        worth = F.interpolate(worth, scale_factor=step, mode="bilinear", align_corners=False)
        worth = worth[..., 2 * step : -2 * step]
        return self._radiance(ln_flux, LIKELY * _even(logit) + NEAR * torch.log(worth))

    def _radiance(self, ln_flux: torch.Tensor, logit: torch.Tensor) -> torch.Tensor:
        spread = torch.exp(logit - logit.amax(dim=(2, 3), keepdim=True))
        per_steradian = spread / (spread * self.solid_angles).sum(dim=(2, 3), keepdim=True)
        flux = (torch.exp(ln_flux) - FLUX_FLOOR).clamp(min=0.0)
        return flux[:, :, None, None] * per_steradian


def _even(logit: torch.Tensor) -> torch.Tensor:
    """Means over 3 x 3 pixels, across the seam: a network that makes pixels in fours leaves a grain between them."""
    wide = torch.cat([logit[..., -1:], logit, logit[..., :1]], dim=3)
    return F.avg_pool2d(F.pad(wide, (0, 0, 1, 1), mode="replicate"), 3, stride=1)

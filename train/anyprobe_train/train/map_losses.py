"""Losses of maps: of their display values, and of the light that they send."""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.dataset.pair import LN_RANGE

LOBES = (1.0, 16.0, 128.0)
"""Exponents of the cosine: lobes of a diffuse, a glossy and a nearly mirror-like sphere."""
FAINT_RADIANCE = 0.02
"""Radiance added before logarithms are compared: darker differences do not matter."""


def lobe_matrices(height: int, rows: int) -> torch.Tensor:
    """Compute matrices [lobes, out, in]: means of a map [height, 2 height] around the pixels of one of `rows` rows."""
    out, seen = (pixel_directions(h).reshape(-1, 3).astype(np.float64) for h in (rows, height))
    cosine = np.maximum(out @ seen.T, 0.0)
    angles = np.repeat(pixel_solid_angles(height)[:, 0], 2 * height)
    kernels = np.stack([cosine**power * angles for power in LOBES])
    return torch.from_numpy((kernels / kernels.sum(axis=2, keepdims=True)).astype(np.float32))


def structure_loss(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Compute 1 - SSIM over 7 x 7 boxes (Wang et al. 2004, Eq. 13) of pictures [N, C, H, W] in [0, 1]."""

    def mean(x: torch.Tensor) -> torch.Tensor:
        return F.avg_pool2d(x, 7, stride=2)

    mean_a, mean_b = mean(a), mean(b)
    spread = mean(a * a) + mean(b * b) - mean_a**2 - mean_b**2
    together = mean(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    likeness = (2 * mean_a * mean_b + c1) * (2 * together + c2)
    return 1 - (likeness / ((mean_a**2 + mean_b**2 + c1) * (spread + c2))).mean()


def shown_losses(shown: torch.Tensor, true: torch.Tensor, weight: torch.Tensor) -> dict[str, torch.Tensor]:
    """Compare display values [N, 3, H, 2H] with the truth: by weighted pixels, by means over 2 to 16 pixels, and in
    structure."""
    difference = shown - true
    scales = scales_loss(difference)  # first: the order of losses is that in which gradients are summed
    return {
        "ldr": pixel_loss(difference, weight),
        "scales": scales,
        "structure": structure_loss(shown.clip(max=1.0), true),
    }


def pixel_loss(difference: torch.Tensor, weight: torch.Tensor) -> torch.Tensor:
    """Compute the mean of weight (|d| / 2 + 2 d^2) over differences d [N, 3, H, 2H] of display values.

    weight: of pixels, [1, 1, H, 2H].
    """
    return (weight * (difference.abs() * 0.5 + difference.square() * 2)).mean()


def scales_loss(difference: torch.Tensor) -> torch.Tensor:
    """Compute the sum of mean d^2 + .3 mean |d| over differences d [N, 3, H, 2H] of display values, averaged over 2, 4,
    8 and 16 pixels."""
    loss = difference.new_zeros(())
    for _ in range(4):
        difference = F.avg_pool2d(difference, 2)
        loss = loss + difference.square().mean() + 0.3 * difference.abs().mean()
    return loss


def clipped_where_white(shown: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
    """Clip display values [N, 3, H, 2H] where the true ones clip: how far above white does not matter there."""
    return torch.where((shown > 1) & (true >= 1), shown.clip(max=1.0), shown)


class Sent:
    """Differences of two maps in the light that they send; maps are ln radiance [N, 3, 64, 128]."""

    def __init__(self, device: str) -> None:
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self.angles = angles.expand(-1, 2 * MAP_HEIGHT)[None, None]
        """Steradians [1, 1, 64, 128]."""
        self.weight = 0.5 + 0.5 * self.angles / self.angles.mean()
        """Weights of pixels [1, 1, 64, 128], halfway between equal ones and true solid angles."""
        self._lobes = lobe_matrices(MAP_HEIGHT // 2, 8).to(device)
        self.luminance = torch.tensor(REC709, device=device)

    def transport(self, ln: torch.Tensor, true_ln: torch.Tensor) -> torch.Tensor:
        """Compute the mean difference of ln of what spheres of three kinds (LOBES) see: energy counts, not pixels."""
        seen = []
        for ln_map in (ln, true_ln):
            power = F.avg_pool2d(torch.exp(ln_map.clip(*LN_RANGE)) * self.angles, 2)
            radiance = power / F.avg_pool2d(self.angles, 2)
            means = torch.einsum("lop,ncp->nclo", self._lobes, radiance.flatten(2))
            seen.append(torch.log(means + FAINT_RADIANCE))
        return (seen[0] - seen[1]).abs().mean()

    def power(self, ln: torch.Tensor) -> torch.Tensor:
        """Integrate radiance over the sphere, [N, 3]."""
        return (torch.exp(ln.clip(*LN_RANGE)) * self.angles).sum(dim=(2, 3))

    def level(self, ln: torch.Tensor, true_ln: torch.Tensor) -> torch.Tensor:
        """Compute the difference of ln of the luminance of the power, [N]."""
        level, true = (torch.log(self.power(ln_map) @ self.luminance) for ln_map in (ln, true_ln))
        return (level - true).abs()

    def above_white(self, true_ln: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the power above radiance 1, [N, 3], and each pixel's share of it, [N, 64 * 128]."""
        above = (torch.exp(true_ln) - 1).clip(min=0.0) * self.angles
        power = above.sum(dim=(2, 3))
        return power, above.sum(dim=1).flatten(1) / power.sum(dim=1, keepdim=True).clip(min=1e-6)

    def emitters(
        self, ln_share: torch.Tensor, true_ln: torch.Tensor, dim_power: float = 1.0, counts: torch.Tensor | float = 1.0
    ) -> torch.Tensor:
        """Compute the cross entropy of estimated ln shares of light by direction [N, 64 * 128] with the true light
        above white.

        dim_power: above white, in sr of white; maps with as much count half. counts: further weights [N].
        """
        power, share = self.above_white(true_ln)
        mean = power.mean(dim=1)
        return -(mean / (mean + dim_power) * counts * (share * ln_share).sum(dim=1)).mean()

    def ln_share_of(self, logit: torch.Tensor) -> torch.Tensor:
        """Return ln of every pixel's share, [N, 64 * 128], from ln of a density [N, 1, 64, 128] up to a constant."""
        return torch.log_softmax((logit + torch.log(self.angles)).flatten(1), dim=1)

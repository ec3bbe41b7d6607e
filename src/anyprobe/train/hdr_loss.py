"""What every HDR network learns: ln radiance, mostly where the reconstruction (Eq. 7) will read it."""

from __future__ import annotations

import torch

from anyprobe.light.reconstruct import blend_weight


def hdr_loss(
    estimate: torch.Tensor, target: torch.Tensor, shown: torch.Tensor, solid_angle: torch.Tensor
) -> torch.Tensor:
    """Mean squared error of ln radiance, weighted by solid angle and 0.1 + gamma (Eq. 8).

    Args:
        estimate, target: [B, 3, H, 2H].
        shown: display values [B, 3, H, 2H], of which gamma is.
        solid_angle: [1, 1, H, 1].
    """
    gamma = blend_weight(shown.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
    weight = solid_angle * (0.1 + gamma)
    return (weight * (estimate - target) ** 2).sum() / weight.sum() / 3

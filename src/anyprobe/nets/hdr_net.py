"""Paper Fig. 9: LDR map -> natural logarithm of the radiance, for where the LDR map saturates."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import UNet, Unwrap, Wrap


class HdrNet(nn.Module):
    """LDR map [N, 3, 64, 128] in [0, 1] -> ln radiance [N, 3, 64, 128]."""

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128)) -> None:
        super().__init__()
        self.body = nn.Sequential(Wrap(16), UNet(3, widths), Unwrap(16))
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.head(self.body(ldr))

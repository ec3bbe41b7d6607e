"""Paper Fig. 5: photo -> importance-weighted irradiance, a U-Net that adds to its input."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import UNet

SIZE = 128
"""Side of photo and irradiance image, as in the paper."""


class IrradianceNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask) -> display irradiance [N, 3, 128, 128].

    Zero outside the mask; values are in [0, 1] up to the network's error.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128, 192)) -> None:
        super().__init__()
        self.body = UNet(4, widths)
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        residual = self.head(self.body(photo))
        return (photo[:, :3] + residual) * photo[:, 3:]

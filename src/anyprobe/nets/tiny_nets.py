"""Tiny networks, for pictures of so few pixels that they can see very many pairs: the paper's second one."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import Unwrap, Up, Wrap, conv

SIZE = 32
"""Side of photo and irradiance image."""
ROWS = 16
"""Rows of the maps."""
IRRADIANCE_WIDTHS = (16, 32, 64, 96)
"""Of the first, which is nets.irradiance_net's: it takes pictures of any size."""


class TinyMapNet(nn.Module):
    """Paper Fig. 8: image [N, 4, 32, 32] (picture and mask) -> LDR map [N, 3, 16, 32] in [0, 1]."""

    def __init__(
        self, down: tuple[int, ...] = (16, 32, 64), code: int = 192, up: tuple[int, ...] = (64, 32, 16)
    ) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, width in zip((4, *down), down, strict=False):
            layers += [conv(inputs, width, stride=2), conv(width, width)]
        self.code = nn.Sequential(
            *layers,
            nn.Flatten(),
            nn.Linear(down[-1] * (SIZE >> len(down)) ** 2, code),
            nn.LeakyReLU(0.1),
            nn.Linear(code, up[0] * (ROWS // 4) * (ROWS // 2)),
            nn.LeakyReLU(0.1),
            nn.Unflatten(1, (up[0], ROWS // 4, ROWS // 2)),
        )
        self.decoder = nn.Sequential(Wrap(1), Up(up[0], up[1]), Up(up[1], up[2]), Unwrap(4))
        self.head = nn.Conv2d(up[2], 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.head(self.decoder(self.code(image))))

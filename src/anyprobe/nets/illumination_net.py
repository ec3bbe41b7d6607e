"""Paper Fig. 8: object image -> LDR map, an encoder to one vector and a decoder on the sphere."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import Unwrap, Up, Wrap, conv


class IlluminationNet(nn.Module):
    """image [N, 4, 128, 128] (irradiance or photo, and mask) -> LDR map [N, 3, 64, 128] in [0, 1].

    Pixels of the object and pixels of the map do not correspond, so everything
    passes through one vector (`code` numbers), as in the paper.
    """

    def __init__(self, widths: tuple[int, ...] = (32, 64, 96, 160, 256), code: int = 512) -> None:
        super().__init__()
        layers, inputs = [], 4
        for width in widths:
            layers += [conv(inputs, width, stride=2), conv(width, width)]
            inputs = width
        self.encoder = nn.Sequential(*layers)  # [N, widths[-1], 4, 4]
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.start = nn.Sequential(nn.Linear(code, 192 * 4 * 8), nn.LeakyReLU(0.1))
        self.decoder = nn.Sequential(
            Wrap(2),
            Up(192, 192),  # 8 x 24, 4 columns of them beyond each side
            conv(192, 128),
            Unwrap(2),
            Up(128, 96),
            conv(96, 96),
            Up(96, 48),
            conv(48, 48),
            Up(48, 24),
            Unwrap(16),
        )
        self.head = nn.Conv2d(24, 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        start = self.start(self.code(self.encoder(image))).reshape(-1, 192, 4, 8)
        return torch.sigmoid(self.head(self.decoder(start)))

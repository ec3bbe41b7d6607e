"""Tiny networks: the paper's first two on pictures of so few pixels that they can see very many pairs."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import UNet, Unwrap, Up, Wrap, conv

SIZE = 32
"""Side of photo and irradiance image."""
ROWS = 16
"""Rows of the maps."""


class TinyIrradianceNet(nn.Module):
    """Paper Fig. 5: photo [N, 4, 32, 32] (display RGB times mask, mask) -> display irradiance [N, 3, 32, 32]."""

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 96)) -> None:
        super().__init__()
        self.body = UNet(4, widths)
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        return (photo[:, :3] + self.head(self.body(photo))) * photo[:, 3:]


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

"""The paper's three networks: irradiance (Fig. 5), illumination (Fig. 8) and HDR (Fig. 9)."""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import UNet, Unwrap, Up, Wrap, conv


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


class HdrNet(nn.Module):
    """LDR map [N, 3, 64, 128] in [0, 1] -> ln radiance [N, 3, 64, 128]."""

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128)) -> None:
        super().__init__()
        self.body = nn.Sequential(Wrap(16), UNet(3, widths), Unwrap(16))
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.head(self.body(ldr))


NETS = {"irradiance": IrradianceNet, "illumination": IlluminationNet, "hdr": HdrNet}
"""By stage, in the order in which each reads the one before."""

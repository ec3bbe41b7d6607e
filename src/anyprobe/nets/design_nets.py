"""Small networks for comparing designs: a picture to a map, a mirror ball or another picture.

All see 64 x 64 pixels and have about half the paper chain's widths, so that every design
can learn from the same pairs in one run.
"""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.nets.blocks import UNet, Unwrap, Up, Wrap, conv

SIZE = 64
"""Side of the pictures that go in, and of the balls that come out."""
ROWS = 32
"""Rows of the maps that come out."""


class PictureCode(nn.Sequential):
    """picture [N, inputs, 64, 64] -> code [N, numbers]."""

    def __init__(self, inputs: int, widths: tuple[int, ...] = (16, 32, 64, 96), numbers: int = 256) -> None:
        layers: list[nn.Module] = []
        for width in widths:
            layers += [conv(inputs, width, stride=2), conv(width, width)]
            inputs = width
        last = nn.Linear(widths[-1] * (SIZE >> len(widths)) ** 2, numbers)
        super().__init__(*layers, nn.Flatten(), last, nn.LeakyReLU(0.1))


class MapNet(nn.Module):
    """Paper Fig. 8, half as wide: image [N, 4, 64, 64] (picture and mask) -> LDR map [N, 3, 32, 64] in [0, 1]."""

    def __init__(self, code: int = 256) -> None:
        super().__init__()
        self.code = PictureCode(4, numbers=code)
        self.start = nn.Sequential(nn.Linear(code, 96 * 4 * 8), nn.LeakyReLU(0.1))
        self.decoder = nn.Sequential(
            Wrap(1), Up(96, 64), Unwrap(1), Up(64, 32), Up(32, 16), Unwrap(4), conv(16, 16)
        )
        self.head = nn.Conv2d(16, 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        start = self.start(self.code(image)).unflatten(1, (96, 4, 8))
        return torch.sigmoid(self.head(self.decoder(start)))


class BallNet(nn.Module):
    """Georgoulis et al. 2017 without normals: image [N, 4, 64, 64] -> mirror ball [N, 3, 64, 64] in [0, 1].

    The ball is drawn as `render.reflectance` draws normals: equal angles along the radius.
    """

    def __init__(self, code: int = 256) -> None:
        super().__init__()
        self.code = PictureCode(4, numbers=code)
        self.start = nn.Sequential(nn.Linear(code, 96 * 4 * 4), nn.LeakyReLU(0.1))
        self.decoder = nn.Sequential(Up(96, 64), Up(64, 48), Up(48, 24), Up(24, 12))
        self.head = nn.Conv2d(12, 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        start = self.start(self.code(image)).unflatten(1, (96, 4, 4))
        return torch.sigmoid(self.head(self.decoder(start)))


class MirrorNet(nn.Module):
    """Meka et al. 2018: photo, mask and normals [N, 7, 64, 64] -> grey mirror image [N, 1, 64, 64] in [0, 1]."""

    def __init__(self, widths: tuple[int, ...] = (12, 24, 48, 96)) -> None:
        super().__init__()
        self.body = UNet(7, widths)
        self.head = nn.Conv2d(widths[0], 1, 1)

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.head(self.body(picture)))


class SmallHdrNet(nn.Module):
    """Paper Fig. 9, narrower: LDR map [N, 3, 32, 64] in [0, 1] -> ln radiance [N, 3, 32, 64]."""

    def __init__(self, widths: tuple[int, ...] = (12, 24, 48, 96)) -> None:
        super().__init__()
        self.body = nn.Sequential(Wrap(8), UNet(3, widths), Unwrap(8))
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.head(self.body(ldr))

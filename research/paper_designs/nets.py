"""The networks (paper Figs. 5, 8 and 9) at any scale, on pixels in the order of `blocks`: [N, pixels, channels].

Their strided and transposed convolutions do not overlap, so that they are products of matrices. No normalisation, so
that a pair's result is its own.
"""

from __future__ import annotations

import torch
from torch import nn

from research.paper_designs.blocks import PATCH, joins_of

WIDEST = 256
LEAST_BLOCKS = 32
"""A decoder begins at so many blocks, or up to four times as many."""


def layer(inputs: int, outputs: int, bias: bool = False) -> nn.Sequential:
    """Linear over channels, ReLU."""
    linear = nn.Linear(inputs, outputs, bias)
    nn.init.kaiming_uniform_(linear.weight, nonlinearity="relu")
    return nn.Sequential(linear, nn.ReLU(inplace=True))


class Encoder(nn.Module):
    """Pixels [N, side^2, inputs] -> features of every scale, finest first: [N, blocks, channels]."""

    def __init__(self, inputs: int, rows: int, width: int, growth: float) -> None:
        super().__init__()
        self.widths = [min(round(width * growth**k), WIDEST) for k in range(joins_of(rows) + 1)]
        self.patch = layer(PATCH**2 * inputs, self.widths[0])
        self.joins = nn.ModuleList(layer(4 * a, b) for a, b in zip(self.widths[:-1], self.widths[1:], strict=True))

    def forward(self, pixels: torch.Tensor) -> list[torch.Tensor]:
        features = [self.patch(pixels.reshape(len(pixels), pixels.shape[1] // PATCH**2, -1))]
        for join in self.joins:
            features.append(join(features[-1].reshape(len(pixels), features[-1].shape[1] // 4, -1)))
        return features


class PictureNet(nn.Module):
    """Paper Fig. 8: a square picture -> RGB of so many pixels of another, through a code."""

    def __init__(self, inputs: int, side: int, pixels: int, width: int, code: int) -> None:
        super().__init__()
        self.encoder = Encoder(inputs, side, width, growth=2)
        self.blocks, doublings = pixels // PATCH**2, 0
        while self.blocks % 4 == 0 and self.blocks // 4 >= LEAST_BLOCKS:
            self.blocks, doublings = self.blocks // 4, doublings + 1
        widths = [min(width * 2**k, WIDEST) * 2 // 3 for k in range(doublings, -1, -1)]
        numbers = (side // PATCH >> joins_of(side)) ** 2 * self.encoder.widths[-1]
        self.code = nn.Sequential(layer(numbers, code, True), layer(code, self.blocks * widths[0], True))
        self.decoder = nn.ModuleList(layer(a, 4 * b) for a, b in zip(widths[:-1], widths[1:], strict=True))
        self.head = nn.Sequential(layer(widths[-1], width), nn.Linear(width, 3 * PATCH**2))

    def forward(self, pixels: torch.Tensor) -> torch.Tensor:
        x = self.code(self.encoder(pixels)[-1].flatten(1)).reshape(len(pixels), self.blocks, -1)
        for up in self.decoder:
            x = up(x).reshape(len(x), 4 * x.shape[1], -1)
        return self.head(x).reshape(len(x), -1, 3)


class UNet(nn.Module):
    """Paper Fig. 5: pixels of a picture [rows, columns] -> `outputs` channels of each.

    The coarsest scale goes through a code; skips are added. It has twice a PictureNet's width, for pixels of their own.
    """

    def __init__(self, inputs: int, outputs: int, rows: int, columns: int, width: int, code: int) -> None:
        super().__init__()
        self.encoder = Encoder(inputs, rows, 2 * width, growth=4 / 3)
        widths = self.encoder.widths
        numbers = (rows // PATCH >> joins_of(rows)) * (columns // PATCH >> joins_of(rows)) * widths[-1]
        self.code = nn.Sequential(layer(numbers, code, True), layer(code, numbers, True))
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.up = nn.ModuleList(nn.Linear(b, 4 * a, bias=False) for a, b in pairs)
        self.join = nn.ModuleList(layer(a, a) for a, _ in pairs)
        self.head = nn.Linear(widths[0], PATCH**2 * outputs)

    def forward(self, pixels: torch.Tensor) -> torch.Tensor:
        features = self.encoder(pixels)
        x = features.pop()
        x = x + self.code(x.flatten(1)).reshape(x.shape)
        for up, join in zip(reversed(self.up), reversed(self.join), strict=True):
            skip = features.pop()
            x = join(up(x).reshape(skip.shape) + skip)
        return self.head(x).reshape(*pixels.shape[:2], -1)


class IrradianceNet(nn.Module):
    """Paper Fig. 5: photo and mask [N, side^2, 4] -> irradiance image [N, side^2, 3], zero off the object."""

    def __init__(self, side: int, width: int, code: int) -> None:
        super().__init__()
        self.body = UNet(4, 3, side, side, width, code)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        return (photo[..., :3] + self.body(photo)) * photo[..., 3:]


class MirrorNet(nn.Module):
    """Meka et al. 2018: photo, mask and normals [N, side^2, 7] -> grey mirror image [N, side^2, 1]."""

    def __init__(self, side: int, width: int, code: int) -> None:
        super().__init__()
        self.body = UNet(7, 1, side, side, width, code)

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return self.body(picture) * picture[..., 3:4]


class HdrNet(nn.Module):
    """Paper Fig. 9: LDR map [N, rows * 2 rows, 3] in [0, 1] -> ln radiance."""

    def __init__(self, rows: int, width: int, code: int) -> None:
        super().__init__()
        self.body = UNet(3, 3, rows, 2 * rows, width, code)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.body(ldr)

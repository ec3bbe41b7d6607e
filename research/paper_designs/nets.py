"""The networks (paper Figs. 5, 8 and 9) at any scale. NCHW; no normalisation, so that a pair's result is its own."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

SLOPE = 0.1
WIDEST = 256
DECODER = (2, 2, 3, 4, 6)
"""Channels of the decoder's layers from its end, in widths."""


def conv(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    """3 x 3 convolution, leaky ReLU."""
    return nn.Sequential(nn.Conv2d(inputs, outputs, 3, stride, 1), nn.LeakyReLU(SLOPE, inplace=True))


def up(inputs: int, outputs: int) -> nn.Sequential:
    """Transposed convolution to twice the size, leaky ReLU."""
    return nn.Sequential(nn.ConvTranspose2d(inputs, outputs, 4, 2, 1), nn.LeakyReLU(SLOPE, inplace=True))


def encoder(inputs: int, side: int, width: int) -> tuple[nn.Sequential, int]:
    """Strided convolutions until 3 or 4 pixels are left, flat; and how many numbers that is."""
    layers: list[nn.Module] = []
    while side > 4:
        layers.append(conv(inputs, width, stride=2))
        inputs, width, side = width, min(2 * width, WIDEST), side // 2
    return nn.Sequential(*layers, nn.Flatten()), inputs * side * side


class PictureNet(nn.Module):
    """Paper Fig. 8: picture [N, inputs, side, side] -> [N, 3, *size] in [0, 1], through a code.

    start: rows and columns at which the decoder begins; size is that times a power of two, at least 4. The last
    doubling is a sub-pixel convolution.
    """

    def __init__(
        self, inputs: int, side: int, size: tuple[int, int], start: tuple[int, int], width: int, code: int
    ) -> None:
        super().__init__()
        self.encoder, numbers = encoder(inputs, side, width)
        doublings = (size[0] // start[0]).bit_length() - 1
        widths = [round(width * share) for share in reversed(DECODER[:doublings])]
        self.code = nn.Sequential(
            nn.Linear(numbers, code),
            nn.LeakyReLU(SLOPE),
            nn.Linear(code, widths[0] * start[0] * start[1]),
            nn.LeakyReLU(SLOPE),
            nn.Unflatten(1, (widths[0], *start)),
        )
        self.decoder = nn.Sequential(*(up(a, b) for a, b in zip(widths[:-1], widths[1:], strict=True)))
        self.head = nn.Sequential(nn.Conv2d(widths[-1], 12, 1), nn.PixelShuffle(2))

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.head(self.decoder(self.code(self.encoder(picture)))))


class UNet(nn.Module):
    """Paper Fig. 5: picture [N, inputs, H, W] -> [N, outputs, H, W]; H and W divisible by 2^(depth + 1).

    The finest scale has half the pixels' resolution and four times their channels; skips are added.
    """

    def __init__(self, inputs: int, outputs: int, width: int, depth: int) -> None:
        super().__init__()
        widths = [min(round(1.5 * width * 2**k), WIDEST) for k in range(depth + 1)]
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(nn.PixelUnshuffle(2), conv(4 * inputs, widths[0]))
        self.down = nn.ModuleList(conv(a, b, stride=2) for a, b in pairs)
        self.narrow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in pairs)
        self.join = nn.ModuleList(conv(a, a) for a, _ in pairs)
        self.head = nn.Sequential(nn.Conv2d(widths[0], 4 * outputs, 1), nn.PixelShuffle(2))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        features = [self.first(x)]
        for down in self.down:
            features.append(down(features[-1]))
        x = features.pop()
        for narrow, join in zip(reversed(self.narrow), reversed(self.join), strict=True):
            x = join(F.interpolate(narrow(x), scale_factor=2, mode="nearest") + features.pop())
        return self.head(x)


class IrradianceNet(nn.Module):
    """Paper Fig. 5: photo [N, 4, side, side] -> irradiance image [N, 3, side, side], zero off the object."""

    def __init__(self, side: int, width: int) -> None:
        super().__init__()
        self.body = UNet(4, 3, width, depth_of(side))

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        return (photo[:, :3] + self.body(photo)) * photo[:, 3:]


class MirrorNet(nn.Module):
    """Meka et al. 2018: photo, mask and normals [N, 7, side, side] -> grey mirror image [N, 1, side, side]."""

    def __init__(self, side: int, width: int) -> None:
        super().__init__()
        self.body = UNet(7, 1, width, depth_of(side))

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.body(picture))


class HdrNet(nn.Module):
    """Paper Fig. 9: LDR map [N, 3, H, 2H] in [0, 1] -> ln radiance. Some columns go on across the seam."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.body = UNet(3, 3, width, 2)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        more = ldr.shape[2] // 4
        wide = torch.cat([ldr[..., -more:], ldr, ldr[..., :more]], dim=3)
        return self.body(wide)[..., more:-more]


def depth_of(side: int) -> int:
    """Doublings of the half photo's scale until 3 or 4 pixels are left."""
    return (side // 6).bit_length() - 1

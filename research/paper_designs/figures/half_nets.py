"""Networks of the half-size designs, as commit e8f1e10 trained them: the paper's Figs. 8, 9, two rivals (Sect. 4.2).

They see 64 x 64 pixels and have about half the paper's widths. NCHW; N batch, C channels, H x W pixels.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

SIZE = 64
"""Side of the pictures that go in, and of the spheres that come out."""
WIDTHS = (16, 32, 64, 96)
NARROW = (12, 24, 48, 96)


def conv(inputs: int, outputs: int, *, stride: int = 1) -> nn.Sequential:
    """3 x 3 convolution, batch normalisation, leaky ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1)
    )


class Wrap(nn.Module):
    """Repeat columns of a map [N, C, H, W] beyond its seam, on both sides; a negative number takes them off again."""

    def __init__(self, columns: int) -> None:
        super().__init__()
        self.columns = columns

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if self.columns < 0:
            return x[..., -self.columns : self.columns]
        return torch.cat([x[..., -self.columns :], x, x[..., : self.columns]], dim=3)


class Up(nn.Module):
    """Twice the size by repetition, then a convolution."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.conv = conv(inputs, outputs)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.conv(F.interpolate(x, scale_factor=2.0, mode="nearest"))


class UNet(nn.Module):
    """Ronneberger et al. 2015: [N, inputs, H, W] -> [N, widths[0], H, W]."""

    def __init__(self, inputs: int, widths: tuple[int, ...] = NARROW) -> None:
        super().__init__()
        self.first = nn.Sequential(conv(inputs, widths[0]), conv(widths[0], widths[0]))
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(Up(b, a) for a, b in reversed(pairs))
        self.join = nn.ModuleList(conv(2 * a, a) for a, _ in reversed(pairs))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        features = [self.first(x)]
        for down in self.down:
            features.append(down(features[-1]))
        x = features.pop()
        for up, join in zip(self.up, self.join, strict=True):
            x = join(torch.cat([up(x), features.pop()], dim=1))
        return x


class FromCode(nn.Module):
    """A picture with its mask [N, 4, 64, 64] -> a picture in [0, 1], through 256 numbers."""

    def __init__(self, start: tuple[int, int, int], decoder: nn.Sequential, last: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, width in zip((4, *WIDTHS[:-1]), WIDTHS, strict=True):
            layers += [conv(inputs, width, stride=2), conv(width, width)]
        numbers = nn.Linear(WIDTHS[-1] * (SIZE >> len(WIDTHS)) ** 2, 256)
        self.code = nn.Sequential(*layers, nn.Flatten(), numbers, nn.LeakyReLU(0.1))
        self.shape = start
        self.start = nn.Sequential(nn.Linear(256, start[0] * start[1] * start[2]), nn.LeakyReLU(0.1))
        self.decoder = decoder
        self.head = nn.Conv2d(last, 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.head(self.decoder(self.start(self.code(image)).unflatten(1, self.shape))))


def map_net() -> FromCode:
    """Paper Fig. 8: -> LDR map [N, 3, 32, 64]."""
    decoder = nn.Sequential(Wrap(1), Up(96, 64), Wrap(-1), Up(64, 32), Up(32, 16), Wrap(-4), conv(16, 16))
    return FromCode((96, 4, 8), decoder, 16)


def sphere_net() -> FromCode:
    """Georgoulis et al. 2017 without normals: -> mirror sphere [N, 3, 64, 64], equal angles along its radius."""
    return FromCode((96, 4, 4), nn.Sequential(Up(96, 64), Up(64, 48), Up(48, 24), Up(24, 12)), 12)


class MirrorNet(nn.Module):
    """Meka et al. 2018: photo, mask and normals [N, 7, 64, 64] -> grey mirror image [N, 1, 64, 64] in [0, 1]."""

    def __init__(self) -> None:
        super().__init__()
        self.body = UNet(7)
        self.head = nn.Conv2d(NARROW[0], 1, 1)

    def forward(self, picture: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.head(self.body(picture)))


class HdrNet(nn.Module):
    """Paper Fig. 9: LDR map [N, 3, 32, 64] in [0, 1] -> ln radiance [N, 3, 32, 64]."""

    def __init__(self) -> None:
        super().__init__()
        self.body = nn.Sequential(Wrap(8), UNet(3), Wrap(-8))
        self.head = nn.Conv2d(NARROW[0], 3, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.head(self.body(ldr))


def half_size_nets() -> nn.ModuleDict:
    """The networks that the figures need, untrained."""
    return nn.ModuleDict({"ours": map_net(), "georgoulis": sphere_net(), "meka": MirrorNet(), "hdr": HdrNet()})

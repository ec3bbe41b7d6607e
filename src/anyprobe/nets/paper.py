"""The paper's three networks: irradiance (Fig. 5), illumination (Fig. 8) and HDR (Fig. 9).

Stages and their inputs are the paper's, and so is the code between object and map; layers are ours. Pixels are folded
into channels before the first convolution, and the field of view is an input: what a normal mirrors depends on it.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import UNet, Unwrap, Up, UpBlock, Wrap, conv
from anyprobe.nets.lifting import CameraRays


class IrradianceNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1] -> display irradiance [N, 3, 128, 128].

    Zero outside the mask; values are in [0, 1] up to the network's error. Layers are those of light_net.ObjectNet.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128, 192)) -> None:
        super().__init__()
        self.camera_rays = CameraRays()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(16 + 2, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3 * 4, 3, padding=1)

    def forward(self, photo: torch.Tensor, tan_half: torch.Tensor) -> torch.Tensor:
        slope, _ = self.camera_rays(tan_half)
        levels = [self.first(torch.cat([F.pixel_unshuffle(photo, 2), slope], dim=1))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        for up in self.up:
            x = up(x, levels.pop())
        return (photo[:, :3] + F.pixel_shuffle(self.head(x), 2)) * photo[:, 3:]


class IlluminationNet(nn.Module):
    """image [N, 4, 128, 128] (irradiance, mask), tan_half [N, 1] -> LDR map [N, 3, 64, 128] in [0, 1].

    Pixels of the object and pixels of the map do not correspond, so everything
    passes through one vector (`code` numbers), as in the paper.
    """

    def __init__(self, widths: tuple[int, ...] = (64, 96, 160, 192), code: int = 384, start: int = 128) -> None:
        super().__init__()
        self.camera_rays = CameraRays()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.encoder = nn.Sequential(
            conv(64 + 2, widths[0]),  # 32 x 32
            *(layer for a, b in pairs for layer in (conv(a, b, stride=2), conv(b, b))),
            nn.Flatten(),
        )
        self.code = nn.Sequential(nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.start = nn.Sequential(
            nn.Linear(code, start * 4 * 8), nn.LeakyReLU(0.1), nn.Unflatten(1, (start, 4, 8)), Wrap(1)
        )
        self.decoder = nn.Sequential(
            Up(start, 112),  # 8 x 20, 2 columns of them beyond each side
            conv(112, 112),
            Unwrap(1),
            Up(112, 64),
            Unwrap(1),
            Up(64, 32),
            nn.Conv2d(32, 3 * 4, 3, padding=1),
            Unwrap(2),
            nn.PixelShuffle(2),
        )

    def forward(self, image: torch.Tensor, tan_half: torch.Tensor) -> torch.Tensor:
        slope = F.avg_pool2d(self.camera_rays(tan_half)[0], 2)
        code = self.code(self.encoder(torch.cat([F.pixel_unshuffle(image, 4), slope], dim=1)))
        return torch.sigmoid(self.decoder(self.start(code)))


class HdrNet(nn.Module):
    """LDR map [N, 3, 64, 128] in [0, 1] -> ln radiance [N, 3, 64, 128]."""

    def __init__(self, widths: tuple[int, ...] = (24, 48, 64, 96)) -> None:
        super().__init__()
        self.body = nn.Sequential(
            Wrap(16),
            nn.PixelUnshuffle(2),
            UNet(12, widths),
            nn.Conv2d(widths[0], 3 * 4, 1),
            nn.PixelShuffle(2),
            Unwrap(16),
        )

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.body(ldr)


NETS = {"irradiance": IrradianceNet, "illumination": IlluminationNet, "hdr": HdrNet}
"""By stage, in the order in which each reads the one before."""

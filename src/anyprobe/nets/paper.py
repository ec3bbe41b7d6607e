"""The paper's three networks: irradiance (Fig. 5), illumination (Fig. 8) and HDR (Fig. 9).

Stages and their inputs are the paper's, and so is the code between object and map; layers are ours. Pixels are folded
into channels before the first convolution, and the field of view is an input: what a normal mirrors depends on it.
Beside the code, what places of the object show is lifted to where it may have come from, as in `lift`.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import UNet, Unwrap, Up, UpBlock, Wrap, conv
from anyprobe.nets.lifting import CameraRays, lift_to_map, map_pixel, mirror_direction, pyramid


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


class PlaceFeatures(nn.Module):
    """Features of four scales, [N, widths[k], 32 / 2^k, 32 / 2^k], image [N, 4, 32, 32] (irradiance, mask) and wo
    [N, 3, 32, 32] -> maps [N, 2 (FEATURES + 4), 16 / 2^k, 32 / 2^k] of what places of the object show, where their
    mirror directions and where their normals point, with how much is known; and the normals [N, 3, 32, 32], unit.
    """

    FEATURES, ROWS, SCALES = 24, 16, 3

    def __init__(self, widths: tuple[int, ...], width: int = 64, fine: int = 32) -> None:
        super().__init__()
        self.narrow = nn.ModuleList(nn.Conv2d(channels, width, 1) for channels in widths[1:])
        self.mix = conv(width, width)
        self.fine = UpBlock(width, fine)
        self.finest = nn.Conv2d(widths[0], fine, 1)
        self.head = nn.Conv2d(fine, self.FEATURES + 3 + 1, 1)

    def forward(
        self, features: list[torch.Tensor], image: torch.Tensor, wo: torch.Tensor
    ) -> tuple[list[torch.Tensor], torch.Tensor]:
        x = self.narrow[-1](features[-1])
        for narrow, level in zip(reversed(self.narrow[:-1]), reversed(features[1:-1]), strict=True):
            x = F.interpolate(x, scale_factor=2, mode="nearest") + narrow(level)
        x = self.head(self.fine(self.mix(x), self.finest(features[0]))).float()
        shown, normals, weight = x.split([self.FEATURES, 3, 1], dim=1)
        n = normals + wo  # untrained, every place faces the camera
        n = n / n.square().sum(dim=1, keepdim=True).clamp(min=1e-8).sqrt()
        values = torch.cat([image[:, :3] / (image[:, 3:] + 1e-4), shown], dim=1)
        weight = torch.sigmoid(weight) * image[:, 3:]
        scales = []
        for directions in (mirror_direction(n, wo), n):
            sums = lift_to_map(values, weight, map_pixel(directions.detach(), self.ROWS), self.ROWS)
            scales.append(pyramid(sums, self.SCALES))
        return [torch.cat(pair, dim=1) for pair in zip(*scales, strict=True)], n


class Lifted(nn.Module):
    """A map of PlaceFeatures [N, inputs, H, 2H] -> [N, outputs, H, 2H + 2 margin], zero while untrained."""

    def __init__(self, inputs: int, outputs: int, margin: int, width: int = 48) -> None:
        super().__init__()
        self.layers = nn.Sequential(Wrap(margin + 1), conv(inputs, width), Unwrap(1), nn.Conv2d(width, outputs, 1))
        for parameter in self.layers[-1].parameters():
            nn.init.zeros_(parameter)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return self.layers(x)


class IlluminationNet(nn.Module):
    """image [N, 4, 128, 128] (irradiance, mask), tan_half [N, 1] -> LDR map [N, 3, 64, 128] in [0, 1].

    What the whole object shows passes through one vector (`code` numbers), as in the paper; what its places show is
    lifted besides.
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
        self.places = PlaceFeatures(widths)
        self.code = nn.Sequential(nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.start = nn.Sequential(
            nn.Linear(code, start * 4 * 8), nn.LeakyReLU(0.1), nn.Unflatten(1, (start, 4, 8)), Wrap(1)
        )
        seen = 2 * (PlaceFeatures.FEATURES + 4)
        self.lifted = nn.ModuleList([Lifted(seen, 64, 1), Lifted(seen, 112, 2), Lifted(seen, start, 1)])
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
        return self.map_and_normals(image, tan_half)[0]

    def map_and_normals(self, image: torch.Tensor, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """The map, and normals [N, 3, 32, 32] of the places that are lifted."""
        slope, wo = self.camera_rays(tan_half)
        features = [self.encoder[0](torch.cat([F.pixel_unshuffle(image, 4), F.avg_pool2d(slope, 2)], dim=1))]
        for layer in range(1, len(self.encoder) - 1, 2):
            features.append(self.encoder[layer + 1](self.encoder[layer](features[-1])))
        wo = F.avg_pool2d(wo, 2)
        wo = wo / wo.square().sum(dim=1, keepdim=True).sqrt()
        seen, normals = self.places(features, F.avg_pool2d(image, 4), wo)
        fine, middle, coarse = (lifted(scale) for lifted, scale in zip(self.lifted, seen, strict=True))
        x = self.decoder[0](self.start(self.code(self.encoder[-1](features[-1]))) + coarse)
        x = self.decoder[1:5](x + middle)
        return torch.sigmoid(self.decoder[5:](x + fine)), normals


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

"""Lifting: moving each pixel to the direction that its light came from.

A pixel of a smooth object shows mostly the light of its mirror direction. Moved there, pixels of the photo become
pixels of the environment map, and only the gaps remain to be completed.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import direction_to_uv
from anyprobe.render.surface import pixel_rays
from anyprobe_train.nets.blocks import FoldedConv, UpBlock, conv

SIZE = 64
"""Side of the normal, direction and feature images [pixels]; photo and irradiance are twice as large."""


class CameraRays(nn.Module):
    """tan_half [N, 1] of half the field of view -> slope [N, 2, 64, 64] and wo [N, 3, 64, 64].

    wo: unit directions from each pixel's surface point to the camera, camera frame; slope: their x / z and y / z.
    """

    slope: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        unit = torch.from_numpy(pixel_rays(1.0, SIZE)).permute(2, 0, 1)
        self.register_buffer("slope", (unit[:2] / unit[2:])[None], persistent=False)  # [1, 2, S, S]

    def forward(self, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        slope = self.slope * tan_half[:, :, None, None]
        wo = torch.cat([slope, torch.ones_like(slope[:, :1])], dim=1)
        return slope, wo / wo.square().sum(dim=1, keepdim=True).sqrt()


class NormalsNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), slope and wo of CameraRays -> unit normals [N, 3, 64, 64].

    Its coarsest scale sees the whole object at once, so that far parts of an outline or a lit side count.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 80, 160, 256)) -> None:
        super().__init__()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.ModuleList([FoldedConv(4, 2, widths[0]), conv(widths[0], widths[0])])
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.whole = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, widths[-1]))
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3, 3, padding=1)

    def forward(self, photo: torch.Tensor, slope: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        levels = [self.first[1](self.first[0](photo, slope))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        x = x + self.whole(x)[:, :, None, None]
        for up in self.up:
            x = up(x, levels.pop())
        n = self.head(x).float() + wo  # untrained, every point faces the camera
        return n / n.square().sum(dim=1, keepdim=True).clamp(min=1e-8).sqrt()


def given_or_estimated(given: torch.Tensor | None, estimated: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return normals [N, 3, S, S], given ones where there are any, and a mask [N, 1, S, S] of where they are given.

    given: of any length above one half where valid, zero elsewhere; None for none.
    """
    if given is None:
        return estimated, torch.zeros_like(estimated[:, :1])
    length = given.square().sum(dim=1, keepdim=True).sqrt()
    valid = length > 0.5
    return torch.where(valid, given / length.clamp(min=0.5), estimated), valid.to(estimated.dtype)


def mirror_direction(n: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
    """Return the mirror directions 2 (n.wo) n - wo of unit normals and directions to the camera [N, 3, S, S]."""
    return 2.0 * (n * wo).sum(dim=1, keepdim=True) * n - wo


def map_pixel(direction: torch.Tensor, height: int) -> torch.Tensor:
    """Return the row-major index of the pixel of a map [height, 2 height] that each direction [N, 3, S, S] falls in."""
    uv = direction_to_uv(direction.flatten(2).transpose(1, 2))  # [N, S * S, 2]
    column = (uv[..., 0] * (2 * height)).floor().clamp(0, 2 * height - 1).long()
    row = (uv[..., 1] * height).floor().clamp(0, height - 1).long()
    return row * (2 * height) + column


def lift_to_map(values: torch.Tensor, weight: torch.Tensor, pixel: torch.Tensor, height: int) -> torch.Tensor:
    """Add values [N, C, S, S] of weight [N, 1, S, S] on the pixels of a map, pixel [N, S * S] of map_pixel: sums
    [N, C + 1, height, 2 height] of weight x value, and of the weights."""
    carried = torch.cat([values * weight, weight], dim=1).flatten(2)
    sums = torch.zeros(*carried.shape[:2], height * 2 * height, dtype=carried.dtype, device=carried.device)
    sums = sums.scatter_add(2, pixel[:, None].expand_as(carried), carried)
    return sums.unflatten(2, (height, 2 * height))


def pyramid(sums: torch.Tensor, levels: int) -> list[torch.Tensor]:
    """Return weighted means at each scale, [N, C + 1, H / 2^k, 2H / 2^k], the last channel the coverage in [0, 1)."""
    result = []
    for _ in range(levels):
        weight = sums[:, -1:]
        result.append(torch.cat([sums[:, :-1] / (weight + 1e-3), weight / (weight + 0.3)], dim=1))
        sums = F.avg_pool2d(sums, 2) * 4
    return result

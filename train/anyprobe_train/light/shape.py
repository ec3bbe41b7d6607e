"""The shape of an object, as the normals of what is seen of it: a U-Net over its crop."""

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe_train.nets.blocks import UpBlock, conv

CROP_PX, SIDE = 128, 64
"""Sides of the crop's picture and of the picture of the normals [pixels]."""
WIDTHS = (16, 32, 80, 160, 256)


class ShapeNet(nn.Module):
    """Crop and its lens -> unit normals in the camera's frame, see forward.

    Its coarsest scale sees the whole object at once, so that far parts of an outline or a lit side count. It works in
    the frame of a camera that looks at the crop's centre, where an object off centre looks like any other.
    """

    middle_of: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        pairs = list(zip(WIDTHS[:-1], WIDTHS[1:], strict=True))
        self.first = nn.Sequential(conv(4 * 4 + 2, WIDTHS[0]), conv(WIDTHS[0], WIDTHS[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.whole = nn.Sequential(nn.Flatten(), nn.Linear(WIDTHS[-1] * (SIDE >> len(pairs)) ** 2, WIDTHS[-1]))
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(WIDTHS[0], 3, 3, padding=1)
        middle_of = (torch.arange(SIDE) + 0.5) * (2.0 / SIDE) - 1.0
        grid = torch.stack([-middle_of.expand(SIDE, SIDE), middle_of[:, None].expand(SIDE, SIDE)])
        self.register_buffer("middle_of", grid[None].contiguous(), persistent=False)

    def forward(self, crop: torch.Tensor, center: torch.Tensor, half: torch.Tensor, side: int) -> torch.Tensor:
        """Return normals [N, 3, side, side].

        Args:
            crop: [N, 4, H, H] RGB x mask, mask.
            center, half: [N, 2] and [N, 1] the crop's centre (right, up) and half its side on the image plane.
        """
        ray = F.normalize(torch.cat([center, -torch.ones_like(half)], dim=1), dim=1)
        slope = self.middle_of * (half * (-ray[:, 2:]) ** 1.5)[:, :, None, None]
        wo = F.normalize(torch.cat([slope, torch.ones_like(slope[:, :1])], dim=1), dim=1)
        picture = F.interpolate(crop, size=(CROP_PX, CROP_PX), mode="bilinear", align_corners=False)
        shown = torch.cat([F.pixel_unshuffle(picture, 2), slope], dim=1)
        levels = [self.first(shown.contiguous(memory_format=torch.channels_last))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        x = x + self.whole(x.contiguous())[:, :, None, None]
        for up in self.up:
            x = up(x, levels.pop())
        with torch.autocast(x.device.type, enabled=False):
            n = self.head(x.float()) + wo  # untrained, every point faces the camera
            n = F.interpolate(n, size=(side, side), mode="bilinear", align_corners=False)
            return F.normalize(turned_towards(n, ray), dim=1)


def turned_towards(vectors: torch.Tensor, ray: torch.Tensor) -> torch.Tensor:
    """Turn vectors [N, 3, H, W] by the shortest rotation that carries -Z to a direction [N, 3] before the camera."""
    a, b, c = (one[:, None, None] for one in ray.unbind(dim=1))
    x, y, z = vectors.unbind(dim=1)
    along = (a * x + b * y) / (1.0 - c)
    return torch.stack([x - a * (z + along), y - b * (z + along), -c * z + a * x + b * y], dim=1)

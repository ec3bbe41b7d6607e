"""The shape of an object, as the normals of what is seen of it: a U-Net over its crop."""

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe_train.nets.blocks import UpBlock, conv

CROP_PX, SIDE = 128, 64
"""Sides of the crop's picture and of the picture of the normals [pixels]."""
WIDTHS = (16, 32, 80, 160, 256)


def middles(size: int) -> torch.Tensor:
    """Return the middles of so many pixels of a line from -1 to 1."""
    return (torch.arange(size) + 0.5) * (2.0 / size) - 1.0


def plane_of(line: torch.Tensor) -> torch.Tensor:
    """Return right and up [N, 2, S, S] of a square's pixels by those of its upper line, [N, S]; exports fold nothing of
    it into a constant."""
    square = line[:, None].expand(-1, line.shape[1], -1)
    return torch.stack([square, -square.transpose(1, 2)], dim=1)


def facing(rays: torch.Tensor) -> torch.Tensor:
    """Return unit directions to the camera [N, 3, H, W] of points on the image plane [N, 2, H, W] (right, up)."""
    return F.normalize(F.pad(-rays, (0, 0, 0, 0, 0, 1), value=1.0), dim=1)


class CropFrame(nn.Module):
    """Centre (right, up) [N, 2] of crops and half their sides [N, 1] on the image plane -> the directions to them
    [N, 3]; of their pixels, in the frame of a camera that looks at the centre, x / z and y / z [N, 2, 64, 64] and unit
    directions to the camera [N, 3, 64, 64]."""

    middle_of: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("middle_of", middles(SIDE), persistent=False)

    def forward(self, center: torch.Tensor, half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        ray = F.normalize(torch.cat([center, -torch.ones_like(half)], dim=1), dim=1)
        slope = plane_of(-self.middle_of * (half * (-ray[:, 2:]) ** 1.5))
        return ray, slope, facing(-slope)


class ShapeNet(nn.Module):
    """Picture of the crop [N, 4, 128, 128], slope and wo of CropFrame -> normals [N, 3, 64, 64] of any length, in its
    frame, where an object off centre looks like any other.

    The coarsest scale sees the whole object at once, so that far parts of an outline or a lit side count.
    """

    def __init__(self) -> None:
        super().__init__()
        pairs = list(zip(WIDTHS[:-1], WIDTHS[1:], strict=True))
        self.first = nn.Sequential(conv(4 * 4 + 2, WIDTHS[0]), conv(WIDTHS[0], WIDTHS[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.whole = nn.Sequential(nn.Flatten(), nn.Linear(WIDTHS[-1] * (SIDE >> len(pairs)) ** 2, WIDTHS[-1]))
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(WIDTHS[0], 3, 3, padding=1)

    def forward(self, picture: torch.Tensor, slope: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        shown = torch.cat([F.pixel_unshuffle(picture, 2), slope], dim=1)
        levels = [self.first(shown.contiguous(memory_format=torch.channels_last))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        x = x + self.whole(x.contiguous())[:, :, None, None]
        for up in self.up:
            x = up(x, levels.pop())
        with torch.autocast(x.device.type, enabled=False):
            return self.head(x.float()) + wo  # untrained, every point faces the camera


def turned_towards(vectors: torch.Tensor, ray: torch.Tensor) -> torch.Tensor:
    """Turn vectors [N, 3, H, W] by the shortest rotation that carries -Z to a direction [N, 3] before the camera."""
    a, b, c = (one[:, None, None] for one in ray.unbind(dim=1))
    x, y, z = vectors.unbind(dim=1)
    along = (a * x + b * y) / (1.0 - c)
    return torch.stack([x - a * (z + along), y - b * (z + along), -c * z + a * x + b * y], dim=1)


def turned_back(vectors: torch.Tensor, ray: torch.Tensor) -> torch.Tensor:
    """Undo `turned_towards`."""
    return turned_towards(vectors, torch.cat([-ray[:, :2], ray[:, 2:]], dim=1))

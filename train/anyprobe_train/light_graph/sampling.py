"""Pictures and maps read at other places and sizes, by operations that an ONNX graph has. Channels come first."""

from __future__ import annotations

import math

import torch
from torch.nn import functional as F


def length_of(axis: torch.Tensor) -> torch.Tensor:
    """Return the number of elements [] of a vector, which a traced graph keeps dynamic."""
    return torch.ones_like(axis).sum()


def index_of(axis: torch.Tensor) -> torch.Tensor:
    """Return 0, 1, 2, ... along a vector of any length."""
    return torch.cumsum(torch.ones_like(axis), dim=0) - 1.0


def read_weights(start: torch.Tensor, side: torch.Tensor, size: int, axis: torch.Tensor) -> torch.Tensor:
    """Return how much of each pixel of an axis every sample of the window [start, start + side) holds, [size, L].

    Means over the pixels covered when shrinking, linear when enlarging; zero outside the picture.
    axis: any vector of the axis' length L.
    """
    pixel = index_of(axis)[None]
    step = side / size
    low = start + step * torch.arange(size, dtype=torch.float32, device=axis.device)[:, None]
    covered = (torch.minimum(low + step, pixel + 1.0) - torch.maximum(low, pixel)).clamp(min=0.0) / step
    linear = (1.0 - (low + step / 2.0 - 0.5 - pixel).abs()).clamp(min=0.0)
    return torch.where(step >= 1.0, covered, linear)


def read_window(
    picture: torch.Tensor, start: tuple[torch.Tensor, torch.Tensor], sides: tuple[torch.Tensor, torch.Tensor], size: int
) -> torch.Tensor:
    """Return the window of a picture [C, H, W] from (x, y) on, of sides (x, y) in its pixels, as [C, size, size]."""
    across = read_weights(start[0], sides[0], size, picture[0, 0])
    down = read_weights(start[1], sides[1], size, picture[0, :, 0])
    return torch.matmul(down, torch.matmul(picture, across.T))


def shrink(picture: torch.Tensor, width: torch.Tensor, height: torch.Tensor, cell: torch.Tensor) -> torch.Tensor:
    """Return means of a picture [C, H, W] over square cells of `cell` of its pixels, the last one cut at its border.

    width, height: extent of the picture in its own pixels, of which the last may be cut.
    """

    def weights(axis: torch.Tensor, extent: torch.Tensor) -> torch.Tensor:
        pixel = index_of(axis)[None]
        count = torch.ceil(extent / cell - 1e-4)
        low = cell * torch.arange(0, count, 1, dtype=torch.float32)[:, None]  # type: ignore[call-overload]
        high, last = torch.minimum(low + cell, extent), torch.minimum(pixel + 1.0, extent)
        covered = (torch.minimum(high, last) - torch.maximum(low, pixel)).clamp(min=0.0)
        return covered / covered.sum(dim=1, keepdim=True).clamp(min=1e-6)

    across, down = weights(picture[0, 0], width), weights(picture[0, :, 0], height)
    return torch.matmul(down, torch.matmul(picture, across.T))


def read_at(picture: torch.Tensor, column: torch.Tensor, row: torch.Tensor) -> torch.Tensor:
    """Interpolate a picture [C, H, W] at columns and rows [R, Q], 0 at the border of the first pixel: [C, R, Q].

    Places outside count as the border.
    """
    width, height = length_of(picture[0, 0]), length_of(picture[0, :, 0])
    at = torch.stack([2.0 * column / width - 1.0, 2.0 * row / height - 1.0], dim=-1)[None]
    return F.grid_sample(picture[None], at, mode="bilinear", padding_mode="border", align_corners=False)[0]


def read_map(values: torch.Tensor, d: torch.Tensor) -> torch.Tensor:
    """Interpolate a map [C, H, 2H] at unit directions [R, Q, 3]: [C, R, Q]; it wraps around, poles are clamped."""
    height = values.shape[1]
    x, y, z = d.unbind(dim=-1)
    u = 0.5 + torch.atan2(x, -z) / (2.0 * math.pi)
    v = torch.acos(y.clamp(-1.0, 1.0)) / math.pi
    wide = torch.cat([values[..., -1:], values, values[..., :1]], dim=2)
    return read_at(wide, u * (2 * height) + 1.0, v * height)


def on_plane(d: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Project directions [..., 3] to x and y on the plane z = -1 before the eye, and return which meet it."""
    depth = (-d[..., 2]).clamp(min=0.05)
    return d[..., 0] / depth, d[..., 1] / depth, (d[..., 2] < -0.05).float()


def inside(column: torch.Tensor, row: torch.Tensor, width: torch.Tensor, height: torch.Tensor) -> torch.Tensor:
    """Return 1 where a place lies within a picture, else 0."""
    return ((column > 0) & (column < width) & (row > 0) & (row < height)).float()

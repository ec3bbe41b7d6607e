"""Lifting: what a pixel shows goes to where its light came from.

A pixel of a smooth object shows mostly the light of its mirror direction. Carried there,
pixels of the photo become pixels of the map, and only the gaps are left to imagine.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from anyprobe.core.latlong import direction_to_uv


def mirror_direction(n: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
    """2 (n.wo) n - wo: unit normals and directions to the eye [N, 3, S, S] to mirror directions."""
    return 2.0 * (n * wo).sum(dim=1, keepdim=True) * n - wo


def map_pixel(direction: torch.Tensor, height: int) -> torch.Tensor:
    """Directions [N, 3, S, S] to the number, row by row, of the pixel of a map [height, 2 height] they fall in."""
    uv = direction_to_uv(direction.flatten(2).transpose(1, 2))  # [N, S * S, 2]
    column = (uv[..., 0] * (2 * height)).floor().clamp(0, 2 * height - 1).long()
    row = (uv[..., 1] * height).floor().clamp(0, height - 1).long()
    return row * (2 * height) + column  # in whole numbers: an engine may round others to 8 bits


def lift(values: torch.Tensor, weight: torch.Tensor, pixel: torch.Tensor, height: int) -> torch.Tensor:
    """Sum weighted pixels where they fall.

    Args:
        values: [N, C, S, S]; weight: [N, 1, S, S], zero where nothing is to be carried.
        pixel: [N, S * S] of map_pixel.
    Returns:
        [N, C + 1, height, 2 height]: sums of weight x value, and of the weights.
    """
    carried = torch.cat([values * weight, weight], dim=1).flatten(2)
    sums = torch.zeros(*carried.shape[:2], height * 2 * height, dtype=carried.dtype, device=carried.device)
    sums = sums.scatter_add(2, pixel[:, None].expand_as(carried), carried)
    return sums.unflatten(2, (height, 2 * height))


def pyramid(sums: torch.Tensor, levels: int) -> list[torch.Tensor]:
    """Weighted means at each scale, [N, C + 1, H / 2^k, 2H / 2^k]; the last channel is the coverage in [0, 1)."""
    result = []
    for _ in range(levels):
        weight = sums[:, -1:]
        result.append(torch.cat([sums[:, :-1] / (weight + 1e-3), weight / (weight + 0.3)], dim=1))
        sums = F.avg_pool2d(sums, 2) * 4
    return result

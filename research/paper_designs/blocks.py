"""Pixels in an order in which every convolution that does not overlap is a reshape and a product.

A picture is cut into blocks of blocks of pixels, and its pixels are stored block by block. Then the pixels of a block
are neighbours in memory, and a convolution whose stride is its size is one matrix product.
"""

from __future__ import annotations

import torch

PATCH = 4
"""Pixels along the finest blocks."""
LEAST_SIDE = 3
"""Blocks are joined two by two along either side until the shorter one has so many, or fewer."""


def joins_of(rows: int) -> int:
    """How often blocks of PATCH are joined in a picture of so many rows."""
    side, joins = rows // PATCH, 0
    while side > LEAST_SIDE:
        side, joins = side // 2, joins + 1
    return joins


def nest(x: torch.Tensor, joins: int, finest: int = 1) -> torch.Tensor:
    """[N, H, W, C] row by row to [N, H * W, C] block by block, of `joins` levels of 2 x 2 and one of finest^2."""
    factors = [2] * joins + [finest]
    top = [size // (2**joins * finest) for size in x.shape[1:3]]
    levels = len(factors) + 1
    x = x.reshape(len(x), top[0], *factors, top[1], *factors, x.shape[-1])
    pairs = [axis for k in range(levels) for axis in (1 + k, 1 + levels + k)]
    return x.permute(0, *pairs, 2 * levels + 1).flatten(1, -2)


def unnest(x: torch.Tensor, rows: int, joins: int, finest: int = 1) -> torch.Tensor:
    """The reverse of nest: [N, H * W, C] to [N, H, W, C] with H = rows."""
    factors = [2] * joins + [finest]
    columns = x.shape[1] // rows
    top = [size // (2**joins * finest) for size in (rows, columns)]
    levels = len(factors) + 1
    x = x.unflatten(1, [n for pair in zip([top[0], *factors], [top[1], *factors], strict=True) for n in pair])
    axes = [*range(1, 2 * levels, 2), *range(2, 2 * levels + 1, 2)]
    return x.permute(0, *axes, 2 * levels + 1).reshape(len(x), rows, columns, -1)


def pixels_of(pictures: torch.Tensor) -> torch.Tensor:
    """Pictures [N, C, H, W] as pixels [N, H * W, C] in the order of blocks."""
    return nest(pictures.permute(0, 2, 3, 1), joins_of(pictures.shape[2]), PATCH)


def picture_of(pixels: torch.Tensor, rows: int) -> torch.Tensor:
    """The reverse of pixels_of."""
    return unnest(pixels, rows, joins_of(rows), PATCH).permute(0, 3, 1, 2)

"""Patterns drawn once and read many times: our own, and crops of the maps, which are photos of real surroundings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
import torch.nn.functional as F

from anyprobe.dataset.textures import draw_texture

SIDE = 128
"""Of a pattern in its own pixels."""

REAL_SHARE = 0.5
"""So many patterns are crops of maps, where there are any."""


class TexturePool:
    """Reflectances [3, SIDE, SIDE], mirrored at their borders."""

    def __init__(self, seed: int, count: int, maps: Sequence[np.ndarray | torch.Tensor] = ()) -> None:
        """maps: [H, 2H, 3] radiance, as sharp as they are read where H is 256."""
        rng = np.random.default_rng((seed, 3))
        real = round(REAL_SHARE * count) if len(maps) else 0
        own = [torch.from_numpy(draw_texture(rng)).permute(2, 0, 1).contiguous() for _ in range(count - real)]
        crops = [_crop(rng, maps[int(rng.integers(len(maps)))]) for _ in range(real)]
        self.patterns = torch.stack(own + crops)

    def read(self, rng: np.random.Generator, x: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """A random pattern at coordinates x, y [...] where 2 is one tile: [3, ...]."""
        pattern = self.patterns[int(rng.integers(len(self.patterns)))]
        grid = torch.stack([x, y], dim=-1).reshape(1, 1, -1, 2)
        read = F.grid_sample(pattern[None], grid, padding_mode="reflection", align_corners=False)
        return read.reshape(3, *x.shape)


def _crop(rng: np.random.Generator, radiance: np.ndarray | torch.Tensor) -> torch.Tensor:
    """A piece of a map that is nowhere near its poles, its brightness pressed into what paint reflects."""
    height, width = radiance.shape[:2]
    side = int(rng.integers(height // 4, height // 2 + 1))
    top = int(rng.integers(height * 5 // 32, height * 27 // 32 - side))
    left = int(rng.integers(0, width - side))
    piece = torch.as_tensor(radiance)[top : top + side, left : left + side].permute(2, 0, 1).float()
    piece = piece / (2.0 * piece.flatten().median().clip(min=1e-4))
    piece = F.interpolate(piece[None], size=(SIDE, SIDE), mode="bilinear")[0]
    return (piece / (1 + 0.5 * piece)).clip(0.02, 0.95)

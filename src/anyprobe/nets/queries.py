"""Queries: directions of the map ask the object's pixels for their light, by attention; tried on lift.

A direction that no pixel mirrors may still be told by others (LuxDiT, NVIDIA 2025, has light tokens that attend
to those of a picture). Here 512 directions ask 256 pixels.
"""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions

HEIGHT = 16
"""Rows of the directions that ask."""
TOKENS = 16
"""Pixels a side of what is asked."""
WAVES = 4
"""Octaves of the waves that tell directions apart."""


def direction_code(d: torch.Tensor) -> torch.Tensor:
    """Unit vectors [..., 3] and waves of them, [..., 3 + 6 WAVES]."""
    speed = math.pi * 2.0 ** torch.arange(WAVES, dtype=d.dtype, device=d.device)
    angles = (d[..., None] * speed).flatten(-2)
    return torch.cat([d, torch.sin(angles), torch.cos(angles)], dim=-1)


class Attend(nn.Module):
    """Queries [N, Q, D] and tokens [N, T, D], with what the logits of tokens are raised by [N, T] -> [N, Q, D]."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.before, self.after = nn.LayerNorm(width), nn.LayerNorm(width)
        self.ask, self.tell = nn.Linear(width, width), nn.Linear(width, 2 * width)
        self.join = nn.Linear(width, width)
        self.think = nn.Sequential(nn.Linear(width, 2 * width), nn.GELU(), nn.Linear(2 * width, width))

    def forward(self, queries: torch.Tensor, tokens: torch.Tensor, bias: torch.Tensor) -> torch.Tensor:
        q, k, v = (
            one.unflatten(2, (self.heads, -1)).transpose(1, 2)
            for one in (self.ask(self.before(queries)), *self.tell(tokens).chunk(2, dim=2))
        )
        seen = F.scaled_dot_product_attention(q, k, v, attn_mask=bias[:, None, None].to(q.dtype))
        queries = queries + self.join(seen.transpose(1, 2).flatten(2))
        return queries + self.think(self.after(queries))


class Queries(nn.Module):
    """tokens [N, C, 16, 16], mirror directions [N, 3, 16, 16], cover [N, 1, 16, 16], code -> [N, out, 16, 32]."""

    def __init__(
        self, channels: int, code: int, out: int, width: int = 96, depth: int = 2, heads: int = 4
    ) -> None:
        super().__init__()
        directions = direction_code(torch.from_numpy(pixel_directions(HEIGHT)).flatten(0, 1))
        self.register_buffer("directions", directions, persistent=False)
        self.tokens = nn.Sequential(nn.Linear(channels + directions.shape[1], width), nn.LayerNorm(width))
        self.start, self.code = nn.Linear(directions.shape[1], width), nn.Linear(code, width)
        self.attend = nn.ModuleList(Attend(width, heads) for _ in range(depth))
        self.out = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, out))

    def forward(
        self, tokens: torch.Tensor, mirror: torch.Tensor, cover: torch.Tensor, code: torch.Tensor
    ) -> torch.Tensor:
        features = torch.cat([tokens.flatten(2).transpose(1, 2), direction_code(mirror.flatten(2).mT)], dim=2)
        told, bias = self.tokens(features), torch.log(cover.flatten(1).float() + 1e-6)
        x = self.start(self.directions)[None] + self.code(code)[:, None]
        for attend in self.attend:
            x = attend(x, told, bias)
        return self.out(x).mT.unflatten(2, (HEIGHT, 2 * HEIGHT))

"""Two tone-mapped maps for one HDR map, and the rule that merges them (LuxDiT, NVIDIA 2025); tried on lift.

Reinhard's curve has the steps where a display has them, the logarithm reaches the sun. E is radiance in units of
the photo's white.
"""

from __future__ import annotations

import math

import torch

WHITE = 16.0
"""Radiance that Reinhard's curve maps to 1."""
MOST = 1e4
"""Radiance that the logarithm maps to 1."""


def reinhard(e: torch.Tensor) -> torch.Tensor:
    """E (1 + E / 16^2) / (1 + E), at most 1."""
    return (e * (1 + e / WHITE**2) / (1 + e)).clamp(max=1.0)


def from_reinhard(tone: torch.Tensor) -> torch.Tensor:
    """Inverse of reinhard in [0, 1]."""
    b = 1 - tone
    return 0.5 * WHITE**2 * (torch.sqrt(b * b + 4 * tone / WHITE**2) - b)


def logarithm(e: torch.Tensor) -> torch.Tensor:
    """ln(1 + E) / ln(1 + 10^4), at most 1."""
    return (torch.log1p(e) / math.log1p(MOST)).clamp(max=1.0)


def from_logarithm(tone: torch.Tensor) -> torch.Tensor:
    """Inverse of logarithm in [0, 1]."""
    return torch.expm1(tone * math.log1p(MOST))


def merge(low: torch.Tensor, high: torch.Tensor) -> torch.Tensor:
    """Radiance of both tone-mapped values: Reinhard's below 8, the logarithm's from 16 on, mixed between."""
    e = from_reinhard(low)
    share = ((e - WHITE / 2) / (WHITE / 2)).clamp(0.0, 1.0)
    return torch.lerp(e, from_logarithm(high), share)

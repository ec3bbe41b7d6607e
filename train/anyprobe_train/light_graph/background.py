"""Background test: find photos whose background says nothing of the light.

For weights that never saw a cut-out as a whole photo; the next ones learn it themselves.
"""

from __future__ import annotations

import torch
from torch.nn import functional as F

from anyprobe.core.color import REC709

PLAIN_STEP, PLAIN_SHARE = 0.012, 0.9
"""Display values by which pixels of a plain background differ from a quadratic of the place, and their least share."""
DARK_BESIDE = 0.35
"""Mean display luminance beside the object over the object's below which its surroundings are unlit."""
SAMPLES = 128
"""Samples along either side of the photo."""
ROUNDS = 4
"""Fits of the quadratic, each to the pixels that were near the last."""
NEAR = 3.0
"""Largest distance from the last fit, in its mean distance, of pixels that the next one is fitted to."""
DAMPING = 1e-6


def plain_and_dark(photo: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return two flags [], 1 or 0: whether the background of a photo is transparent, of one colour or of a backdrop's
    smooth shading; and whether it is much darker than the object.

    photo: [5, H, W] display RGB, cover, mask.
    """
    across = (torch.arange(SAMPLES, dtype=torch.float32) + 0.5) / (SAMPLES / 2) - 1.0
    row, column = torch.meshgrid(across, across, indexing="ij")
    at = torch.stack([column, row], dim=-1)[None]
    sampled = F.grid_sample(photo[None], at, mode="nearest", align_corners=False)[0].flatten(1)
    display, cover, mask = sampled[:3].clamp(max=1.0), sampled[3], sampled[4]
    beside = (mask < 0.5).float()
    count = beside.sum()
    hidden = (beside * (cover < 0.5)).sum() / count.clamp(min=1.0)
    level = torch.tensor(REC709) @ display
    within = 1.0 - beside
    dark = (level * beside).sum() / count.clamp(min=1.0) < DARK_BESIDE * (level * within).sum() / within.sum().clamp(
        min=1.0
    )
    x, y = column.flatten(), row.flatten()
    terms = torch.stack([torch.ones_like(x), x, y, x * x, x * y, y * y])
    weight = beside
    distance = torch.zeros_like(beside)
    for _ in range(ROUNDS):
        weighted = terms * weight
        fit = solve(weighted @ terms.T + DAMPING * torch.eye(6), weighted @ display.T)
        distance = (display - fit.T @ terms).abs().amax(dim=0)
        typical = (distance * weight).sum() / weight.sum().clamp(min=1.0)
        weight = beside * (distance <= NEAR * typical + PLAIN_STEP / 2)
    plain = (beside * (distance <= PLAIN_STEP)).sum() / count.clamp(min=1.0) >= PLAIN_SHARE
    is_plain = (plain | (hidden >= 0.5) | (count < 1.0)).float()
    some = ((count > 0) & (within.sum() > 0)).float()
    return is_plain, dark.float() * some


def solve(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Solve a x = b of a positive definite a [N, N] and b [N, M] by elimination: graphs have no other way."""
    both = torch.cat([a, b], dim=1)
    rows = list(both.unbind(dim=0))
    for k in range(len(rows)):
        rows[k] = rows[k] / rows[k][k]
        for other in range(len(rows)):
            if other != k:
                rows[other] = rows[other] - rows[other][k] * rows[k]
    return torch.stack(rows)[:, a.shape[1] :]

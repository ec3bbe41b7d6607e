"""Lifted pixels and a code -> the whole map: completes and sharpens on the sphere."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions
from anyprobe.nets.blocks import Rise, conv

HEIGHT = 32
"""Rows that it works at; the map has twice as many."""
MARGIN = 8
"""Columns repeated beyond the seam, on both sides."""


def _wrap(x: torch.Tensor, columns: int) -> torch.Tensor:
    return torch.cat([x[..., -columns:], x, x[..., :columns]], dim=3)


def _close(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Undo _wrap; what was computed twice, once on each side, is faded into one so that no seam shows."""
    left, core, right = x.split([columns, x.shape[3] - 2 * columns, columns], dim=3)
    first, middle, last = core.split([columns, core.shape[3] - 2 * columns, columns], dim=3)
    fade = 0.5 - (torch.arange(columns, dtype=x.dtype, device=x.device) + 0.5) / (2 * columns)  # 0.5 to 0
    return torch.cat(
        [first + fade * (right - first), middle, last + fade.flip(0) * (left - last)],
        dim=3,
    )


class SphereNet(nn.Module):
    """Lifted means at 64, 32, 16, 8 and 4 rows, a code, what is known [N, 4, 64, 128] and what was asked for
    [N, asked, 16, 32] -> [N, outputs, 64, 128].

    Those at 64 rows have `fine` channels, all others `lifted`. Every scale sees the lifted
    pixels of its own size, so that gaps are filled from coarser ones; the pixels'
    directions tell it where up and forward are.
    """

    def __init__(
        self,
        fine: int,
        lifted: int,
        code: int,
        outputs: int,
        widths: tuple[int, ...] = (24, 48, 96, 128),
        asked: int = 0,
    ) -> None:
        super().__init__()
        directions = torch.from_numpy(pixel_directions(HEIGHT)).permute(2, 0, 1)[None]
        self.register_buffer("directions", _wrap(directions, MARGIN), persistent=False)
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        deepest = HEIGHT >> len(pairs)
        self.start = nn.Sequential(nn.Linear(code, 48 * deepest * 2 * deepest), nn.LeakyReLU(0.1))
        self.deepest = deepest
        self.first = nn.Sequential(conv(4 * fine + lifted + 3 + 4, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(conv(a, b, stride=2) for a, b in pairs)
        more = {widths[1]: asked, widths[-1]: 48}
        self.seen = nn.ModuleList(conv(b + lifted + more.get(b, 0), b) for _, b in pairs)
        self.rise = nn.ModuleList(Rise(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 4 * outputs, 3, padding=1)

    def forward(
        self,
        scales: list[torch.Tensor],
        code: torch.Tensor,
        around: torch.Tensor,
        asked: torch.Tensor | None = None,
    ) -> torch.Tensor:
        fine, *rest = scales
        directions = self.directions.expand(fine.shape[0], -1, -1, -1)
        seen = torch.cat([F.pixel_unshuffle(fine, 2), rest[0], F.avg_pool2d(around, 2)], dim=1)
        x = torch.cat([_wrap(seen, MARGIN), directions], dim=1)
        levels = [self.first(x)]
        start = self.start(code).reshape(-1, 48, self.deepest, 2 * self.deepest)
        for depth, (down, seen) in enumerate(zip(self.down, self.seen, strict=True), start=1):
            parts = [down(levels[-1]), _wrap(rest[depth], MARGIN >> depth)]
            if asked is not None and depth == 1:
                parts.append(_wrap(asked, MARGIN >> depth))
            if depth == len(self.down):
                parts.append(_wrap(start, MARGIN >> depth))
            levels.append(seen(torch.cat(parts, dim=1)))
        x = levels.pop()
        for rise in self.rise:
            x = rise(x, levels.pop())
        return _close(F.pixel_shuffle(self.head(x), 2), 2 * MARGIN)

"""Photo -> normals: a network of its own, since lifting can be no better than they are."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import Rise, conv


class NormalsNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), slope and wo of Eye -> unit normals [N, 3, 64, 64].

    Its coarsest scale sees the whole object at once, so that far parts of an outline or a lit side count.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 80, 160, 256)) -> None:
        super().__init__()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(16 + 2, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.whole = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, widths[-1]))
        self.rise = nn.ModuleList(Rise(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3, 3, padding=1)

    def forward(self, photo: torch.Tensor, slope: torch.Tensor, wo: torch.Tensor) -> torch.Tensor:
        levels = [self.first(torch.cat([F.pixel_unshuffle(photo, 2), slope], dim=1))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        x = x + self.whole(x)[:, :, None, None]
        for rise in self.rise:
            x = rise(x, levels.pop())
        n = self.head(x).float() + wo  # at the start every point faces the eye
        return n / n.square().sum(dim=1, keepdim=True).clamp(min=1e-8).sqrt()


def told_or_guessed(told: torch.Tensor | None, guessed: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Normals [N, 3, S, S], those that somebody knows where there are any, and where that is, [N, 1, S, S] of 0 and 1.

    told: of any length above one half where known, zero elsewhere; None where nothing is.
    """
    if told is None:
        return guessed, torch.zeros_like(guessed[:, :1])
    length = told.square().sum(dim=1, keepdim=True).sqrt()
    known = length > 0.5
    return torch.where(known, told / length.clamp(min=0.5), guessed), known.to(guessed.dtype)

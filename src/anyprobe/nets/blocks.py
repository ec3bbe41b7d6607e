"""Parts that the networks share. NCHW; N batch, C channels, H x W pixels."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F


def has_bfloat16(device: torch.device | str) -> bool:
    """Whether the device computes in bfloat16; a processor without it takes seconds for a convolution."""
    return torch.device(device).type != "cpu" or torch.ops.mkldnn._is_mkldnn_bf16_supported()


def autocast(device: torch.device | str) -> torch.autocast:
    """bfloat16 arithmetic where the device has it."""
    return torch.autocast(torch.device(device).type, dtype=torch.bfloat16, enabled=has_bfloat16(device))


def wrap(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Repeat `columns` of equirectangular pictures [N, C, H, 2H] beyond their seam, on both sides."""
    return torch.cat([x[..., -columns:], x, x[..., :columns]], dim=3)


def fade_seam(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Undo wrap; what was computed twice, once on each side, is faded into one so that no seam shows."""
    left, core, right = x.split([columns, x.shape[3] - 2 * columns, columns], dim=3)
    first, middle, last = core.split([columns, core.shape[3] - 2 * columns, columns], dim=3)
    fade = 0.5 - (torch.arange(columns, dtype=x.dtype, device=x.device) + 0.5) / (2 * columns)  # 0.5 to 0
    return torch.cat([first + fade * (right - first), middle, last + fade.flip(0) * (left - last)], dim=3)


def conv(inputs: int, outputs: int, *, stride: int = 1) -> nn.Sequential:
    """3 x 3 convolution, batch normalisation, leaky ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1, inplace=True)
    )


class UpBlock(nn.Module):
    """Twice the size, added to the skip, then a convolution: a third of what stacking them costs."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.narrow = nn.Conv2d(inputs, outputs, 1)
        self.conv = conv(outputs, outputs)

    def forward(self, x: torch.Tensor, skip: torch.Tensor) -> torch.Tensor:
        return self.conv(F.interpolate(self.narrow(x), scale_factor=2, mode="nearest") + skip)


class UNet(nn.Module):
    """Ronneberger et al. 2015: features of len(widths) scales, joined by skips that are added.

    [N, inputs, H, W] -> [N, widths[0], H, W], and the deepest features; H and W divisible by 2^(len(widths) - 1).
    """

    def __init__(self, inputs: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(inputs, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))

    def forward(self, x: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        levels = [self.first(x)]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = deepest = levels.pop()
        for up in self.up:
            x = up(x, levels.pop())
        return x, deepest

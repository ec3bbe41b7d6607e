"""Building blocks of the networks. NCHW; N batch, C channels, H x W pixels."""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import nn
from torch.nn import functional as F


def has_bfloat16(device: torch.device | str) -> bool:
    """Return whether the device computes in bfloat16; a processor without it takes seconds per convolution."""
    return torch.device(device).type != "cpu" or torch.ops.mkldnn._is_mkldnn_bf16_supported()


def autocast(device: torch.device | str) -> torch.autocast:
    """Enable bfloat16 arithmetic if the device has it."""
    return torch.autocast(torch.device(device).type, dtype=torch.bfloat16, enabled=has_bfloat16(device))


def wrap(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Repeat `columns` of equirectangular pictures [N, C, H, 2H] beyond their seam, on both sides."""
    return torch.cat([x[..., -columns:], x, x[..., :columns]], dim=3)


def fade_seam(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Undo wrap; the columns computed on both sides are blended, so that no seam shows."""
    left, core, right = x.split([columns, x.shape[3] - 2 * columns, columns], dim=3)
    first, middle, last = core.split([columns, core.shape[3] - 2 * columns, columns], dim=3)
    fade = 0.5 - (torch.arange(columns, dtype=x.dtype, device=x.device) + 0.5) / (2 * columns)  # 0.5 to 0
    return torch.cat([first + fade * (right - first), middle, last + fade.flip(0) * (left - last)], dim=3)


def conv(inputs: int, outputs: int, *, stride: int = 1) -> nn.Sequential:
    """Build a 3 x 3 convolution with batch normalisation and leaky ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1, inplace=True)
    )


def two_layers(inputs: int, outputs: int, between: int = 64) -> nn.Sequential:
    """Build two linear layers with leaky ReLU between them, [N, inputs] -> [N, outputs]."""
    return nn.Sequential(nn.Linear(inputs, between), nn.LeakyReLU(0.1), nn.Linear(between, outputs))


class FoldedConv(nn.Sequential):
    """`conv` of a picture [N, channels, 2H, 2W] whose pixels are folded into channels, 2 x 2 at a time, and of what is
    beside them, [N, beside, H, W] -> [N, outputs, H, W].

    Except in training it is one convolution of stride 2 and one of what is beside: the same sums, in half the time.
    """

    def __init__(self, channels: int, beside: int, outputs: int) -> None:
        super().__init__(*conv(4 * channels + beside, outputs))
        self.channels = channels

    def forward(self, picture: torch.Tensor, beside: torch.Tensor | None = None) -> torch.Tensor:  # type: ignore[override]
        if self.training:
            parts = [F.pixel_unshuffle(picture, 2)] + ([] if beside is None else [beside])
            return super().forward(torch.cat(parts, dim=1))
        convolution, norm, activation = cast("tuple[Any, Any, Any]", tuple(self))
        scale = norm.weight * (norm.running_var + norm.eps).rsqrt()
        kernel, bias = convolution.weight * scale[:, None, None, None], norm.bias - norm.running_mean * scale
        folded = 4 * self.channels
        wide = kernel[:, :folded].reshape(-1, self.channels, 2, 2, 3, 3).permute(0, 1, 4, 2, 5, 3)
        x = F.conv2d(picture, wide.reshape(-1, self.channels, 6, 6), bias, stride=2, padding=2)
        return activation(x if beside is None else x + F.conv2d(beside, kernel[:, folded:], padding=1))


class UpBlock(nn.Module):
    """Upsampling by two, added to the skip, then a convolution: a third of the cost of stacking them."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.narrow = nn.Conv2d(inputs, outputs, 1)
        self.conv = conv(outputs, outputs)

    def forward(self, x: torch.Tensor, skip: torch.Tensor) -> torch.Tensor:
        return self.conv(F.interpolate(self.narrow(x), scale_factor=2, mode="nearest") + skip)

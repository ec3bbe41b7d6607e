"""Building blocks of the networks. NCHW; N batch, C channels, H x W pixels."""

import torch
from torch import nn
from torch.nn import functional as F


def autocast(device: torch.device | str) -> torch.autocast:
    """Enable bfloat16 arithmetic if the device has it; a processor without it would take seconds per convolution."""
    kind = torch.device(device).type
    is_there = kind != "cpu" or torch.ops.mkldnn._is_mkldnn_bf16_supported()
    return torch.autocast(kind, dtype=torch.bfloat16, enabled=is_there)


def wrap(x: torch.Tensor, columns: int) -> torch.Tensor:
    """Repeat `columns` of equirectangular pictures [N, C, H, 2H] beyond their seam, on both sides."""
    return torch.cat([x[..., -columns:], x, x[..., :columns]], dim=3)


def conv(inputs: int, outputs: int, *, stride: int = 1) -> nn.Sequential:
    """Build a 3 x 3 convolution with batch normalisation and leaky ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm2d(outputs), nn.LeakyReLU(0.1, inplace=True)
    )


def two_layers(inputs: int, outputs: int, between: int = 64) -> nn.Sequential:
    """Build two linear layers with leaky ReLU between them, [N, inputs] -> [N, outputs]."""
    return nn.Sequential(nn.Linear(inputs, between), nn.LeakyReLU(0.1), nn.Linear(between, outputs))


class UpBlock(nn.Module):
    """Upsampling by two, added to the skip, then a convolution: a third of the cost of stacking them."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.narrow = nn.Conv2d(inputs, outputs, 1)
        self.conv = conv(outputs, outputs)

    def forward(self, x: torch.Tensor, skip: torch.Tensor) -> torch.Tensor:
        return self.conv(F.interpolate(self.narrow(x), scale_factor=2, mode="nearest") + skip)

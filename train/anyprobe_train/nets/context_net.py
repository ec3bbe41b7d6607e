"""The object's context in the photo: the ground below it, its shadow there, what is behind it."""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe_train.nets.blocks import conv, two_layers

SIZE = 96
"""Side of the context picture, twice as wide as the crop."""
CODE = 128
DROPPED = 0.3
"""Share of what the convolutions find that a step of training goes without."""
POSTURE = ("pitch", "ln_pitch_error", "roll", "stands_logit")
"""Estimates of the camera and the ground: pitch and roll of the crop's frame in radians, ln of the pitch's mean
error in radians, and the logit of the object's standing on a level ground."""


class ContextNet(nn.Module):
    """context [N, 5, 96, 96] (display RGB, mask, where the photo is: all zero outside it) and tan_half [N, 1] of the
    crop -> code [N, CODE] and posture [N, 4] of POSTURE, both zero where there is no context.

    The code is that of what lies around; LightNet adds it to the object's.
    """

    def __init__(self, widths: tuple[int, ...] = (32, 64, 96, 128)) -> None:
        super().__init__()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = conv(20 + 1, widths[0])
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        side = SIZE // 2 >> len(pairs)
        flat = widths[-1] * side * side
        self.code = nn.Sequential(nn.Flatten(), nn.Dropout(DROPPED), nn.Linear(flat, CODE), nn.LeakyReLU(0.1))
        self.posture = two_layers(CODE, len(POSTURE))

    def forward(self, context: torch.Tensor, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        present = (context[:, 4:].amax(dim=(2, 3)) > 0).float()  # [N, 1]
        if not self.training:
            code, posture = self._look(context, tan_half)
            return code * present, posture * present
        code, posture = context.new_zeros(len(context), CODE), context.new_zeros(len(context), len(POSTURE))
        some = present[:, 0] > 0  # statistics are those of photos that have a context
        if some.any():
            found = self._look(context[some], tan_half[some])
            code = code.masked_scatter(some[:, None], found[0])
            posture = posture.masked_scatter(some[:, None], found[1])
        return code, posture

    def _look(self, context: torch.Tensor, tan_half: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        x = F.pixel_unshuffle(context, 2)
        width = tan_half[:, :, None, None].expand(-1, 1, *x.shape[2:])
        x = self.first(torch.cat([x, width], dim=1))
        for down in self.down:
            x = down(x)
        code = self.code(x).float()
        return code, self.posture(code).float()

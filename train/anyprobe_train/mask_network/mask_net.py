"""The mask network: a U-Net from photo and hints to the object's cover, working at half the photo's size."""

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe_train.nets.blocks import conv

HINT_GAIN = 4.0
"""Gain on the hint channel: a hint's few pixels must count as much as the photo's many from the first step on."""


class Residual(nn.Module):
    """x plus two 3 x 3 convolutions of it."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = conv(channels, channels)
        self.second = nn.Sequential(nn.Conv2d(channels, channels, 3, padding=1, bias=False), nn.BatchNorm2d(channels))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return F.leaky_relu(x + self.second(self.first(x)), 0.1)


class MaskNet(nn.Module):
    """image [N, 4, 160, 160] (display RGB, hint channel) -> cover [N, 1, 160, 160] in [0, 1].

    The first convolution halves the size and each pixel of the last one gives four, so that nothing is computed at full
    size; nearest repetition and pixel shuffling run everywhere alike. Skips are added, not stacked: half the
    arithmetic, spent on depth where pixels are few. While training, `logits` is what the loss sees.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 96, 128)) -> None:
        super().__init__()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(4, widths[0], stride=2), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(
            nn.Sequential(conv(a, b, stride=2), conv(b, b) if level == 0 else Residual(b))
            for level, (a, b) in enumerate(pairs)
        )
        self.deep = Residual(widths[-1])
        self.narrow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in reversed(pairs))
        self.join = nn.ModuleList(conv(a, a) for a, _ in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 4, 3, padding=1)

    def logits(self, image: torch.Tensor) -> torch.Tensor:
        """Return the cover's logits [N, 1, 160, 160]."""
        given = torch.cat([image[:, :3], HINT_GAIN * image[:, 3:]], dim=1)
        features = [self.first(given)]
        for down in self.down:
            features.append(down(features[-1]))
        x = self.deep(features.pop())
        for narrow, join in zip(self.narrow, self.join, strict=True):
            x = join(F.interpolate(narrow(x), scale_factor=2, mode="nearest") + features.pop())
        return F.pixel_shuffle(self.head(x), 2)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.logits(image))

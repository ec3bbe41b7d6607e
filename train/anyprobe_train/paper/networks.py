"""The paper's three networks, Figs. 5, 8 and 9. It prints no layers: these are pix2pix's (Isola et al. 2017).

Down: convolution 4 x 4 of stride 2, batch normalisation (none in the first), leaky ReLU. Up: transposed convolution
4 x 4 of stride 2, batch normalisation, ReLU. Pictures are [N, C, H, W], display values in [0, 1] unless said otherwise.
"""

from itertools import pairwise

import torch
from torch import nn

from anyprobe.paper.chain import LN_SCALE

LEAK = 0.2
DEEPEST = 8
"""Largest number of channels, in widths."""


def scaled_ln(ln_radiance):
    """Bring LN_SCALE to 0 to 1."""
    return (ln_radiance - LN_SCALE[0]) / (LN_SCALE[1] - LN_SCALE[0])


def ln_of_scaled(scaled):
    """Undo scaled_ln."""
    return scaled * (LN_SCALE[1] - LN_SCALE[0]) + LN_SCALE[0]


def down(before: int, after: int, *, normalised: bool = True) -> nn.Sequential:
    """Halve the sides."""
    norm = [nn.BatchNorm2d(after)] if normalised else []
    return nn.Sequential(nn.Conv2d(before, after, 4, 2, 1, bias=not normalised), *norm, nn.LeakyReLU(LEAK))


def up(before: int, after: int) -> nn.Sequential:
    """Double the sides."""
    return nn.Sequential(nn.ConvTranspose2d(before, after, 4, 2, 1, bias=False), nn.BatchNorm2d(after), nn.ReLU())


def contracting(channels: int, widths: list[int]) -> nn.ModuleList:
    """Build the layers down, from so many channels."""
    return nn.ModuleList([down(a, b, normalised=k > 0) for k, (a, b) in enumerate(pairwise([channels, *widths]))])


def widths_of(width: int, count: int) -> list[int]:
    """Double the width from layer to layer up to DEEPEST of them."""
    return [width * min(2**k, DEEPEST) for k in range(count)]


class SkipNet(nn.Module):
    """A U-Net (Ronneberger et al. 2015) with concatenated skips, down to two pixels: [N, C, H, W] -> [N, out, H, W]."""

    def __init__(self, channels: int, out: int, rows: int, width: int) -> None:
        super().__init__()
        widths = widths_of(width, rows.bit_length() - 2)
        self.downs = contracting(channels, widths)
        skips = widths[-2::-1]
        sizes = [widths[-1]] + [2 * skip for skip in skips]
        self.ups = nn.ModuleList([up(before, after) for before, after in zip(sizes, skips, strict=False)])
        self.head = nn.ConvTranspose2d(sizes[-1], out, 4, 2, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Apply the network."""
        skips = []
        for layer in self.downs:
            x = layer(x)
            skips.append(x)
        for layer, skip in zip(self.ups, skips[-2::-1], strict=True):
            x = torch.cat([layer(x), skip], dim=1)
        return self.head(x)


class IrradianceNet(nn.Module):
    """Fig. 5: photo RGB and mask [N, 4, S, S] to the I-Irradiance image [N, 3, S, S], as a residual to the photo."""

    def __init__(self, side: int, width: int) -> None:
        super().__init__()
        self.residual = SkipNet(4, 3, side, width)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        """Estimate; zero off the object."""
        return (photo[:, :3] + self.residual(photo)) * photo[:, 3:]


class IlluminationNet(nn.Module):
    """Fig. 8: I-Irradiance RGB and mask [N, 4, S, S], a code, and the LDR map [N, 3, R, 2 R]; 4 x 4 and 4 x 8 pixels
    stand around the code."""

    columns = 8

    def __init__(self, side: int, rows: int, width: int, code: int) -> None:
        super().__init__()
        widths = widths_of(width, side.bit_length() - 3)
        self.downs = nn.Sequential(*contracting(4, widths))
        self.encode = nn.Sequential(nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(LEAK))
        self.deepest = DEEPEST * width
        self.decode = nn.Sequential(nn.Linear(code, self.deepest * 4 * self.columns), nn.LeakyReLU(LEAK))
        sizes = [self.deepest] + [width * 2**k for k in reversed(range(rows.bit_length() - 4))]
        self.ups = nn.Sequential(*[up(before, after) for before, after in pairwise(sizes)])
        self.head = nn.ConvTranspose2d(sizes[-1], 3, 4, 2, 1)

    def forward(self, irradiance: torch.Tensor) -> torch.Tensor:
        """Estimate; not clipped."""
        code = self.encode(self.downs(irradiance).flatten(1))
        return self.head(self.ups(self.decode(code).unflatten(1, (self.deepest, 4, self.columns))))


class HdrNet(nn.Module):
    """Fig. 9: LDR map [N, 3, R, 2 R] to its ln radiance, scaled by scaled_ln."""

    def __init__(self, rows: int, width: int) -> None:
        super().__init__()
        self.unet = SkipNet(3, 3, rows, width)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        """Estimate."""
        return self.unet(ldr)


class LnRadiance(nn.Module):
    """Undo the HDR net's scale."""

    def forward(self, scaled: torch.Tensor) -> torch.Tensor:
        """Return ln radiance."""
        return ln_of_scaled(scaled)


def in_chain(net: nn.Module) -> nn.Module:
    """Return a trained network as estimate_light takes it: display values clipped to [0, 1], or ln radiance."""
    return nn.Sequential(net, LnRadiance() if isinstance(net, HdrNet) else nn.Hardtanh(0.0, 1.0)).eval()

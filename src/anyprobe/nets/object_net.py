"""Photo and normals -> irradiance, alpha, features: what the object's picture says about itself."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import Rise, conv
from anyprobe.nets.queries import TOKENS


@dataclass(frozen=True, kw_only=True, slots=True)
class Told:
    """What ObjectNet says of a batch.

    irradiance [N, 3, 128, 128] display; features [N, F, 64, 64]; weight [N, 1, 64, 64] in [0, 1], zero outside
    the mask; root_alpha [N, 1]; code [N, C]; tokens [N, num_tokens, 16, 16]: what is known of larger pixels.
    """

    irradiance: torch.Tensor
    features: torch.Tensor
    weight: torch.Tensor
    root_alpha: torch.Tensor
    code: torch.Tensor
    tokens: torch.Tensor


class ObjectNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), slope [N, 2, 64, 64] of Eye, unit normals
    [N, 3, 64, 64] and where they are known [N, 1, 64, 64] rather than guessed; around [N, 4, H, 2H], what is
    known of the map (see LightNet) -> Told.

    Two pixels in each direction are folded into channels at once, so that nothing is
    computed at full size.
    """

    def __init__(
        self, widths: tuple[int, ...] = (16, 32, 64, 128, 192), features: int = 8, code: int = 192
    ) -> None:
        super().__init__()
        self.num_features, self.num_tokens = features, widths[2]
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(16 + 2 + 4, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.around = nn.Sequential(
            nn.AvgPool2d(8),
            nn.Flatten(),
            nn.Linear(4 * 8 * 16, 64),
            nn.LeakyReLU(0.1),
            nn.Linear(64, widths[-1]),
        )
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.alpha = nn.Linear(code, 1)
        self.rise = nn.ModuleList(Rise(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3 * 4 + 1 + features, 3, padding=1)

    def forward(
        self,
        photo: torch.Tensor,
        slope: torch.Tensor,
        normals: torch.Tensor,
        known: torch.Tensor,
        around: torch.Tensor,
    ) -> Told:
        levels = [self.first(torch.cat([F.pixel_unshuffle(photo, 2), slope, normals, known], dim=1))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop() + self.around(around)[:, :, None, None]
        code = self.code(x)
        tokens = x
        for rise in self.rise:
            x = rise(x, levels.pop())
            tokens = x if x.shape[2] == TOKENS else tokens
        residual, weight, features = self.head(x).split([12, 1, self.num_features], dim=1)
        return Told(
            irradiance=(photo[:, :3] + F.pixel_shuffle(residual, 2)) * photo[:, 3:],
            features=features,
            weight=torch.sigmoid(weight.float()) * F.avg_pool2d(photo[:, 3:], 2),
            root_alpha=torch.sigmoid(self.alpha(code)),
            code=code,
            tokens=tokens,
        )

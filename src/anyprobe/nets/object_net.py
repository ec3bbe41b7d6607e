"""Photo -> irradiance, normals, alpha: what the object's picture says about itself.

Where somebody knows the normals (a tracked model, a depth camera), they are told, and the network's own give way.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.nets.blocks import Rise, conv
from anyprobe.render.surface import pixel_rays

SIZE = 64
"""Side of the pictures of normals and features; photo and irradiance have twice as much."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Told:
    """What ObjectNet says of a batch.

    irradiance [N, 3, 128, 128] display; normals [N, 3, 64, 64] unit, camera frame: those that were given, else
    those estimated; wo [N, 3, 64, 64];
    features [N, F, 64, 64]; weight [N, 1, 64, 64] in [0, 1], zero outside the mask; root_alpha [N, 1];
    code [N, C].
    """

    irradiance: torch.Tensor
    normals: torch.Tensor
    wo: torch.Tensor
    features: torch.Tensor
    weight: torch.Tensor
    root_alpha: torch.Tensor
    code: torch.Tensor


class ObjectNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1], normals [N, 3, 64, 64] -> Told.

    normals: known ones, camera frame, unit; zero where they are not known, by default everywhere.

    Two pixels in each direction are folded into channels at once, so that nothing is
    computed at full size.
    """

    def __init__(
        self, widths: tuple[int, ...] = (16, 40, 80, 128, 192), features: int = 8, code: int = 192
    ) -> None:
        super().__init__()
        unit = torch.from_numpy(pixel_rays(1.0, SIZE)).permute(2, 0, 1)
        self.register_buffer("slope", (unit[:2] / unit[2:])[None], persistent=False)  # [1, 2, S, S]
        self.num_features = features
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.Sequential(conv(16 + 2 + 4, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.alpha = nn.Linear(code, 1)
        self.rise = nn.ModuleList(Rise(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3 * 4 + 3 + 1 + features, 3, padding=1)

    def forward(
        self, photo: torch.Tensor, tan_half: torch.Tensor, normals: torch.Tensor | None = None
    ) -> Told:
        mask = F.avg_pool2d(photo[:, 3:], 2)
        slope = self.slope * tan_half[:, :, None, None]
        wo = torch.cat([slope, torch.ones_like(slope[:, :1])], dim=1)
        wo = wo / wo.square().sum(dim=1, keepdim=True).sqrt()
        given = torch.zeros_like(wo) if normals is None else normals
        length = given.square().sum(dim=1, keepdim=True).sqrt()
        known = (length > 0.5).to(photo.dtype)
        given = given / length.clamp(min=0.5) * known
        levels = [self.first(torch.cat([F.pixel_unshuffle(photo, 2), slope, given, known], dim=1))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop()
        code = self.code(x)
        for rise in self.rise:
            x = rise(x, levels.pop())
        x = self.head(x)
        residual, toward, weight, features = x.split([12, 3, 1, self.num_features], dim=1)
        n = toward.float() + wo  # at the start every point faces the eye
        n = n / n.square().sum(dim=1, keepdim=True).clamp(min=1e-8).sqrt()
        n = torch.where(known > 0, given, n)
        return Told(
            irradiance=(photo[:, :3] + F.pixel_shuffle(residual, 2)) * photo[:, 3:],
            normals=n,
            wo=wo,
            features=features,
            weight=torch.sigmoid(weight.float()) * mask,
            root_alpha=torch.sigmoid(self.alpha(code)),
            code=code,
        )

"""Photo -> the light around its object, in one pass: told, lifted, completed."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.lift import lift, map_pixel, mirror_direction, pyramid
from anyprobe.nets.object_net import ObjectNet, Told
from anyprobe.nets.sphere_net import SphereNet

SCALES = 5
"""Lifted maps of 64, 32, 16, 8 and 4 rows."""
COLORS = 6
"""What is lifted whole: the photo and the irradiance; learned features only from 32 rows on."""
MEAN_LN = -1.2
"""ln radiance before anything is learned: about the mean over indoor and outdoor photos."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Guess:
    """What LightNet says: ln radiance [N, 3, 64, 128], the logit of being close to it [N, 1, 64, 128]."""

    told: Told
    ln_radiance: torch.Tensor
    confidence_logit: torch.Tensor


class LightNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1] -> Guess.

    lifting: False leaves the lifted maps empty, so that all passes through the code.
    """

    def __init__(self, features: int = 8, code: int = 192, lifting: bool = True) -> None:
        super().__init__()
        self.lifting = lifting
        self.object = ObjectNet(features=features, code=code)
        self.sphere = SphereNet(COLORS + 1, COLORS + features + 1, code + 1, 4)

    def forward(self, photo: torch.Tensor, tan_half: torch.Tensor) -> Guess:
        told = self.object(photo, tan_half)
        mask = photo[:, 3:]
        cover = F.avg_pool2d(mask, 2) + 1e-4
        seen = torch.cat(
            [F.avg_pool2d(photo[:, :3], 2) / cover, F.avg_pool2d(told.irradiance, 2) / cover], dim=1
        )
        pixel = map_pixel(mirror_direction(told.normals, told.wo).detach(), MAP_HEIGHT)
        values = torch.cat([seen, told.features], dim=1).float()
        weight = told.weight if self.lifting else torch.zeros_like(told.weight)
        scales = pyramid(lift(values, weight, pixel, MAP_HEIGHT), SCALES)
        scales[0] = torch.cat([scales[0][:, :COLORS], scales[0][:, -1:]], dim=1)
        out = self.sphere(scales, torch.cat([told.code, told.root_alpha], dim=1)).float()
        return Guess(told=told, ln_radiance=out[:, :3] * 2 + MEAN_LN, confidence_logit=out[:, 3:])

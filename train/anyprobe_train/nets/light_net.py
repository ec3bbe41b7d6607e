"""The network that ships: photo -> environment map in one pass.

Object features are extracted from the photo (ObjectNet), lifted to the directions their light came from (nets.lifting)
and completed on the sphere (SphereNet). Radiance is the sum of what a display shows, up to white, and of emitters above
white, as total power and where it comes from (nets.emitter_head).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import MEAN_CURVE
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.scatter.materials import MATERIAL_INPUTS
from anyprobe_train.nets.blocks import FoldedConv, UpBlock, conv, fade_seam, two_layers, wrap
from anyprobe_train.nets.emitter_head import EmitterHead
from anyprobe_train.nets.lifting import (
    CameraRays,
    NormalsNet,
    given_or_estimated,
    lift_to_map,
    map_pixel,
    mirror_direction,
    pyramid,
)

SPHERE_ROWS = 32
"""Rows that SphereNet works at; the map has twice as many."""
_MARGIN = 8
"""Columns repeated beyond the seam, on both sides."""


class SphereNet(nn.Module):
    """Lifted means at 64, 32, 16, 8 and 4 rows, a code and surroundings [N, 4, 64, 128] -> [N, outputs, 64, 128].

    Those at 64 rows have `fine` channels, all others `lifted`. Every scale sees the lifted pixels of its own size, so
    that gaps are filled from coarser ones; the pixels' directions give it up and forward.
    """

    directions: torch.Tensor

    def __init__(
        self, fine: int, lifted: int, code: int, outputs: int, widths: tuple[int, ...] = (24, 48, 96, 128)
    ) -> None:
        super().__init__()
        directions = torch.from_numpy(pixel_directions(SPHERE_ROWS)).permute(2, 0, 1)[None]
        self.register_buffer("directions", wrap(directions, _MARGIN), persistent=False)
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        deepest = SPHERE_ROWS >> len(pairs)
        self.start = nn.Sequential(nn.Linear(code, 48 * deepest * 2 * deepest), nn.LeakyReLU(0.1))
        self.deepest = deepest
        beside = lifted + 4 + 3
        self.first = nn.ModuleList([FoldedConv(fine, beside, widths[0]), conv(widths[0], widths[0])])
        self.down = nn.ModuleList(conv(a, b, stride=2) for a, b in pairs)
        extra_channels = {widths[-1]: 48}
        self.seen = nn.ModuleList(conv(b + lifted + extra_channels.get(b, 0), b) for _, b in pairs)
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 4 * outputs, 3, padding=1)

    def forward(self, scales: list[torch.Tensor], code: torch.Tensor, surroundings: torch.Tensor) -> torch.Tensor:
        fine, *rest = scales
        directions = self.directions.expand(fine.shape[0], -1, -1, -1)
        known = torch.cat([rest[0], F.avg_pool2d(surroundings, 2)], dim=1)
        beside = torch.cat([wrap(known, _MARGIN), directions], dim=1)
        levels = [self.first[1](self.first[0](wrap(fine, 2 * _MARGIN), beside))]
        start = self.start(code).reshape(-1, 48, self.deepest, 2 * self.deepest)
        for depth, (down, seen) in enumerate(zip(self.down, self.seen, strict=True), start=1):
            parts = [down(levels[-1]), wrap(rest[depth], _MARGIN >> depth)]
            if depth == len(self.down):
                parts.append(wrap(start, _MARGIN >> depth))
            levels.append(seen(torch.cat(parts, dim=1)))
        x = levels.pop()
        for up in self.up:
            x = up(x, levels.pop())
        return fade_seam(F.pixel_shuffle(self.head(x), 2), 2 * _MARGIN)


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectFeatures:
    """Output of ObjectNet.

    irradiance [N, 3, 128, 128] display; features [N, F, 64, 64]; weight [N, 1, 64, 64] in [0, 1], zero outside
    the mask; root_alpha [N, 1]; code [N, C].
    """

    irradiance: torch.Tensor
    features: torch.Tensor
    weight: torch.Tensor
    root_alpha: torch.Tensor
    code: torch.Tensor


class ObjectNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), slope [N, 2, 64, 64] of CameraRays, unit normals
    [N, 3, 64, 64] and where they are given [N, 1, 64, 64] rather than estimated; surroundings [N, 4, H, 2H] and
    material [N, 8] (see LightNet) -> ObjectFeatures.

    Two pixels in each direction are folded into channels at once, so that nothing is computed at full size.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128, 192), features: int = 8, code: int = 192) -> None:
        super().__init__()
        self.num_features = features
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        self.first = nn.ModuleList([FoldedConv(4, 2 + 4, widths[0]), conv(widths[0], widths[0])])
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.surroundings = nn.Sequential(nn.AvgPool2d(8), nn.Flatten(), *two_layers(4 * 8 * 16, widths[-1]))
        self.material = two_layers(MATERIAL_INPUTS, widths[-1])
        for parameter in self.material[-1].parameters():  # untrained, a given material changes nothing
            nn.init.zeros_(parameter)
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.alpha = nn.Linear(code, 1)
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 3 * 4 + 1 + features, 3, padding=1)

    def forward(
        self,
        photo: torch.Tensor,
        slope: torch.Tensor,
        normals: torch.Tensor,
        given: torch.Tensor,
        surroundings: torch.Tensor,
        material: torch.Tensor,
    ) -> ObjectFeatures:
        levels = [self.first[1](self.first[0](photo, torch.cat([slope, normals, given], dim=1)))]
        for down in self.down:
            levels.append(down(levels[-1]))
        x = levels.pop() + (self.surroundings(surroundings) + self.material(material))[:, :, None, None]
        code = self.code(x)
        for up in self.up:
            x = up(x, levels.pop())
        residual, weight, features = self.head(x).split([12, 1, self.num_features], dim=1)
        return ObjectFeatures(
            irradiance=(photo[:, :3] + F.pixel_shuffle(residual, 2)) * photo[:, 3:],
            features=features,
            weight=torch.sigmoid(weight.float()) * F.avg_pool2d(photo[:, 3:], 2),
            root_alpha=torch.sigmoid(self.alpha(code)),
            code=code,
        )


SCALES = 5
"""Number of lifted maps, of 64, 32, 16, 8 and 4 rows."""
COLORS = 6
"""Number of channels lifted at full resolution, photo and irradiance; learned features only from 32 rows on."""
MEAN_LN = -1.2
"""ln radiance before training: about the mean over indoor and outdoor photos."""


def display(ln_radiance: torch.Tensor) -> torch.Tensor:
    """Return the mean camera curve of exp(ln_radiance) before it clips: a sigmoid, with a gradient everywhere."""
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    return (1 + sigma) * torch.sigmoid(n * ln_radiance - float(np.log(sigma)))


@dataclass(frozen=True, kw_only=True, slots=True)
class LightPrediction:
    """Output of LightNet.

    normals [N, 3, 64, 64]: unit, camera frame, the given ones, else estimated; wo [N, 3, 64, 64] of CameraRays.
    ln_radiance [N, 3, 64, 128]: with emitters at their most likely positions; ln_expected: mean radiance over all
        positions.
    ln_shown [N, 3, 64, 128]: what is not above white.
    ln_power [N, 3]: ln(power above white + POWER_FLOOR), in sr of white.
    emitter_logit [N, 1, 64, 128]: ln of power per steradian up to a constant.
    confidence_logit [N, 1, 64, 128]: of being close to the true map.
    posterior [N, 7]: of POSTERIOR, what the photo leaves open.
    """

    features: ObjectFeatures
    normals: torch.Tensor
    wo: torch.Tensor
    ln_radiance: torch.Tensor
    ln_expected: torch.Tensor
    ln_shown: torch.Tensor
    ln_power: torch.Tensor
    emitter_logit: torch.Tensor
    confidence_logit: torch.Tensor
    posterior: torch.Tensor


POSTERIOR = ("metal_logit", "ln_red", "ln_green", "ln_blue", "ln_scale", "ln_level", "ln_color")
"""Estimates of the object and of the map's errors: logit of being a metal; ln of the total reflectance, RGB, and of its
mean error; ln of the mean error of the map's level, in ln, and of its mean colour, in tens of degrees."""


class LightNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1] -> LightPrediction.

    Optional inputs: given normals [N, 3, 64, 64], camera frame, zero where not given; surroundings
    [N, 4, 64, 128], display values times coverage, and coverage, of what is seen of the environment map; the object's
    material [N, 8] of materials.material_input, zero where not given.
    """

    def __init__(self, features: int = 8, code: int = 192) -> None:
        super().__init__()
        self.camera_rays = CameraRays()
        self.normals = NormalsNet()
        self.object = ObjectNet(features=features, code=code)
        self.sphere = SphereNet(COLORS + 1, COLORS + features + 1, code + 1, outputs=5)
        self.emitters = EmitterHead(code + 1)
        self.posterior = two_layers(code + 1, len(POSTERIOR))

    def forward(
        self,
        photo: torch.Tensor,
        tan_half: torch.Tensor,
        given_normals: torch.Tensor | None = None,
        surroundings: torch.Tensor | None = None,
        material: torch.Tensor | None = None,
    ) -> LightPrediction:
        if material is None:
            material = photo.new_zeros(len(photo), MATERIAL_INPUTS)
        if surroundings is None:
            surroundings = photo.new_zeros(len(photo), 4, MAP_HEIGHT, 2 * MAP_HEIGHT)
        slope, wo = self.camera_rays(tan_half)
        normals, given = given_or_estimated(given_normals, self.normals(photo, slope, wo))
        features = self.object(photo, slope, normals, given, surroundings, material)
        code = torch.cat([features.code, features.root_alpha], dim=1)
        out = self.sphere(self._lifted(photo, features, normals, wo), code, surroundings).float()
        ln_shown, ln_power, logit = out[:, :3] * 2 + MEAN_LN, self.emitters(code), out[:, 4:] * 4
        shown, fixed = torch.exp(ln_shown.clamp(max=0.0)), logit.detach()
        return LightPrediction(
            features=features,
            normals=normals,
            wo=wo,
            ln_radiance=torch.log(shown + self.emitters.mode(ln_power, fixed)),
            ln_expected=torch.log(shown + self.emitters.expected(ln_power, fixed)),
            ln_shown=ln_shown,
            ln_power=ln_power,
            emitter_logit=logit,
            confidence_logit=out[:, 3:4],
            posterior=self.posterior(code).float(),
        )

    def _lifted(
        self, photo: torch.Tensor, features: ObjectFeatures, normals: torch.Tensor, wo: torch.Tensor
    ) -> list[torch.Tensor]:
        """Lift photo, irradiance and features to their mirror directions, at SCALES scales."""
        cover = F.avg_pool2d(photo[:, 3:], 2) + 1e-4
        seen = [F.avg_pool2d(photo[:, :3], 2) / cover, F.avg_pool2d(features.irradiance, 2) / cover]
        pixel = map_pixel(mirror_direction(normals, wo).detach(), MAP_HEIGHT)
        values = torch.cat([torch.cat(seen, dim=1), features.features], dim=1).float()
        scales = pyramid(lift_to_map(values, features.weight, pixel, MAP_HEIGHT), SCALES)
        scales[0] = torch.cat([scales[0][:, :COLORS], scales[0][:, -1:]], dim=1)
        return scales

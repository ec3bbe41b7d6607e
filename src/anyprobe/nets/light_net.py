"""Photo -> the light around its object, in one pass: told, lifted, completed, lit.

Radiance is a sum of two: what a display shows, up to white, pixel by pixel; and what is
brighter than white, as a flux and where it comes from (nets.lamps).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets import tones
from anyprobe.nets.eye import Eye
from anyprobe.nets.lamps import FLUX_FLOOR, Lamps
from anyprobe.nets.lift import lift, map_pixel, mirror_direction, pyramid
from anyprobe.nets.normals_net import NormalsNet, told_or_guessed
from anyprobe.nets.object_net import ObjectNet, Told
from anyprobe.nets.queries import TOKENS, Queries
from anyprobe.nets.sphere_net import SphereNet

SCALES = 5
"""Lifted maps of 64, 32, 16, 8 and 4 rows."""
COLORS = 6
"""What is lifted whole: the photo and the irradiance; learned features only from 32 rows on."""
ASKED = 48
"""Numbers that each direction that asked is told."""
MEAN_LN = -1.2
"""ln radiance before anything is learned: about the mean over indoor and outdoor photos."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Guess:
    """What LightNet says.

    normals [N, 3, 64, 64]: unit, camera frame, those that were told, else those guessed; wo [N, 3, 64, 64] of Eye.
    ln_radiance [N, 3, 64, 128]: the whole, its lamps drawn; ln_expected: the mean over all that they may be.
    ln_shown [N, 3, 64, 128]: what is not above white.
    ln_flux [N, 3]: ln(flux above white + FLUX_FLOOR), in sr of white.
    lamp_logit [N, 1, 64, 128]: where it comes from, ln of flux a steradian but for a constant.
    confidence_logit [N, 1, 64, 128]: of being close to the true map.
    tones [N, 6, 64, 128]: Reinhard's and the logarithm's maps of a network that has these in the place of lamps.
    """

    told: Told
    normals: torch.Tensor
    wo: torch.Tensor
    ln_radiance: torch.Tensor
    ln_expected: torch.Tensor
    ln_shown: torch.Tensor
    ln_flux: torch.Tensor
    lamp_logit: torch.Tensor
    confidence_logit: torch.Tensor
    tones: torch.Tensor | None = None


class LightNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask), tan_half [N, 1], normals [N, 3, 64, 64] -> Guess.

    normals: those that somebody knows (a tracked model, a depth camera), camera frame; zero where they are not
    known, by default everywhere.
    lifting: False leaves the lifted maps empty, so that all passes through the code.
    queries, dual: ideas that were tried (nets.queries, nets.tones; docs/ablation.md).
    """

    def __init__(
        self,
        features: int = 8,
        code: int = 192,
        lifting: bool = True,
        queries: bool = False,
        dual: bool = False,
    ) -> None:
        super().__init__()
        self.lifting, self.dual = lifting, dual
        self.eye = Eye()
        self.normals = NormalsNet()
        self.object = ObjectNet(features=features, code=code)
        self.queries = Queries(self.object.num_tokens, code + 1, ASKED) if queries else None
        outputs, asked = 7 if dual else 5, ASKED if queries else 0
        self.sphere = SphereNet(COLORS + 1, COLORS + features + 1, code + 1, outputs, asked=asked)
        self.lamps = Lamps(code + 1)

    def forward(
        self,
        photo: torch.Tensor,
        tan_half: torch.Tensor,
        normals: torch.Tensor | None = None,
        around: torch.Tensor | None = None,
    ) -> Guess:
        if around is None:
            around = photo.new_zeros(len(photo), 4, MAP_HEIGHT, 2 * MAP_HEIGHT)
        slope, wo = self.eye(tan_half)
        normals, known = told_or_guessed(normals, self.normals(photo, slope, wo))
        told = self.object(photo, slope, normals, known, around)
        mask = photo[:, 3:]
        cover = F.avg_pool2d(mask, 2) + 1e-4
        seen = torch.cat(
            [F.avg_pool2d(photo[:, :3], 2) / cover, F.avg_pool2d(told.irradiance, 2) / cover], dim=1
        )
        mirror = mirror_direction(normals, wo).detach()
        pixel = map_pixel(mirror, MAP_HEIGHT)
        values = torch.cat([seen, told.features], dim=1).float()
        weight = told.weight if self.lifting else torch.zeros_like(told.weight)
        scales = pyramid(lift(values, weight, pixel, MAP_HEIGHT), SCALES)
        scales[0] = torch.cat([scales[0][:, :COLORS], scales[0][:, -1:]], dim=1)
        code = torch.cat([told.code, told.root_alpha], dim=1)
        asked = None
        if self.queries is not None:
            step = mirror.shape[2] // TOKENS
            toward = F.normalize(F.avg_pool2d(mirror * cover, step), dim=1, eps=1e-4)
            asked = self.queries(told.tokens, toward, F.avg_pool2d(cover, step), code)
        out = self.sphere(scales, code, around, asked).float()
        if self.dual:
            return self._merged(out, told, normals, wo)
        ln_shown, ln_flux, lamp_logit = out[:, :3] * 2 + MEAN_LN, self.lamps(code), out[:, 4:] * 4
        shown, fixed = torch.exp(ln_shown.clamp(max=0.0)), lamp_logit.detach()
        return Guess(
            told=told,
            normals=normals,
            wo=wo,
            ln_radiance=torch.log(shown + self.lamps.drawn(ln_flux, fixed)),
            ln_expected=torch.log(shown + self.lamps.expected(ln_flux, fixed)),
            ln_shown=ln_shown,
            ln_flux=ln_flux,
            lamp_logit=lamp_logit,
            confidence_logit=out[:, 3:4],
        )

    def _merged(self, out: torch.Tensor, told: Told, normals: torch.Tensor, wo: torch.Tensor) -> Guess:
        """What two tone-mapped maps and a confidence say."""
        # at the start the tones of exp(MEAN_LN)
        maps = torch.sigmoid(torch.cat([out[:, :3] * 2 - 1.2, out[:, 4:] * 2 - 3.5], dim=1))
        radiance = tones.merge(*maps.split(3, dim=1))
        ln = torch.log(radiance + 1e-4)
        flux = ((radiance - 1).clamp(min=0.0) * self.lamps.solid_angles).sum(dim=(2, 3))
        return Guess(
            told=told,
            normals=normals,
            wo=wo,
            ln_radiance=ln,
            ln_expected=ln,
            ln_shown=ln,
            ln_flux=torch.log(flux + FLUX_FLOOR),
            lamp_logit=ln.mean(dim=1, keepdim=True),
            confidence_logit=out[:, 3:4],
            tones=maps,
        )

"""The whole photo: the map of the object alone, and what lies around it, made into one map with light sources.

LightNet (nets.light_net) sees the object. What it answers is completed here by what stands beside the object in the
photo: the ground with the object's shadow, the horizon, what is behind it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import MEAN_CURVE
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.nets.blocks import UpBlock, conv, fade_seam, wrap
from anyprobe_train.nets.context_net import CODE, ContextNet
from anyprobe_train.nets.emitter_head import POWER_FLOOR, EmitterHead, likelihood
from anyprobe_train.nets.light_net import SPHERE_ROWS
from anyprobe_train.nets.source_head import LIKELY, SourceHead, SourceMap

SEAM = 8
"""Columns repeated beyond the seam, on both sides."""
SAID = 7
"""Length of LightNet's posterior: the object's material, and errors of its level and colour."""
DROPPED = 0.25
"""Share of the codes' numbers that a step of training goes without."""
LN_FLOOR = 0.01
"""Added to radiance before its logarithm."""
SEEN_ROWS = 16
"""Rows at which the nearest seen place is looked for."""
NEAREST = 300.0
"""Sharpness of the nearest seen place: places a few degrees further count less than half."""
SEEN_COVER, UNSEEN = 0.05, 1e4
"""Cover from which on a place counts as seen, and what others lose of the logarithm of their weight."""
GOES_ON = -2.0
"""Initial logit of the share by which a direction beside the photo looks like the nearest seen place."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WholePrediction:
    """ln_shown [N, 3, 64, 128]: ln radiance up to white; ln_power [N, 3]: of ln(power above white + POWER_FLOOR);
    logit [N, 1, 64, 128]: ln of that power's density; ln_expected, ln_radiance [N, 3, 64, 128]: all power
    where it is likely, the same with that of sources in their places; places [N, S, 3], profiles [N, S, R], powers
    [N, S, R] and colors [N, S, 3] of the sources (nets.source_head); posture [N, 4] (nets.context_net);
    confidence_logit [N, 1, 64, 128]; ln_context [N, P]: what the context says alone of where light comes from."""

    ln_shown: torch.Tensor
    ln_power: torch.Tensor
    logit: torch.Tensor
    ln_expected: torch.Tensor
    ln_radiance: torch.Tensor
    places: torch.Tensor
    profiles: torch.Tensor
    powers: torch.Tensor
    colors: torch.Tensor
    posture: torch.Tensor
    confidence_logit: torch.Tensor
    ln_context: torch.Tensor


def inverse_display(display: torch.Tensor) -> torch.Tensor:
    """Return the radiance up to white that display values mean by the mean camera curve."""
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    ratio = (display.clamp(0.0, 1.0) / (1 + sigma)).clamp(min=1e-6)
    return torch.exp(torch.log(ratio * sigma / (1 - ratio)) / n).clamp(max=1.0)


class WholeNet(nn.Module):
    """context [N, 5, 96, 96], tan_half [N, 1], LightNet's answer lift [N, 7, 64, 128] (ln radiance expected and with
    light sources, confidence) and said [N, SAID], surroundings [N, 4, 64, 128], up [N, 3] in the crop's frame or zero
    where it is not known -> WholePrediction."""

    directions: torch.Tensor
    seen_directions: torch.Tensor

    def __init__(self, widths: tuple[int, ...] = (32, 48, 80, 96)) -> None:
        super().__init__()
        self.context = ContextNet()
        pairs = list(zip(widths[:-1], widths[1:], strict=True))
        directions = torch.from_numpy(pixel_directions(SPHERE_ROWS)).permute(2, 0, 1)[None].float()
        self.register_buffer("directions", directions.contiguous(), persistent=False)
        seen = torch.from_numpy(pixel_directions(SEEN_ROWS)).reshape(-1, 3).float()
        self.register_buffer("seen_directions", seen.contiguous(), persistent=False)
        self.first = nn.Sequential(conv(4 * 10 + 3 + 2 + 5, widths[0]), conv(widths[0], widths[0]))
        self.down = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), conv(b, b)) for a, b in pairs)
        self.deepest = SPHERE_ROWS >> len(pairs)
        self.start = nn.Sequential(nn.Linear(CODE + SAID, 32 * 2 * self.deepest**2), nn.LeakyReLU(0.1))
        self.middle = conv(widths[-1] + 32, widths[-1])
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 2 * self.deepest**2, CODE), nn.LeakyReLU(0.1))
        self.up = nn.ModuleList(UpBlock(b, a) for a, b in reversed(pairs))
        self.head = nn.Conv2d(widths[0], 4 * 6, 3, padding=1)
        code = 2 * CODE + SAID
        self.emitters, self.sources, self.source_map = EmitterHead(code), SourceHead(code), SourceMap()
        with torch.no_grad():
            self.head.weight.mul_(0.1)
            nn.init.zeros_(self.head.bias)  # type: ignore[arg-type]
            for parameter in self.emitters.power[2].parameters():  # untrained, it stays as the object alone says
                parameter.mul_(0.1)

    def forward(
        self,
        context: torch.Tensor,
        tan_half: torch.Tensor,
        lift: torch.Tensor,
        said: torch.Tensor,
        surroundings: torch.Tensor,
        up: torch.Tensor,
    ) -> WholePrediction:
        around, posture = self.context(context, tan_half)
        around = F.dropout(around, DROPPED, self.training)
        said = torch.cat([said[:, :6], said[:, 6:] / 10.0], dim=1)
        expected, drawn = torch.exp(lift[:, :3]), torch.exp(lift[:, 3:6])
        shown0, above0 = expected.clamp(max=1.0), (expected - 1.0).clamp(min=0.0)
        with torch.autocast(context.device.type, enabled=False):  # a cosine of eight bits is degrees off
            near = self._nearest(surroundings)
            x = self._sphere(shown0, expected, drawn, lift[:, 6:], surroundings, near, posture, up)
        features = [self.first(x)]
        for down in self.down:
            features.append(down(features[-1]))
        x = features.pop()
        grid = self.start(torch.cat([around, said], dim=1)).unflatten(1, (32, self.deepest, 2 * self.deepest))
        middle = (SEAM >> len(self.down)) or 1
        x = self.middle(torch.cat([x, wrap(grid.to(x.dtype), middle)], dim=1))
        seen = F.dropout(self.code(x[..., middle:-middle]).float(), DROPPED, self.training)
        code = torch.cat([seen, around, said], dim=1)
        for block in self.up:
            x = block(x, features.pop())
        out = F.pixel_shuffle(fade_seam(self.head(x), SEAM), 2).float()
        with torch.autocast(context.device.type, enabled=False):
            present = (context[:, 4:].amax(dim=(2, 3)) > 0).float()
            return self._drawn(out, code, shown0, above0, present, posture, near)

    def _drawn(self, out, code, shown0, above0, present, posture, near) -> WholePrediction:
        """Draw map and sources from the head's channels [N, 6, 64, 128] and the code; near: of _nearest."""
        goes_on = torch.sigmoid(out[:, 5:6] + GOES_ON) * F.interpolate(near[:, 4:], scale_factor=2.0)
        seen = inverse_display(F.interpolate(near[:, :3], scale_factor=2.0, mode="bilinear", align_corners=False))
        ln_shown = torch.log((1 - goes_on) * torch.exp(torch.log(shown0 + LN_FLOOR) + out[:, :3]) + goes_on * seen)
        bright = torch.einsum("c,nchw->nhw", self.source_map.luminance, above0)[:, None]
        ln_context = self.sources.ln_density(code, present, self.source_map.directions)
        grain = ln_context.unflatten(1, (MAP_HEIGHT, 2 * MAP_HEIGHT))[:, None]
        logit = torch.log(bright + LN_FLOOR) + 4.0 * out[:, 3:4] + grain
        power0 = (above0 * self.emitters.solid_angles).sum(dim=(2, 3))
        ln_power = torch.log(power0 + POWER_FLOOR) + self.emitters(code)
        shown = torch.exp(ln_shown.clamp(max=0.0))
        places, profiles = self.sources.places(self.emitters, logit.detach()), self.sources.profiles(code)
        spread = self.emitters.density(LIKELY * torch.log(likelihood(logit)))
        above = self.emitters.above(ln_power)
        tints = self.sources.tints(code)
        _, whole, powers = self.source_map(shown, above, spread, places, profiles, tints)
        return WholePrediction(
            ln_shown=ln_shown,
            ln_power=ln_power,
            logit=logit,
            ln_expected=torch.log(shown + above[:, :, None, None] * self.emitters.density(logit)),
            ln_radiance=torch.log(whole),
            places=places,
            profiles=profiles,
            powers=powers,
            colors=self.source_map.colors(above, tints),
            posture=posture,
            confidence_logit=out[:, 4:5],
            ln_context=ln_context,
        )

    def _nearest(self, surroundings: torch.Tensor) -> torch.Tensor:
        """Return the nearest seen place of every direction, [N, 5, 32, 64]: its display RGB, the angle to it over pi,
        and whether anything is seen at all; zero where nothing is."""
        coarse = F.avg_pool2d(surroundings, MAP_HEIGHT // SEEN_ROWS).flatten(2).float()  # [N, 4, P]
        cover = coarse[:, 3]
        colors = coarse[:, :3] / cover[:, None].clamp(min=SEEN_COVER)
        hidden = -UNSEEN * (cover < SEEN_COVER).float()
        weight = torch.log(cover.clamp(min=SEEN_COVER)) + hidden
        d = self.seen_directions.T.expand(len(cover), -1, -1)  # [N, 3, P]
        ones = torch.ones_like(self.seen_directions[:, :1])
        # a product with an input: exports fold it into no constant
        asked = torch.cat([self.seen_directions, ones], dim=1)
        share = torch.softmax(asked @ torch.cat([NEAREST * d, weight[:, None]], dim=1), dim=2)  # [N, P, P]
        seen, toward = torch.einsum("nqp,ncp->ncq", share, torch.cat([colors, d], dim=1)).split([3, 3], dim=1)
        nearest = (toward * d).sum(dim=1).clamp(-1 + 1e-6, 1 - 1e-6)
        near = torch.cat([seen, (torch.acos(nearest) / torch.pi)[:, None]], dim=1)
        near = near.unflatten(2, (SEEN_ROWS, 2 * SEEN_ROWS))
        near = F.interpolate(wrap(near, 1), scale_factor=2.0, mode="bilinear", align_corners=False)[..., 2:-2]
        some = (cover.amax(dim=1) >= SEEN_COVER).float()[:, None, None, None].expand_as(near[:, :1])
        return torch.cat([near * some, some], dim=1)

    def _sphere(self, shown, expected, drawn, confidence, surroundings, near, posture, up) -> torch.Tensor:
        """Return the map's pixels [N, C, 32, 64 and margins]: what is known in each direction."""
        pitch, _, roll, stands = posture.detach().float().unbind(dim=1)
        guess = torch.stack([pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), pitch.sin()], dim=1)
        given = (up.square().sum(dim=1, keepdim=True) > 0.5).float()
        upright = given * up + (1 - given) * guess
        rise = torch.einsum("nc,kchw->nhw", upright, self.directions)[:, None]
        stands = torch.sigmoid(stands)[:, None, None, None].expand_as(rise)
        bright = [torch.log1p(one.mean(dim=1, keepdim=True)) / 2 for one in (expected, drawn)]
        x = F.pixel_unshuffle(torch.cat([shown.sqrt(), *bright, confidence, surroundings], dim=1), 2)
        x = torch.cat([x, self.directions.expand(len(x), -1, -1, -1), rise, stands, near], dim=1)
        return wrap(x, SEAM)

"""Light sources, soft to hard: where the context says that light comes from, and how much each of a few sources sends
from within how many degrees.

The brightest places of a map are its sources: the greatest power within PLACE_DEG, then the greatest outside APART_DEG
of the first, and so on. A source is described by its profile: shares of the map's total power within RADII_DEG of its
place, from nearly none (overcast: no source) to most of it (a sun). Power above white that no source takes is spread
over all directions, in proportion to a power of their likelihood.
"""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.light_sources import MOST_SOURCES
from anyprobe_train.nets.blocks import two_layers
from anyprobe_train.nets.emitter_head import LEAST, EmitterHead, likelihood

RADII_DEG = (4.0, 8.0, 16.0, 32.0)
"""Radii of the discs in which a source's power is given; the smallest always covers a pixel's centre."""
DRAWN = 2
"""Discs that are drawn, the smallest first: wider light is spread by its likelihood."""
LIKELY = 2.0
"""Exponent of that likelihood. DRAWN and LIKELY were chosen on left-out whole photos: with all discs drawn and an
exponent of 1, maps have more places that are white though they should not be."""
SOURCES = MOST_SOURCES
PLACE_DEG, APART_DEG = 8.0, 16.0
COMPONENTS = 4
"""Components of the mixture on the sphere by which the context changes the density of light."""
EDGE_DEG = 3.0
"""Width of the soft edge of a disc that is drawn, all of it inside."""
MOST_TINT = 1.5
"""Bound of ln of a source's colour over that of all light above white."""
LEAST_SR = 1e-5
"""Least solid angle of a ring, against division by zero."""
SHARPEST = 10.0
"""Factor of a component's concentration, so that a trained one can be sharp."""
LEAST_DENSITY = 1e-3
"""Least density of the mixture, in shares of an even one: no direction is ruled out."""


class SourceHead(nn.Module):
    """The code of object and context [N, C] -> profiles [N, SOURCES, len(RADII_DEG)] and a mixture's parameters."""

    def __init__(self, code: int) -> None:
        super().__init__()
        self.profile = two_layers(code, SOURCES * len(RADII_DEG), 128)
        self.direction = two_layers(code, 4 * COMPONENTS, 128)
        self.color = two_layers(code, SOURCES * 3)
        with torch.no_grad():  # untrained, every direction is as likely as before, and every source as all light is
            for last in (self.color[2], self.direction[2]):
                last.get_parameter("weight").mul_(0.1)
                last.get_parameter("bias").zero_()
            self.profile[2].get_parameter("bias").copy_(
                torch.tensor([1.5, 1.5, 1.0, -1.0]).flip(0).repeat(SOURCES) - 0.3
            )

    def profiles(self, code: torch.Tensor) -> torch.Tensor:
        """Shares of the map's total power, growing with the radius."""
        logit = self.profile(code).float().reshape(-1, SOURCES, len(RADII_DEG))
        # the widest disc first, then of each the part in the next smaller one
        return torch.exp(torch.cumsum(F.logsigmoid(logit), dim=2)).flip(2)

    def tints(self, code: torch.Tensor) -> torch.Tensor:
        """Return ln of what the sources' colours are multiplied by, [N, SOURCES, 3]."""
        return MOST_TINT * torch.tanh(self.color(code).float().unflatten(1, (SOURCES, 3)))

    def ln_density(self, code: torch.Tensor, present: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
        """ln of a mixture of von Mises-Fisher distributions in shares of an even one, [N, P]; zero where present [N, 1]
        is zero.

        directions: unit, [P, 3].
        """
        numbers = self.direction(code).float().unflatten(1, (COMPONENTS, 4))
        vector, weight = SHARPEST * numbers[..., :3] * present[:, :, None], torch.log_softmax(numbers[..., 3], dim=1)
        kappa = vector.square().sum(dim=2).clamp(min=1e-6).sqrt()  # [N, K]
        # of an even one: kappa / sinh(kappa) exp(kappa cos)
        ln_constant = torch.log(2.0 * kappa) - kappa - torch.log1p(-torch.exp(-2.0 * kappa) + 1e-9)
        ln = torch.einsum("nkc,pc->nkp", vector, directions) + (ln_constant + weight)[:, :, None]
        return torch.log(torch.exp(torch.logsumexp(ln, dim=1).clamp(max=30.0)) * (1 - LEAST_DENSITY) + LEAST_DENSITY)

    def places(self, emitters: EmitterHead, logit: torch.Tensor) -> torch.Tensor:
        """Directions [N, SOURCES, 3] nearest to all that is likely, the next to what is left far from those before.

        logit: [N, 1, 64, 128], ln of power per steradian up to a constant.
        """
        left = likelihood(logit) * emitters.solid_angles
        places = []
        for _ in range(SOURCES):
            place = emitters.likeliest(left / left.sum(dim=(2, 3), keepdim=True))  # [N, 3, 1, 1]
            places.append(place[:, :, 0, 0])
            cosine = (emitters.directions * place).sum(dim=1, keepdim=True).clamp(-1.0, 1.0)
            left = left * (1.0 - cosine) / 2.0 + LEAST * left.amax(dim=(2, 3), keepdim=True)
        return torch.stack(places, dim=1)


class SourceMap(nn.Module):
    """Draws a map of its parts: what a display shows, sources of their profiles at their places, and the rest of the
    power above white as likely as it is."""

    directions: torch.Tensor
    solid_angles: torch.Tensor
    luminance: torch.Tensor

    def __init__(self, height: int = MAP_HEIGHT) -> None:
        super().__init__()
        d = torch.from_numpy(pixel_directions(height)).reshape(-1, 3)
        angles = torch.from_numpy(pixel_solid_angles(height)).expand(-1, 2 * height).reshape(-1)
        self.register_buffer("directions", d, persistent=False)
        self.register_buffer("solid_angles", angles, persistent=False)
        self.register_buffer("luminance", torch.tensor(REC709), persistent=False)

    def rings(self, places: torch.Tensor) -> torch.Tensor:
        """Return how much of each pixel lies in the disc of RADII_DEG[0] around each place [N, S, 3], and in the rings
        up to each further radius, [N, S, R, P]; their edges are soft."""
        cosine = (places @ self.directions.T).clamp(-1 + 1e-6, 1 - 1e-6)
        degrees = torch.acos(cosine) * (180.0 / math.pi)
        discs = [((r - degrees) / EDGE_DEG).clamp(0.0, 1.0) for r in RADII_DEG]
        return torch.stack([discs[0], *(b - a for a, b in zip(discs, discs[1:], strict=False))], dim=2)

    def powers(self, profiles: torch.Tensor, rings: torch.Tensor, shown: torch.Tensor, above: torch.Tensor):
        """Return the luminance [N, S, R] that each disc and ring sends beyond what is shown there: the profile's
        share of all power, in total no more than the power above white.

        shown: radiance [N, 3, P]; above: power above white [N, 3].
        """
        bright = torch.einsum("c,ncp->np", self.luminance, shown) * self.solid_angles
        total = bright.sum(dim=1) + above @ self.luminance
        there = torch.cumsum(torch.einsum("nsrp,np->nsr", rings, bright), dim=2)
        beyond = (profiles * total[:, None, None] - there).clamp(min=0.0)
        size = (rings @ self.solid_angles).clamp(min=LEAST_SR)  # [N, S, R]
        power = torch.cat([beyond[..., :1], (beyond[..., 1:] - beyond[..., :-1]).clamp(min=0.0)], dim=2)
        density = power / size
        falling: list[torch.Tensor] = []
        for r in range(len(RADII_DEG)):  # no ring brighter than what it surrounds
            falling.append(density[..., r] if r == 0 else torch.minimum(density[..., r], falling[-1]))
        falling[DRAWN:] = [torch.zeros_like(one) for one in falling[DRAWN:]]
        power = torch.stack(falling, dim=2) * size
        # the smallest discs first, of these the brightest source's, until there is no more
        inward = power.transpose(1, 2).flatten(1)
        before = torch.cumsum(inward, dim=1) - inward
        left = ((above @ self.luminance)[:, None] - before).clamp(min=0.0)
        return torch.minimum(inward, left).unflatten(1, (len(RADII_DEG), SOURCES)).transpose(1, 2)

    def colors(self, above: torch.Tensor, tints: torch.Tensor) -> torch.Tensor:
        """Return colours of luminance 1 [N, S, 3]: that of all power above white [N, 3] times exp(tints [N, S, 3])."""
        tinted = above[:, None].clamp(min=1e-9) * torch.exp(tints)
        return tinted / (tinted @ self.luminance)[..., None].clamp(min=1e-9)

    def forward(self, shown: torch.Tensor, above: torch.Tensor, spread: torch.Tensor, places, profiles, tints):
        """Radiance without the sources [N, 3, H, 2H], the whole of it, and the sources' powers [N, S, R] in luminance.

        shown: [N, 3, H, 2H]; above: power above white [N, 3]; spread: density over directions [N, 1, H, 2H] of the part
            of it that no source has;
        places [N, S, 3]; profiles [N, S, R]; tints [N, S, 3] of SourceHead.tints.
        """
        rings = self.rings(places)
        power = self.powers(profiles, rings, shown.flatten(2), above)
        density = power / (rings @ self.solid_angles).clamp(min=LEAST_SR)
        colors = self.colors(above, tints)
        colored = density[..., None] * colors[:, :, None]  # [N, S, R, 3]
        drawn = torch.einsum("nsrc,nsrp->ncp", colored, rings).unflatten(2, shown.shape[2:])
        # what no source has keeps the hue of all power: a complement of the sources' hues would be a green halo
        bright = (above @ self.luminance)[:, None]
        rest = above * (1.0 - power.sum(dim=(1, 2))[:, None] / bright.clamp(min=1e-9)).clamp(min=0.0)
        soft = shown + rest[:, :, None, None] * spread
        return soft, soft + drawn, power

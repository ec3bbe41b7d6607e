"""A map completed by what is seen of it, for weights that only guess what lies beside; it goes with the next ones.

Maps are [3, H, 2H] of linear radiance, surroundings [5, H, 2H] of front.Front.seen, all in one frame.
"""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import CLIPPED, inverse_response, response
from anyprobe.estimate.light_graph import SEEN_CONFIDENCE
from anyprobe.light.environment import MAP_HEIGHT

TINT, TINT_FLOOR = 0.5, 0.05
"""Share of the colour by which what is seen differs from the guess there that is the light's own."""
ROWS = 32
KNOWN_FROM, SHARE, REACH_DEG = 0.5, 0.5, 60.0
"""Cover from which on a place counts as seen, the share of a guess that the nearest seen colour replaces beside it, and
the angle over which that falls to 1/e."""
THIN = 1e-3


def bright(radiance: torch.Tensor) -> torch.Tensor:
    """Return the luminance [H, 2H] of a map."""
    return torch.einsum("c,chw->hw", torch.tensor(REC709), radiance)


def radiance_of(seen: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Decode surroundings to radiance [3, H, 2H], where it is clipped and may be more, 0 or 1, and cover [1, H, 2H]."""
    cover = seen[3:4]
    display = seen[:3] / cover.clamp(min=THIN)
    clipped = (display >= CLIPPED) & (seen[4:5] < 0.5 * cover)
    return torch.where(display > 1.0, display, inverse_response(display)), clipped, cover


class KnownParts(nn.Module):
    """Puts what is seen in the place of a guess, and lets the guess follow it."""

    directions: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        d = torch.from_numpy(pixel_directions(ROWS)).float().reshape(-1, 3)
        self.register_buffer("directions", d, persistent=False)

    def forward(
        self, guess: torch.Tensor, confidence: torch.Tensor, seen: torch.Tensor, has_material: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the map and its confidence [H, 2H]; has_material: 1 where the object's is given, so that the guess
        keeps its own colour."""
        shown, clipped, cover = radiance_of(seen)
        tinted = guess * (own_color(guess, shown, cover) * (1.0 - has_material) + has_material)
        guessed = self.continued(tinted, seen)
        known = brightened(shown, clipped, guessed)
        return guessed + cover * (known - guessed), confidence + cover[0] * (SEEN_CONFIDENCE - confidence)

    def continued(self, guess: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Return a guess that goes on from what is seen: more so the nearer it is; light above white stays."""
        coarse = F.avg_pool2d(seen[None, :4], MAP_HEIGHT // ROWS)[0].flatten(1)  # [4, P]
        there = (coarse[3] >= KNOWN_FROM).float()
        # one product with an input: exports fold it into no constant
        asked = torch.cat([self.directions, torch.ones_like(self.directions[:, :1])], dim=1)
        cosine = asked @ torch.cat([self.directions.T, 4.0 * (there - 1.0)[None]])
        best, which = cosine.max(dim=1)
        colors = (coarse[:3] / coarse[3:].clamp(min=THIN)).clamp(max=1.0)[:, which]
        degrees = torch.acos(best.clamp(-1.0, 1.0)) * (180.0 / math.pi)
        found = torch.cat([colors, degrees[None]]).unflatten(1, (ROWS, 2 * ROWS))
        found = F.interpolate(wrapped(found)[None], scale_factor=2.0, mode="bilinear", align_corners=False)[0]
        found = found[..., 2:-2]
        share = SHARE * torch.exp(-found[3:] / REACH_DEG) * there.amax()
        shown = guess.clamp(max=1.0)
        display = response(shown)
        return inverse_response(display + share * (found[:3] - display)) + (guess - shown)


def wrapped(values: torch.Tensor) -> torch.Tensor:
    """Repeat a column of a map beyond its seam, on both sides."""
    return torch.cat([values[..., -1:], values, values[..., :1]], dim=-1)


def brightened(shown: torch.Tensor, clipped: torch.Tensor, guessed: torch.Tensor) -> torch.Tensor:
    """Return the seen radiance; where it is clipped, as bright as a brighter guess, with its own hue."""
    white = float(inverse_response(torch.tensor([CLIPPED])))
    room = torch.where(clipped, torch.full_like(shown, 1e9), white / shown.clamp(min=1e-6)).amin(dim=0)
    asked = bright(guessed) / bright(shown).clamp(min=1e-6)
    gain = torch.minimum(asked.clamp(min=1.0), room.clamp(min=1.0))
    return torch.where(clipped.any(dim=0), shown * gain, shown)


def own_color(guessed: torch.Tensor, seen: torch.Tensor, cover: torch.Tensor) -> torch.Tensor:
    """Return shares [3, 1, 1] of geometric mean 1 that bring the guess' colour nearer to that of what is seen."""
    weight = cover * (cover > 0.5)
    missed = torch.log(seen.clamp(max=1.0) + TINT_FLOOR) - torch.log(guessed.clamp(max=1.0) + TINT_FLOOR)
    mean = (weight * missed).sum(dim=(1, 2), keepdim=True) / weight.sum().clamp(min=1e-9)
    return torch.exp(TINT * (mean - mean.mean()))

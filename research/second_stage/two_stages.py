"""Photo -> light in two stages: a first that sees the object, a second that never sees more than its points.

Either is trained without the other, so that a second stage is swapped in behind a frozen first one.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.emitter_head import EmitterHead
from anyprobe.nets.lifting import given_or_estimated
from anyprobe.nets.light_net import LightNet
from research.second_stage.net import FINE, SIZE, SecondGuess, SecondStage, grown

INPUTS = ("photo", "tan_half", "given_normals", "surroundings", "given_material")
OUTPUTS = ("irradiance", "ln_radiance", "confidence", "normals", "ln_expected", "numbers")
"""numbers [N, 15]: ln of the sphere's mean luminance, ln R/G and ln B/G of its total power, the ln standard deviations
of the first and of each of the other two, probability of a metal, f0, albedo, root alpha, ln standard deviation of f0
and albedo, and whether the material was given."""


class TwoStages(nn.Module):
    """Inputs and outputs in the order of INPUTS and OUTPUTS.

    photo [N, 4, 128, 128], tan_half [N, 1], given_normals [N, 3, 64, 64] and surroundings [N, 4, 64, 128] of LightNet;
    given_material [N, 8]: 1, f0, albedo, root alpha, or zeros.
    """

    def __init__(self, first: LightNet, second: SecondStage) -> None:
        super().__init__()
        self.camera_rays, self.normals, self.object = first.camera_rays, first.normals, first.object
        self.second, self.emitters = second, EmitterHead(1)

    def forward(
        self,
        photo: torch.Tensor,
        tan_half: torch.Tensor,
        given_normals: torch.Tensor,
        surroundings: torch.Tensor,
        given_material: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        slope, wo = self.camera_rays(tan_half)
        normals, known = given_or_estimated(given_normals, self.normals(photo, slope, wo))
        seen = self.object(photo, slope, normals, known, surroundings)
        guess = self.second(*points(photo, normals, known, tan_half, seen.root_alpha, given_material), surroundings)
        shown, drawn, expected = light_of(guess, self.emitters)
        colour = torch.cat([guess.ln_power, guess.chroma, guess.ln_spread[:, 1:]], dim=1)
        material = torch.cat([torch.sigmoid(guess.material[:, :1]), guess.material[:, 1:]], dim=1)
        numbers = torch.cat([colour, material, guess.material_ln_spread, given_material[:, :1]], dim=1)
        confidence = torch.sigmoid(grown(guess.confidence_logit, 2))
        return (seen.irradiance, torch.log(shown + drawn), confidence, normals, torch.log(shown + expected), numbers)


def points(
    photo: torch.Tensor,
    normals: torch.Tensor,
    known: torch.Tensor,
    tan_half: torch.Tensor,
    root_alpha: torch.Tensor,
    material: torch.Tensor,
) -> tuple[torch.Tensor, ...]:
    """A photo and normals [N, 3, 64, 64] as the second stage takes them, all but the surroundings."""
    weight = F.avg_pool2d(photo[:, 3:], int(photo.shape[2]) // SIZE)
    seen = F.avg_pool2d(photo[:, :3], int(photo.shape[2]) // SIZE) / weight.clip(min=1e-3)
    normals = F.avg_pool2d(normals, int(normals.shape[2]) // SIZE)
    normals = normals * torch.rsqrt(normals.square().sum(dim=1, keepdim=True).clip(min=1e-8))
    root_alpha = torch.lerp(root_alpha, material[:, 7:], material[:, :1])
    return seen, weight, normals, known.amax(dim=(2, 3)), tan_half, root_alpha, material


def light_of(guess: SecondGuess, emitters: EmitterHead) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Radiance [N, 3, 64, 128] up to white, and what is above it at its most likely places, and in the mean."""
    times = MAP_HEIGHT // FINE
    logit = grown(guess.emitter_logit, times)
    shown = torch.exp(grown(guess.ln_shown, times).clip(max=0.0))
    return shown, emitters.mode(guess.ln_above, logit), emitters.expected(guess.ln_above, logit)

"""Lift (noun): the network that lifts pixels to the map, and what it learns from a batch of pairs."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import MEAN_CURVE
from anyprobe.dataset.pair import LN_RANGE
from anyprobe.dataset.pairs import Batch
from anyprobe.evaluate.calibration import CLOSE
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.lamps import FLUX_FLOOR
from anyprobe.nets.light_net import Guess, LightNet
from anyprobe.train.lift_ideas import (
    ANCHOR_ROWS,
    anchors_loss,
    angles_between,
    harmonic_matrix,
    harmonics_loss,
    next_frame,
    part,
    stillness_loss,
    tones_loss,
)
from anyprobe.train.normals import normals_loss

LOBES = (1.0, 16.0, 128.0)
"""Powers of the cosine: what a diffuse, a glossy and a nearly mirroring ball see of the map."""
FAINT = 0.02
"""Added to radiance before its logarithm is compared: darker than this does not matter."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LiftConfig:
    """What each loss counts; 0 leaves it out. lifting: False for the network that has only its code.

    anchors, stillness, harmonics, tones (which changes the network too) and queries: ideas that were tried
    (train.lift_ideas, nets.tones, nets.queries, docs/ablation.md).
    """

    irradiance: float = 3.0
    normals: float = 0.3
    alpha: float = 0.2
    ldr: float = 1.0
    scales: float = 0.5
    structure: float = 0.15
    ln: float = 0.08
    transport: float = 0.25
    confidence: float = 0.05
    lamps: float = 0.04
    flux: float = 0.1
    anchors: float = 0.0
    stillness: float = 0.0
    harmonics: float = 0.0
    tones: float = 0.0
    lifting: bool = True
    queries: bool = False


def display(ln_radiance: torch.Tensor) -> torch.Tensor:
    """The mean camera curve of exp(ln_radiance) before it clips: a sigmoid, with a gradient everywhere."""
    n, sigma = MEAN_CURVE.exponent, MEAN_CURVE.sigma
    return (1 + sigma) * torch.sigmoid(n * ln_radiance - float(np.log(sigma)))


def lobe_matrices(height: int, rows: int) -> torch.Tensor:
    """Means of a map [height, 2 height] around the pixels of one of `rows` rows, [lobes, out, in]; rows sum to 1."""
    out, seen = (pixel_directions(h).reshape(-1, 3).astype(np.float64) for h in (rows, height))
    cosine = np.maximum(out @ seen.T, 0.0)
    angles = np.repeat(pixel_solid_angles(height)[:, 0], 2 * height)
    kernels = np.stack([cosine**power * angles for power in LOBES])
    return torch.from_numpy((kernels / kernels.sum(axis=2, keepdims=True)).astype(np.float32))


def structure_loss(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """1 - structural similarity over 7 x 7 boxes (Wang et al. 2004, Eq. 13), pictures [N, C, H, W] in [0, 1]."""

    def mean(x: torch.Tensor) -> torch.Tensor:
        return F.avg_pool2d(x, 7, stride=2)

    mean_a, mean_b = mean(a), mean(b)
    spread = mean(a * a) + mean(b * b) - mean_a**2 - mean_b**2
    together = mean(a * b) - mean_a * mean_b
    c1, c2 = 0.01**2, 0.03**2
    likeness = (2 * mean_a * mean_b + c1) * (2 * together + c2)
    return 1 - (likeness / ((mean_a**2 + mean_b**2 + c1) * (spread + c2))).mean()


def told_normals(batch: Batch) -> torch.Tensor:
    """The normals that come with the photos [N, 3, 64, 64], with their errors; zero where none do."""
    turned = torch.einsum("nij,njhw->nihw", batch.told, F.avg_pool2d(batch.normals, 2))
    length = turned.square().sum(dim=1, keepdim=True).sqrt()
    return torch.where(length > 0.5, turned / length.clamp(min=0.5), 0.0)


class Lift:
    """Losses of LightNet; float32 weights, bfloat16 arithmetic."""

    def __init__(self, config: LiftConfig, device: str) -> None:
        self.config, self.device = config, device
        weighed = (field.name for field in fields(config) if field.type == "float")
        self.columns = tuple(name for name in weighed if getattr(config, name) > 0)
        self.nets = self.networks(config)
        self.nets.to(device, memory_format=torch.channels_last)
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self._angles = angles.expand(-1, 2 * MAP_HEIGHT)[None, None]  # [1, 1, H, 2H]
        self._weight = (
            0.5 + 0.5 * self._angles / angles.mean()
        )  # between pixels that count alike and true areas
        self._lobes = lobe_matrices(MAP_HEIGHT // 2, 8).to(device)
        self._between = angles_between(ANCHOR_ROWS).to(device)
        self._harmonics = harmonic_matrix(MAP_HEIGHT).to(device)

    @staticmethod
    def networks(config: LiftConfig) -> nn.ModuleDict:
        """Untrained."""
        net = LightNet(lifting=config.lifting, queries=config.queries, dual=config.tones > 0)
        return nn.ModuleDict({"light": net})

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Every loss, weighted; all sharpnesses are learned at once, whatever the progress."""
        photo, count = batch.photo, len(batch.photo)
        again = count // 4 if self.config.stillness > 0 else 0  # photos that are taken twice
        photo = torch.cat([photo, next_frame(photo[:again], progress)])
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            photo = photo.contiguous(memory_format=torch.channels_last)
            normals = told_normals(batch)
            tan_half = batch.tan_half[:, None]
            guess = self.nets["light"](
                photo, *(torch.cat([one, one[:again]]) for one in (tan_half, normals, batch.around))
            )
        guess, second = part(guess, slice(count)), part(guess, slice(count, None))
        terms = {
            **self._told(guess, batch, normals),
            **self._map(guess, batch),
            **self._above_white(guess, batch),
        }
        if self.config.harmonics > 0:
            terms["harmonics"] = harmonics_loss(guess.ln_expected, batch.ln_radiance, self._harmonics).mean()
        if guess.tones is not None:
            terms["tones"] = tones_loss(guess.tones, batch.ln_radiance, self._weight)
        if again:
            terms["stillness"] = stillness_loss(part(guess, slice(again)), second)
        return {name: getattr(self.config, name) * terms[name] for name in self.columns}

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Photos, true LDR maps and those it estimates."""
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            guess = self.nets["light"](photo, batch.tan_half[:, None], told_normals(batch), batch.around)
        return batch.photo[:, :3], batch.ldr, display(guess.ln_radiance).clip(max=1.0)

    def _told(self, guess: Guess, batch: Batch, given: torch.Tensor) -> dict[str, torch.Tensor]:
        told, mask = guess.told, batch.photo[:, 3:]
        share = mask.mean(dim=(1, 2, 3)).clip(min=0.02)
        wrong = (told.irradiance.float() - batch.irradiance * mask) ** 2
        guessed = (given.square().sum(dim=1, keepdim=True) == 0).float()  # what was told need not be
        return {
            "irradiance": (wrong.mean(dim=(1, 2, 3)) / share).mean(),
            "normals": normals_loss(guess.normals, batch, guessed),
            "alpha": (told.root_alpha[:, 0].float() - batch.alpha.sqrt()).abs().mean(),
        }

    def _map(self, guess: Guess, batch: Batch) -> dict[str, torch.Tensor]:
        ln = guess.ln_shown
        shown = display(ln)
        # above white nothing is seen: no matter how far above, while the truth is white too
        shown = torch.where((shown > 1) & (batch.ldr >= 1), shown.clip(max=1.0), shown)
        difference = shown - batch.ldr
        weight = self._weight
        scales, one = 0.0, difference
        for _ in range(4):
            one = F.avg_pool2d(one, 2)
            scales = scales + one.square().mean() + 0.3 * one.abs().mean()
        whole = display(guess.ln_radiance.detach()).clip(max=1.0)
        close = ((whole - batch.ldr).abs().mean(dim=1, keepdim=True) < CLOSE).float()
        confidence = F.binary_cross_entropy_with_logits(guess.confidence_logit, close)
        return {
            "ldr": (weight * (difference.abs() * 0.5 + difference.square() * 2)).mean(),
            "scales": scales,
            "structure": structure_loss(shown.clip(max=1.0), batch.ldr),
            "ln": (weight * (ln - batch.ln_radiance.clip(max=0.0)).abs()).mean(),
            "transport": self._transport(guess.ln_expected, batch.ln_radiance),
            "confidence": confidence,
        }

    def _above_white(self, guess: Guess, batch: Batch) -> dict[str, torch.Tensor]:
        """What is brighter than white: how much in all, and where, by the cross entropy of flux."""
        above = (torch.exp(batch.ln_radiance) - 1).clip(min=0.0) * self._angles
        flux = above.sum(dim=(2, 3))  # [N, 3]
        share = above.sum(dim=1).flatten(1) / flux.sum(dim=1, keepdim=True).clip(min=1e-6)
        guessed = torch.log_softmax((guess.lamp_logit + torch.log(self._angles)).flatten(1), dim=1)
        mean = flux.mean(dim=1)
        counts = mean / (mean + 1.0)
        terms = {
            "lamps": -(counts * (share * guessed).sum(dim=1)).mean(),
            "flux": (guess.ln_flux - torch.log(flux + FLUX_FLOOR)).abs().mean(),
        }
        if self.config.anchors > 0:
            terms["anchors"] = (counts * anchors_loss(guessed.exp(), share, self._between)).mean()
        return terms

    def _transport(self, ln: torch.Tensor, true_ln: torch.Tensor) -> torch.Tensor:
        """What balls of three kinds would see, compared in stops and colours: energy counts, not pixels."""
        seen = []
        for one in (ln, true_ln):
            power = F.avg_pool2d(torch.exp(one.clip(*LN_RANGE)) * self._angles, 2)
            radiance = power / F.avg_pool2d(self._angles, 2)
            balls = torch.einsum("lop,ncp->nclo", self._lobes, radiance.flatten(2))
            seen.append(torch.log(balls + FAINT))
        return (seen[0] - seen[1]).abs().mean()

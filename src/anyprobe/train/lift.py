"""Losses of the network that ships (LightNet), and of its normal estimator trained alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import cast

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.dataset.pair import LN_RANGE
from anyprobe.dataset.pairs import Batch
from anyprobe.evaluate.calibration import CLOSE
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.blocks import autocast
from anyprobe.nets.emitter_head import POWER_FLOOR
from anyprobe.nets.light_net import LightNet, LightPrediction, display


def normals_loss(normals: torch.Tensor, batch: Batch, where: torch.Tensor | float = 1.0) -> torch.Tensor:
    """Mean of 1 - cos(error) over the object's inner pixels.

    Args:
        normals: unit [N, 3, 64, 64].
        where: [N, 1, 64, 64], 0 where pixels do not count.
    """
    true = F.avg_pool2d(batch.normals, 2)
    inside = (F.avg_pool2d(batch.photo[:, 3:], 2) > 0.99).float() * where
    inside = inside * (true.square().sum(dim=1, keepdim=True) > 0.25)
    along = (F.normalize(true, dim=1) * normals).sum(dim=1, keepdim=True)
    return ((1 - along) * inside).sum() / inside.sum().clip(min=1.0)


def irradiance_loss(estimate: torch.Tensor, target: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Mean squared error of images [B, 3, S, S] per object pixel, so that small objects count as much as large."""
    share = mask.mean(dim=(1, 2, 3)).clip(min=0.02)
    return (((estimate - target) ** 2).mean(dim=(1, 2, 3)) / share).mean()


class Normals:
    """Loss of NormalsNet, from the photo alone; float32 weights, the arithmetic of nets.blocks.autocast."""

    columns = ("normals",)

    def __init__(self, config: object, device: str) -> None:
        self.device = device
        self.nets = self.networks()
        self.nets.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained."""
        return nn.ModuleDict({"light": LightNet()})

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """The same whatever the progress."""
        return {"normals": normals_loss(self._guess(batch), batch)}

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Photos, true normals and those it guesses, as colours: (n + 1) / 2 inside the mask."""
        inside = F.avg_pool2d(batch.photo[:, 3:], 2)
        true, guess = F.avg_pool2d(batch.normals, 2), self._guess(batch) * inside
        return batch.photo[:, :3], 0.5 + 0.5 * true, 0.5 + 0.5 * guess

    def _guess(self, batch: Batch) -> torch.Tensor:
        net = cast(LightNet, self.nets["light"])
        with autocast(self.device):
            photo = batch.photo.contiguous(memory_format=torch.channels_last)
            return net.normals(photo, *net.camera_rays(batch.tan_half[:, None]))


LOBES = (1.0, 16.0, 128.0)
"""Powers of the cosine: what a diffuse, a glossy and a nearly mirror-like sphere see of the map."""
METAL_F0 = 0.25
"""Mean f0 above which a material is called a metal: dielectrics stay below a tenth."""
FAINT = 0.02
"""Added to radiance before its logarithm is compared: darker than this does not matter."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LiftConfig:
    """Weight of each loss; 0 leaves it out."""

    irradiance: float = 3.0
    normals: float = 0.3
    alpha: float = 0.2
    ldr: float = 1.0
    scales: float = 0.5
    structure: float = 0.15
    ln: float = 0.08
    transport: float = 0.25
    confidence: float = 0.05
    emitters: float = 0.04
    power: float = 0.1
    level: float = 0.1
    color: float = 0.03
    material: float = 0.05


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


def shown_losses(shown: torch.Tensor, true: torch.Tensor, weight: torch.Tensor) -> dict[str, torch.Tensor]:
    """How far display values [N, 3, H, 2H] are from the truth: pixel by pixel, by the weight of each; as means over
    2, 4, 8 and 16 pixels; and in structure."""
    difference = shown - true
    scales, one = difference.new_zeros(()), difference
    for _ in range(4):
        one = F.avg_pool2d(one, 2)
        scales = scales + one.square().mean() + 0.3 * one.abs().mean()
    return {
        "ldr": (weight * (difference.abs() * 0.5 + difference.square() * 2)).mean(),
        "scales": scales,
        "structure": structure_loss(shown.clip(max=1.0), true),
    }


class Transport:
    """How far two maps are from each other as spheres of three kinds see them (LOBES): energy counts, not pixels."""

    def __init__(self, device: str) -> None:
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self._angles = angles.expand(-1, 2 * MAP_HEIGHT)[None, None]  # [1, 1, H, 2H]
        self._lobes = lobe_matrices(MAP_HEIGHT // 2, 8).to(device)

    def __call__(self, ln: torch.Tensor, true_ln: torch.Tensor) -> torch.Tensor:
        """Mean difference of ln of the means over the lobes, of ln radiance [N, 3, H, 2H]."""
        seen = []
        for one in (ln, true_ln):
            power = F.avg_pool2d(torch.exp(one.clip(*LN_RANGE)) * self._angles, 2)
            radiance = power / F.avg_pool2d(self._angles, 2)
            means = torch.einsum("lop,ncp->nclo", self._lobes, radiance.flatten(2))
            seen.append(torch.log(means + FAINT))
        return (seen[0] - seen[1]).abs().mean()


def given_normals(batch: Batch) -> torch.Tensor:
    """Normals given with the photos [N, 3, 64, 64], with their errors; zero where none are."""
    turned = torch.einsum("nij,njhw->nihw", batch.given_normals_rotation, F.avg_pool2d(batch.normals, 2))
    length = turned.square().sum(dim=1, keepdim=True).sqrt()
    return torch.where(length > 0.5, turned / length.clamp(min=0.5), 0.0)


class Lift:
    """Losses of LightNet; float32 weights, the arithmetic of nets.blocks.autocast."""

    def __init__(self, config: LiftConfig, device: str) -> None:
        self.config, self.device = config, device
        weighed = (field.name for field in fields(config) if field.type == "float")
        self.columns = tuple(name for name in weighed if getattr(config, name) > 0)
        self.nets = self.networks()
        self.nets.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self._angles = angles.expand(-1, 2 * MAP_HEIGHT)[None, None]  # [1, 1, H, 2H]
        # halfway between equal pixels and true solid angles
        self._weight = 0.5 + 0.5 * self._angles / angles.mean()
        self._luminance = torch.tensor(REC709, device=device)
        self._transport = Transport(device)

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained."""
        return nn.ModuleDict({"light": LightNet()})

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Every loss, weighted."""
        guess, normals = self._predict(batch)
        terms = {
            **self._object(guess, batch, normals),
            **self._map(guess, batch),
            **self._emitters(guess, batch),
            **self._posterior(guess, batch),
        }
        return {name: getattr(self.config, name) * terms[name] for name in self.columns}

    def _predict(self, batch: Batch) -> tuple[LightPrediction, torch.Tensor]:
        """The network's output, and the normals it was given."""
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            normals = given_normals(batch)
            given = (batch.tan_half[:, None], normals, batch.surroundings, batch.given_material)
            return self.nets["light"](photo, *given), normals

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Photos, true LDR maps and those it estimates."""
        guess, _ = self._predict(batch)
        return batch.photo[:, :3], batch.ldr, display(guess.ln_radiance).clip(max=1.0)

    def _object(self, guess: LightPrediction, batch: Batch, given: torch.Tensor) -> dict[str, torch.Tensor]:
        features, mask = guess.features, batch.photo[:, 3:]
        estimated = (given.square().sum(dim=1, keepdim=True) == 0).float()  # given normals are not learned
        return {
            "irradiance": irradiance_loss(features.irradiance.float(), batch.irradiance * mask, mask),
            "normals": normals_loss(guess.normals, batch, estimated),
            "alpha": (features.root_alpha[:, 0].float() - batch.alpha.sqrt()).abs().mean(),
        }

    def _map(self, guess: LightPrediction, batch: Batch) -> dict[str, torch.Tensor]:
        ln = guess.ln_shown
        shown = display(ln)
        # clipped in both: how far above white does not matter
        shown = torch.where((shown > 1) & (batch.ldr >= 1), shown.clip(max=1.0), shown)
        whole = display(guess.ln_radiance.detach()).clip(max=1.0)
        close = ((whole - batch.ldr).abs().mean(dim=1, keepdim=True) < CLOSE).float()
        confidence = F.binary_cross_entropy_with_logits(guess.confidence_logit, close)
        return {
            **shown_losses(shown, batch.ldr, self._weight),
            "ln": (self._weight * (ln - batch.ln_radiance.clip(max=0.0)).abs()).mean(),
            "transport": self._transport(guess.ln_expected, batch.ln_radiance),
            "confidence": confidence,
        }

    def _emitters(self, guess: LightPrediction, batch: Batch) -> dict[str, torch.Tensor]:
        """Radiance above white: its total power, and where it comes from by cross entropy."""
        above = (torch.exp(batch.ln_radiance) - 1).clip(min=0.0) * self._angles
        power = above.sum(dim=(2, 3))  # [N, 3]
        share = above.sum(dim=1).flatten(1) / power.sum(dim=1, keepdim=True).clip(min=1e-6)
        guessed = torch.log_softmax((guess.emitter_logit + torch.log(self._angles)).flatten(1), dim=1)
        mean = power.mean(dim=1)
        counts = mean / (mean + 1.0)
        return {
            "emitters": -(counts * (share * guessed).sum(dim=1)).mean(),
            "power": (guess.ln_power - torch.log(power + POWER_FLOOR)).abs().mean(),
        }

    def _posterior(self, guess: LightPrediction, batch: Batch) -> dict[str, torch.Tensor]:
        """The map's level and mean colour, with how wrong they are thought to be, and the object's material.

        A mean error s is learned from errors e by e / s + ln s (a Laplace distribution's likelihood); the errors
        themselves are learned as they are, or a doubtful photo would count less.
        """
        means = []
        for ln in (guess.ln_expected, batch.ln_radiance):
            means.append((torch.exp(ln.clip(*LN_RANGE)) * self._angles).sum(dim=(2, 3)))
        level = (torch.log(means[0] @ self._luminance) - torch.log(means[1] @ self._luminance)).abs()
        cosine = F.cosine_similarity(means[0], means[1]).clip(max=1 - 1e-5)
        color = torch.rad2deg(torch.acos(cosine)) / 10.0
        metal, reflectance, *scales = guess.posterior.split([1, 3, 1, 1, 1], dim=1)
        wrong = (reflectance - batch.material[:, 2:5]).abs().mean(dim=1)
        is_metal = (batch.material[:, 5:].mean(dim=1) > METAL_F0).float()
        known = batch.material[:, 0]
        kind = F.binary_cross_entropy_with_logits(metal[:, 0], is_metal, reduction="none")
        ln_wrong, ln_level, ln_color = (one[:, 0] for one in scales)
        material = kind + wrong * (1 + torch.exp(-ln_wrong)) + ln_wrong
        return {
            "level": (level + level.detach() * torch.exp(-ln_level) + ln_level).mean(),
            "color": (color + color.detach() * torch.exp(-ln_color) + ln_color).mean(),
            "material": (known * material).sum() / known.sum().clip(min=1.0),
        }

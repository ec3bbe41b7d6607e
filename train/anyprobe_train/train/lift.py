"""Losses of the network that ships (LightNet), and of its normal estimator trained alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, cast

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe_train.dataset.pair_source import Batch
from anyprobe_train.evaluate.calibration import CLOSE
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.nets.emitter_head import POWER_FLOOR
from anyprobe_train.nets.lifting import given_or_estimated
from anyprobe_train.nets.light_net import LightNet, LightPrediction, display
from anyprobe_train.train.map_losses import Sent, clipped_where_white, shown_losses


def normals_loss(normals: torch.Tensor, batch: Batch, where: torch.Tensor | float = 1.0) -> torch.Tensor:
    """Compute the mean of 1 - cos(error) of unit normals [N, 3, 64, 64] over the object's inner pixels.

    where: [N, 1, 64, 64], 0 where pixels do not count.
    """
    true = F.avg_pool2d(batch.normals, 2)
    inside = (F.avg_pool2d(batch.photo[:, 3:], 2) > 0.99).float() * where
    inside = inside * (true.square().sum(dim=1, keepdim=True) > 0.25)
    along = (F.normalize(true, dim=1) * normals).sum(dim=1, keepdim=True)
    return ((1 - along) * inside).sum() / inside.sum().clip(min=1.0)


def irradiance_loss(estimate: torch.Tensor, target: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
    """Compute the mean squared error of images [B, 3, S, S] per object pixel: objects of all sizes count alike."""
    share = mask.mean(dim=(1, 2, 3)).clip(min=0.02)
    return (((estimate - target) ** 2).mean(dim=(1, 2, 3)) / share).mean()


class Learner:
    """Networks with float32 weights that learn with the arithmetic of nets.blocks.autocast.

    A subclass has `columns`, the names of its losses, and `losses`; `pictures`, from a batch to display values
    [N, 3, H, W] from left to right, if checkpoints are to show them.
    """

    columns: tuple[str, ...]

    def __init__(self, config: Any, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @classmethod
    def networks(cls) -> nn.ModuleDict:
        """Build the untrained networks."""
        return nn.ModuleDict({"light": LightNet()})

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Compute the losses by name; progress: the share of the run done, [0, 1)."""
        raise NotImplementedError


class Normals(Learner):
    """Loss of NormalsNet, from the photo alone."""

    columns = ("normals",)

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Compute the loss; progress has no effect."""
        return {"normals": normals_loss(self._guess(batch), batch)}

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Return photos, true normals and estimated ones, as colours: (n + 1) / 2 inside the mask."""
        inside = F.avg_pool2d(batch.photo[:, 3:], 2)
        true, guess = F.avg_pool2d(batch.normals, 2), self._guess(batch) * inside
        return batch.photo[:, :3], 0.5 + 0.5 * true, 0.5 + 0.5 * guess

    def _guess(self, batch: Batch) -> torch.Tensor:
        net = cast(LightNet, self.nets["light"])
        with autocast(self.device):
            photo = batch.photo.contiguous(memory_format=torch.channels_last)
            return net.normals(photo, *net.camera_rays(batch.tan_half[:, None]))


METAL_F0 = 0.25
"""Mean f0 above which a material counts as a metal: dielectrics stay below a tenth."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LiftConfig:
    """Weights of the losses; 0 leaves a loss out."""

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


def given_normals(batch: Batch) -> torch.Tensor:
    """Return the normals given with the photos [N, 3, 64, 64], with their errors; zero where none are."""
    turned = torch.einsum("nij,njhw->nihw", batch.given_normals_rotation, F.avg_pool2d(batch.normals, 2))
    return given_or_estimated(turned, torch.zeros_like(turned))[0]


class Lift(Learner):
    """Losses of LightNet."""

    def __init__(self, config: LiftConfig, device: str) -> None:
        super().__init__(config, device)
        self.columns = tuple(one.name for one in fields(config) if getattr(config, one.name) > 0)
        self._sent = Sent(device)

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Compute every loss, weighted."""
        guess, normals = self._predict(batch)
        terms = {
            **self._object(guess, batch, normals),
            **self.of_map(guess, batch),
            **self.of_emitters(guess, batch),
            **self._posterior(guess, batch),
        }
        return {name: getattr(self.config, name) * terms[name] for name in self.columns}

    def _predict(self, batch: Batch) -> tuple[LightPrediction, torch.Tensor]:
        """Run the network; return its output and the normals it was given."""
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            normals = given_normals(batch)
            given = (batch.tan_half[:, None], normals, batch.surroundings, batch.given_material)
            return self.nets["light"](photo, *given), normals

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Return photos, true LDR maps and estimated ones."""
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

    def of_map(self, guess: Any, batch: Any) -> dict[str, torch.Tensor]:
        """Compute the losses of the map up to white, of what it sends, and of its confidence."""
        ln = guess.ln_shown
        shown = clipped_where_white(display(ln), batch.ldr)
        whole = display(guess.ln_radiance.detach()).clip(max=1.0)
        close = ((whole - batch.ldr).abs().mean(dim=1, keepdim=True) < CLOSE).float()
        confidence = F.binary_cross_entropy_with_logits(guess.confidence_logit, close)
        return {
            **shown_losses(shown, batch.ldr, self._sent.weight),
            "ln": (self._sent.weight * (ln - batch.ln_radiance.clip(max=0.0)).abs()).mean(),
            "transport": self._sent.transport(guess.ln_expected, batch.ln_radiance),
            "confidence": confidence,
        }

    def of_emitters(self, guess: Any, batch: Any) -> dict[str, torch.Tensor]:
        """Compute the losses of the total power above white, and of where it comes from by cross entropy."""
        power, _ = self._sent.above_white(batch.ln_radiance)
        return {
            "emitters": self._sent.emitters(self._sent.ln_share_of(guess.emitter_logit), batch.ln_radiance),
            "power": (guess.ln_power - torch.log(power + POWER_FLOOR)).abs().mean(),
        }

    def _posterior(self, guess: LightPrediction, batch: Batch) -> dict[str, torch.Tensor]:
        """Compute the losses of the map's level and mean colour with their claimed errors, and of the object's
        material.

        A mean error s is learned from errors e by e / s + ln s (a Laplace distribution's likelihood); the errors
        themselves are learned as they are, or a doubtful photo would count less.
        """
        metal, reflectance, ln_wrong, _ = guess.posterior.split([1, 3, 1, 2], dim=1)
        level, color = self.of_errors(guess.ln_expected, guess.posterior, batch.ln_radiance)
        reflectance_error = (reflectance - batch.material[:, 2:5]).abs().mean(dim=1)
        is_metal = (batch.material[:, 5:].mean(dim=1) > METAL_F0).float()
        known = batch.material[:, 0]
        kind = F.binary_cross_entropy_with_logits(metal[:, 0], is_metal, reduction="none")
        ln_wrong = ln_wrong[:, 0]
        material = kind + reflectance_error * (1 + torch.exp(-ln_wrong)) + ln_wrong
        return {"level": level, "color": color, "material": (known * material).sum() / known.sum().clip(min=1.0)}

    def of_errors(
        self, ln_expected: torch.Tensor, posterior: torch.Tensor, true_ln: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Compute the losses of a map's level and mean colour with their claimed errors, see _posterior."""
        level = self._sent.level(ln_expected, true_ln)
        cosine = F.cosine_similarity(self._sent.power(ln_expected), self._sent.power(true_ln)).clip(max=1 - 1e-5)
        color = torch.rad2deg(torch.acos(cosine)) / 10.0
        ln_level, ln_color = posterior[:, 5], posterior[:, 6]
        return (
            (level + level.detach() * torch.exp(-ln_level) + ln_level).mean(),
            (color + color.detach() * torch.exp(-ln_color) + ln_color).mean(),
        )

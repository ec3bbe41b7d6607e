"""Losses of LightNet while it learns from whole photos: its map from the truth, the rest from itself as it was.

Kept pairs hold the true light and not the object's true surface. What LightNet says of the surface (normals, what is
sent without gloss, roughness, reflectance) is held where a frozen copy of it has it, its teacher; so is its answer to
hints that no pair has, given normals and materials.
"""

from __future__ import annotations

from copy import deepcopy
from types import SimpleNamespace
from typing import Any

import torch
from torch.nn import functional as F

from anyprobe.scatter.materials import LEAST_REFLECTANCE
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.nets.light_net import LightNet, LightPrediction, display
from anyprobe_train.train.lift import Lift, LiftConfig, irradiance_loss

OBJECT_WEIGHTS = {
    "alone_ldr": 0.5,
    "alone_scales": 0.25,
    "alone_structure": 0.07,
    "alone_ln": 0.04,
    "alone_transport": 0.2,
    "alone_confidence": 0.02,
    "alone_emitters": 0.04,
    "alone_power": 0.05,
    "alone_level": 0.02,
    "alone_color": 0.01,
    "kept_normals": 1.0,
    "kept_irradiance": 3.0,
    "kept_surface": 0.1,
    "kept_answer": 0.3,
}
"""Weight of each loss."""
HINTED = 0.12
"""Share of the pairs that are given hints, normals or a material, and whose answer is the teacher's."""
ANSWERED = ("normals", "posterior", "ln_shown", "ln_expected", "ln_power")
SEEN = ("irradiance", "root_alpha")
"""Parts of the teacher's answer, and of its features, that are compared."""
NORMALS_ERROR = 0.05
"""Standard deviation of the components of given normals."""


class ObjectLoss:
    """The losses of LightPredictions, unweighted; keeps a frozen copy of the network."""

    def __init__(self, net: LightNet, device: str) -> None:
        self.teacher = deepcopy(net).eval().requires_grad_(False)
        self._lift = Lift(LiftConfig(), device)

    @torch.no_grad()
    def with_hints(self, batch: dict[str, torch.Tensor], generator: torch.Generator) -> dict[str, Any]:
        """Return the batch with the teacher's answer, and with normals or a material given in some pairs."""
        photo = batch["photo"]
        count, device = len(photo), photo.device
        with autocast(device):
            plain = self.teacher(photo, batch["tan_half"], None, batch["surroundings"])
        kind = torch.rand(count, generator=generator, device=device)
        with_normals, with_material = kind < HINTED / 2, (kind >= HINTED / 2) & (kind < HINTED)
        spread = torch.randn(plain.normals.shape, generator=generator, device=device) * NORMALS_ERROR
        inside = F.avg_pool2d(photo[:, 3:], 2) > 0.5
        normals = F.normalize(plain.normals.float() + spread, dim=1) * inside
        normals = normals * with_normals[:, None, None, None]
        material = _materials(count, generator, device) * with_material[:, None]
        some = kind < HINTED
        with autocast(device):
            known = photo, batch["tan_half"], normals, batch["surroundings"], material
            hinted = self.teacher(*(one[some] for one in known))
        told = SimpleNamespace(
            **{name: _put(getattr(plain, name), some, getattr(hinted, name)) for name in ANSWERED},
            features=SimpleNamespace(
                **{name: _put(getattr(plain.features, name), some, getattr(hinted.features, name)) for name in SEEN}
            ),
        )
        return {**batch, "given_normals": normals, "material": material, "hinted": some, "teacher": told}

    def __call__(self, guess: LightPrediction, batch: dict[str, Any]) -> dict[str, torch.Tensor]:
        """Compute the losses by the names of OBJECT_WEIGHTS; batch: as with_hints returns it."""
        told, hinted = batch["teacher"], batch["hinted"]
        free = ~hinted
        true = SimpleNamespace(ln_radiance=batch["truth"][free], ldr=display(batch["truth"][free]).clip(max=1.0))
        own = SimpleNamespace(
            **{
                name: getattr(guess, name)[free]
                for name in ("ln_shown", "ln_radiance", "ln_expected", "ln_power", "emitter_logit", "confidence_logit")
            }
        )
        of_map = {**self._lift.of_map(own, true), **self._lift.of_emitters(own, true)}
        level, color = self._lift.of_errors(own.ln_expected, guess.posterior[free], true.ln_radiance)
        mask = batch["photo"][:, 3:]
        inside = (F.avg_pool2d(mask, 2) > 0.99).float() * (1 - (batch["given_normals"].abs().sum(1, True) > 0).float())
        along = (guess.normals * told.normals).sum(dim=1, keepdim=True)
        surface = (guess.posterior[:, :5] - told.posterior[:, :5]).abs().mean()
        alpha = (guess.features.root_alpha - told.features.root_alpha).abs().mean().float()
        return {
            **{f"alone_{name}": value for name, value in of_map.items()},
            "alone_level": level,
            "alone_color": color,
            "kept_normals": ((1 - along) * inside).sum() / inside.sum().clip(min=1.0),
            "kept_irradiance": irradiance_loss(
                guess.features.irradiance.float(), told.features.irradiance.float(), mask
            ),
            "kept_surface": surface + 2 * alpha,
            "kept_answer": _difference(guess, told, hinted.float()),
        }


def _put(values: torch.Tensor, some: torch.Tensor, others: torch.Tensor) -> torch.Tensor:
    """Return values [N, ...] with others in the place of some [N]."""
    values = values.clone()
    values[some] = others
    return values


def _difference(guess: LightPrediction, told: SimpleNamespace, where: torch.Tensor) -> torch.Tensor:
    """Return the mean difference of two answers' maps and powers where [N] is 1."""
    shown = (display(guess.ln_shown) - display(told.ln_shown)).abs().mean(dim=(1, 2, 3))
    expected = (guess.ln_expected - told.ln_expected).abs().mean(dim=(1, 2, 3))
    power = (guess.ln_power - told.ln_power).abs().mean(dim=1)
    return ((4 * shown + expected + 0.3 * power) * where).sum() / where.sum().clip(min=1.0)


def _materials(count: int, generator: torch.Generator, device: torch.device) -> torch.Tensor:
    """Draw materials as materials.material_input encodes them, a third of them metals, [N, 8]."""

    def even(channels: int) -> torch.Tensor:
        return torch.rand(count, channels, generator=generator, device=device)

    metal = (even(1) < 0.33).float()
    albedo, f0 = 0.05 + 0.85 * even(1) * (1 - 0.4 * even(3)), 0.5 + 0.45 * even(3)
    reflected = torch.log((metal * f0 + (1 - metal) * albedo).clip(min=LEAST_REFLECTANCE))
    values = [torch.ones_like(metal), 0.15 + 0.8 * even(1), reflected, metal * f0 + (1 - metal) * 0.04]
    return torch.cat([one.expand(count, -1) for one in values], dim=1)

"""Claims of the networks: how sure they are, and by how much that is corrected after training."""

from __future__ import annotations

from dataclasses import dataclass

import torch

from anyprobe_train.nets.light_net import LightPrediction


@dataclass(frozen=True, kw_only=True, slots=True)
class Sureness:
    """How a graph corrects its claims: slope and offset of the confidence logit, and factors
    of the errors of reflectance, level and colour."""

    logit: tuple[float, float] = (1.0, 0.0)
    errors: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def numbers(self) -> tuple[float, ...]:
        """All of them, as graphs' metadata have them."""
        return *self.logit, *self.errors


AS_LEARNED = Sureness()
AS_CALIBRATED = Sureness(logit=(1.08061, -0.598498), errors=(0.996776, 1.15832, 1.1506))
"""Corrections of the weights that ship, by research/export_weights/calibrate.py; WholeNet learned from these."""


def claims_of(guess: LightPrediction, sureness: Sureness) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the confidence [N, 1, 64, 128] in [0, 1], and the posterior [N, 7] of POSTERIOR."""
    slope, offset = sureness.logit
    of_reflectance, of_level, of_color = sureness.errors
    metal, others = guess.posterior.split([1, 6], dim=1)
    factors = others.new_tensor([1.0, 1.0, 1.0, of_reflectance, of_level, 10 * of_color])
    posterior = torch.cat([torch.sigmoid(metal), torch.exp(others) * factors], dim=1)
    return torch.sigmoid(slope * guess.confidence_logit + offset), posterior


POSTERIOR = ("metal", "red", "green", "blue", "reflectance_error", "level_error", "color_error")
"""Estimates of the object and of the map's errors: probability of a metal, total reflectance RGB, and mean errors
of its logarithm, of ln of the map's level and of its mean colour in degrees."""

"""The mean camera's curve for tensors of any shape: what a display shows of light, and what light a display means."""

import math

import torch

from anyprobe.core.response import MEAN_CURVE

EXPONENT, SIGMA = MEAN_CURVE.exponent, MEAN_CURVE.sigma


def display(ln_radiance: torch.Tensor) -> torch.Tensor:
    """Return the mean camera curve of exp(ln_radiance) before it clips: a sigmoid, with a gradient everywhere."""
    return (1 + SIGMA) * torch.sigmoid(EXPONENT * ln_radiance - math.log(SIGMA))


def inverse_display(shown: torch.Tensor) -> torch.Tensor:
    """Return the radiance up to white that display values mean."""
    ratio = (shown.clamp(0.0, 1.0) / (1 + SIGMA)).clamp(min=1e-6)
    return torch.exp(torch.log(ratio * SIGMA / (1 - ratio)) / EXPONENT).clamp(max=1.0)

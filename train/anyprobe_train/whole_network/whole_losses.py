"""Losses of WholeNet: the map as a display and as spheres see it, its light sources, the camera's posture."""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.nets.emitter_head import POWER_FLOOR
from anyprobe_train.nets.whole_net import WholePrediction
from anyprobe_train.train.lift import CLOSE, display
from anyprobe_train.train.map_losses import Sent, clipped_where_white, pixel_loss, scales_loss, structure_loss
from anyprobe_train.whole_network.source_profiles import shares_around, source_colors

WHOLE_WEIGHTS = {
    "drawn": 0.8,
    "spread": 0.2,
    "shown": 0.4,
    "scales": 0.5,
    "structure": 0.15,
    "ln": 0.08,
    "transport": 0.4,
    "confidence": 0.05,
    "emitters": 0.2,
    "context": 0.15,
    "power": 0.1,
    "profile": 0.3,
    "color": 0.1,
    "level": 0.1,
    "pitch": 0.2,
    "roll": 0.03,
    "stands": 0.03,
}
"""Weight of each loss."""
SOURCE_WEIGHTS = (1.0, 0.5, 0.25, 0.25)
"""Weights of the sources' profiles, the brightest first."""
DIM_POWER = 0.1
"""Power above white of which the loss of a direction counts half: most photos have more, and teach as much as any."""
LEAST_SHARE = 0.05
"""Share of the power within 8 degrees of a place at which its colour counts in full."""
SHARE_FLOOR = 0.02
"""Added to shares of power before their logarithm: less hardly shows."""


class WholeLoss:
    """The losses of predictions, unweighted."""

    def __init__(self, device: str = "cpu") -> None:
        self._sent = Sent(device)
        self.angles = self._sent.angles

    def __call__(self, guess: WholePrediction, batch: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        """Compute the losses by the names of WHOLE_WEIGHTS; batch: of batches.Pairs."""
        true = batch["truth"]
        ldr = display(true).clip(max=1.0)
        shown = self._difference(guess.ln_shown, ldr)
        scales = scales_loss(shown)
        close = (display(guess.ln_radiance.detach()).clip(max=1.0) - ldr).abs().mean(dim=1, keepdim=True) < CLOSE
        power, _ = self._sent.above_white(true)
        profiles, colors = self._sources(guess.places.detach(), batch)
        present = (batch["context"][:, 4].amax(dim=(1, 2)) > 0).float()
        ln_context = guess.ln_context.unflatten(1, (MAP_HEIGHT, 2 * MAP_HEIGHT))[:, None]
        return {
            "drawn": pixel_loss(self._difference(guess.ln_radiance, ldr), self._sent.weight),
            "spread": pixel_loss(self._difference(guess.ln_expected, ldr), self._sent.weight),
            "shown": pixel_loss(shown, self._sent.weight),
            "scales": scales,
            "structure": structure_loss((ldr + shown).clip(0.0, 1.0), ldr),
            "ln": (self._sent.weight * (guess.ln_shown - true.clip(max=0.0)).abs()).mean(),
            "transport": sum(self._sent.transport(ln, true) for ln in (guess.ln_expected, guess.ln_radiance)) / 2,
            "confidence": F.binary_cross_entropy_with_logits(guess.confidence_logit, close.float()),
            "emitters": self._sent.emitters(self._sent.ln_share_of(guess.logit), true, DIM_POWER),
            "context": self._sent.emitters(self._sent.ln_share_of(ln_context), true, DIM_POWER, present),
            "power": (guess.ln_power - torch.log(power + POWER_FLOOR)).abs().mean(),
            "profile": profile_loss(guess.profiles, profiles),
            "color": color_loss(guess.colors, colors, profiles),
            "level": self._sent.level(guess.ln_radiance, true).mean(),
            **posture_losses(guess.posture, batch["up"], present),
        }

    @staticmethod
    def _difference(ln: torch.Tensor, ldr: torch.Tensor) -> torch.Tensor:
        return clipped_where_white(display(ln), ldr) - ldr

    @torch.no_grad()
    def _sources(self, places: torch.Tensor, batch: dict[str, torch.Tensor]) -> tuple[torch.Tensor, torch.Tensor]:
        """Return what profiles [N, S, R] and colours [N, S, 3] should be.

        The first source learns the profile of the truth's brightest place, wherever that is, so that hard light stays
        hard. Each other source learns the profile of the truth around its own place: none where there is no source.
        """
        radiance = torch.exp(batch["truth"])
        bright = torch.einsum("c,nchw->nhw", self._sent.luminance, radiance)
        others = places[:, 1:]
        profiles = torch.cat([batch["profiles"][:, :1], shares_around(bright, others)], dim=1)
        return profiles, torch.cat(
            [batch["colors"][:, :1], source_colors(radiance, others, self._sent.luminance)], dim=1
        )


def profile_loss(profiles: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
    """Compute the mean of |p - t| + .2 |ln(p + SHARE_FLOOR) - ln(t + SHARE_FLOOR)| over shares p and t [N, S, R].

    Sources are weighted by SOURCE_WEIGHTS.
    """
    ln = torch.log(profiles + SHARE_FLOOR) - torch.log(true + SHARE_FLOOR)
    each = ((profiles - true).abs() + 0.2 * ln.abs()).mean(dim=(0, 2))
    return each @ each.new_tensor(SOURCE_WEIGHTS) / sum(SOURCE_WEIGHTS)


def color_loss(colors: torch.Tensor, true: torch.Tensor, profiles: torch.Tensor) -> torch.Tensor:
    """Differences of ln of the sources' colours [N, S, 3] and of the true ones, where there is a source."""
    counts = (profiles[..., 1] / LEAST_SHARE).clamp(max=1.0) * colors.new_tensor(SOURCE_WEIGHTS)
    each = (torch.log(colors + SHARE_FLOOR) - torch.log(true + SHARE_FLOOR)).abs().mean(dim=2)
    return (counts * each).sum() / counts.sum().clamp(min=1e-6)


def posture_losses(posture: torch.Tensor, up: torch.Tensor, present: torch.Tensor) -> dict[str, torch.Tensor]:
    """Return the losses of ContextNet's posture [N, 4] where there is a context, present [N]; in tens of degrees.

    up [N, 3]: unit, in the crop's frame. Every object stands on something.
    """
    pitch, ln_error, roll, logit = posture.unbind(dim=1)

    def mean(values: torch.Tensor) -> torch.Tensor:
        return (values * present).sum() / present.sum().clip(min=1.0)

    unit = np.radians(10.0)
    off = (pitch - torch.asin(up[:, 2].clamp(-1.0, 1.0))).abs() / unit
    rolled = (roll - torch.atan2(up[:, 0], up[:, 1])).abs() / unit
    of_error = off.detach() * torch.exp(-ln_error) * unit + ln_error
    return {"pitch": mean(off + 0.3 * of_error), "roll": mean(rolled), "stands": mean(F.softplus(-logit))}

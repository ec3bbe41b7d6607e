"""Losses of the model that is given the whole photo: LightNet with the code of ContextNet.

`Whole` learns all of it; `Heads` what the context and the light sources add to a body that stays as it is, from
features of pairs that are made once and kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import cast

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.dataset.pairs import Batch
from anyprobe.files.atomic import atomic_path
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.blocks import autocast
from anyprobe.nets.context_net import CODE, ContextNet
from anyprobe.nets.light_net import LightNet, LightPrediction
from anyprobe.train.lift import Lift, LiftConfig, given_normals
from anyprobe.train.source_profiles import source_profiles

SOURCE_WEIGHTS = (1.0, 0.5, 0.25, 0.25)
"""Of the sources' profiles, the brightest first."""
SHARE_FLOOR = 0.02
"""Added to shares of power before their logarithm: less hardly shows."""


def profile_loss(profiles: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
    """Differences of shares [N, S, R] and of their logarithms."""
    ln = torch.log(profiles + SHARE_FLOOR) - torch.log(true + SHARE_FLOOR)
    each = ((profiles - true).abs() + 0.2 * ln.abs()).mean(dim=(0, 2))
    return each @ each.new_tensor(SOURCE_WEIGHTS) / sum(SOURCE_WEIGHTS)


def posture_losses(
    posture: torch.Tensor, up: torch.Tensor, stands: torch.Tensor, present: torch.Tensor
) -> dict[str, torch.Tensor]:
    """Of ContextNet's posture [N, 4], where there is a context, present [N]; pitch and roll in tens of degrees.

    up [N, 3]: unit in the crop's frame, or zero where it is not known; stands [N]: 1 on a level ground.
    """
    pitch, ln_error, roll, logit = posture.unbind(dim=1)
    known = present * (up.square().sum(dim=1) > 0.5)

    def mean(values: torch.Tensor, where: torch.Tensor) -> torch.Tensor:
        return (values * where).sum() / where.sum().clip(min=1.0)

    unit = np.radians(10.0)
    off = (pitch - torch.asin(up[:, 2].clamp(-1.0, 1.0))).abs() / unit
    rolled = (roll - torch.atan2(up[:, 0], up[:, 1])).abs() / unit
    of_error = off.detach() * torch.exp(-ln_error) * unit + ln_error
    return {
        "pitch": mean(off + 0.3 * of_error, known),
        "roll": mean(rolled, known),
        "stands": mean(F.binary_cross_entropy_with_logits(logit, stands, reduction="none"), present),
    }


def cross_entropy(logit: torch.Tensor, share: torch.Tensor, angles: torch.Tensor, counts: torch.Tensor):
    """Mean of -sum share ln p, p the distribution of logit [N, 1, H, W] per steradian, weighted by counts [N].

    share: [N, H W] of the pixels; angles: [1, 1, H, W].
    """
    ln = torch.log_softmax((logit + torch.log(angles)).flatten(1), dim=1)
    return -(counts * (share * ln).sum(dim=1)).mean()


class Whole(Lift):
    """Lift, with the context."""

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained."""
        return nn.ModuleDict({"light": LightNet(context=CODE), "context": ContextNet()})

    def _predict(self, batch: Batch) -> tuple[LightPrediction, torch.Tensor]:
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            normals = given_normals(batch)
            code, self._posture = self.nets["context"](batch.context, batch.tan_half[:, None])
            given = (batch.tan_half[:, None], normals, batch.surroundings, batch.given_material, code)
            return self.nets["light"](photo, *given), normals

    def _posterior(self, guess: LightPrediction, batch: Batch) -> dict[str, torch.Tensor]:
        bright = torch.einsum("c,nchw->nhw", self._luminance, torch.exp(batch.ln_radiance))
        present = (batch.context[:, 4].amax(dim=(1, 2)) > 0).float()
        assert guess.profiles is not None  # there are, with a context
        return {
            **super()._posterior(guess, batch),
            **posture_losses(self._posture, batch.up, batch.stands, present),
            "profile": profile_loss(guess.profiles, source_profiles(bright)[1]),
        }


@dataclass(frozen=True, kw_only=True, slots=True)
class Features:
    """What Heads learn from: context [B, 5, 96, 96] and tan_half [B] of pairs; code [B, C] of the object and
    emitter_logit [B, 1, H, 2H] of a body without context; share [B, H 2H] of the power above white and power [B], its
    mean over the channels; profiles [B, S, R]; up [B, 3]; stands [B]."""

    context: torch.Tensor
    tan_half: torch.Tensor
    code: torch.Tensor
    emitter_logit: torch.Tensor
    share: torch.Tensor
    power: torch.Tensor
    profiles: torch.Tensor
    up: torch.Tensor
    stands: torch.Tensor

    def to(self, device: str) -> Features:
        """The same on another device, in float32."""
        return Features(**{one.name: getattr(self, one.name).to(device).float() for one in fields(self)})


class Heads:
    """Losses of ContextNet and SourceHead on a body that does not learn."""

    columns = ("emitters", "direction", "profile", "pitch", "roll", "stands")

    def __init__(self, config: LiftConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._light = cast(LightNet, self.nets["light"])
        self._light.eval().requires_grad_(False)
        self._light.sources.train().requires_grad_(True)
        angles = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self._angles = angles.expand(-1, 2 * MAP_HEIGHT)[None, None]
        self._luminance = torch.tensor(REC709, device=device)

    networks = staticmethod(Whole.networks)

    @torch.no_grad()
    def features(self, batch: Batch) -> Features:
        """Of pairs, in the precision in which they are kept."""
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            given = (batch.tan_half[:, None], given_normals(batch), batch.surroundings, batch.given_material)
            guess = self._light(photo, *given)
        above = (torch.exp(batch.ln_radiance) - 1).clip(min=0.0) * self._angles
        power = above.sum(dim=(1, 2, 3))
        bright = torch.einsum("c,nchw->nhw", self._luminance, torch.exp(batch.ln_radiance))
        return Features(
            context=(batch.context * 255).round().to(torch.uint8),
            tan_half=batch.tan_half,
            code=torch.cat([guess.features.code, guess.features.root_alpha], dim=1).half(),
            emitter_logit=guess.emitter_logit.half(),
            share=(above.sum(dim=1).flatten(1) / power[:, None].clip(min=1e-6)).half(),
            power=power / 3,
            profiles=source_profiles(bright)[1],
            up=batch.up,
            stands=batch.stands,
        )

    def kept(self, batch: Callable[[int], Batch], folder: Path, period: int, steps: range) -> Iterator[Features]:
        """Those of the batches of steps; there are `period` of them, each made once and kept in a folder."""
        for step in steps:
            number = step % period
            path = folder / f"{number}.pt"
            if not path.is_file():
                made = self.features(batch(number))
                with atomic_path(path) as temporary:
                    torch.save({one.name: getattr(made, one.name) for one in fields(made)}, temporary)
            yield Features(**torch.load(path, weights_only=True)).to(self.device)

    def losses(self, one: Features, progress: float) -> dict[str, torch.Tensor]:
        """The same whatever the progress."""
        context = (one.context / 255).contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            code, posture = self.nets["context"](context, one.tan_half[:, None])
        present = (one.context[:, 4].amax(dim=(1, 2)) > 0).float()
        whole = torch.cat([one.code, code], dim=1)
        ln = self._light.ln_context(whole, code)
        counts = one.power / (one.power + 1.0)
        return {
            "emitters": 0.5 * cross_entropy(one.emitter_logit + ln, one.share, self._angles, counts),
            "direction": 0.3 * cross_entropy(ln, one.share, self._angles, counts * present),
            "profile": 3.0 * profile_loss(self._light.sources.profiles(whole), one.profiles),
            **posture_losses(posture, one.up, one.stands, present),
        }

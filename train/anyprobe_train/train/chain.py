"""Losses of the paper's three networks (Sect. 3.2 to 3.4, nets.earlier_paper), with gradual targets (Eq. 6).

The irradiance net learns alone, first (Irradiance). Then all three learn in one pass over the pairs (Chain): each one's
input is the output of the one before, cut off from its gradient. What Eq. 7 makes of the last two reaches both.
"""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.response import response
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.paper.equations import blend_weight, reconstruct
from anyprobe_train.dataset.batch_shading import curves
from anyprobe_train.dataset.camera import column_of, draw_curve
from anyprobe_train.dataset.pair_source import Batch
from anyprobe_train.nets.blocks import autocast
from anyprobe_train.nets.earlier_paper import NETS, EarlierIlluminationNet
from anyprobe_train.nets.light_net import LightNet, display
from anyprobe_train.train.config import RunConfig
from anyprobe_train.train.lift import Learner, irradiance_loss, normals_loss
from anyprobe_train.train.map_losses import Sent, clipped_where_white, shown_losses

NUM_EPOCHS = 11
GRADUAL_SHARE = 0.3
"""Share of the steps that the 11 filtered epochs take; the rest sees the unfiltered map."""
TIMES_EXPOSURE = (0.5, 2.0)
"""Range of exposures at which the HDR net sees true maps [times the photo's] (the paper's Sect. 3.5)."""
WEIGHTS = {"ldr": 1.0, "scales": 0.5, "structure": 0.2, "brightest": 0.18, "normals": 0.3}
"""Weights of the illumination net's losses. With squares alone, as in the paper, its maps approach their mean."""
HDR_WEIGHTS = {"pixels": 1.0, "transport": 0.7, "shown": 1.5, "level": 0.4, "emitters": 0.1}
"""Weights of the HDR net's losses."""
REACH = 0.25
"""Share of the HDR net's gradient that reaches the LDR map through Eq. 7, so that it has light where Eq. 8 looks for
it."""
LN_SHOWN = 0.5
"""Largest ln radiance at which pixels are pulled to the true map's display values, those at the edge of white
included."""
BRIGHTEST = ((2, 0.02), (8, 0.02), (2, 0.002))
"""Settings of brightest_loss: pixels averaged in each direction, as it compares patches rather than grain, and the
share of patches. The last is the peak, without which Eq. 7 hardly reads the HDR net."""


def sharpness(progress: float) -> float | None:
    """Return beta e with beta = e^2: 1, 8, ... 1331 over the epochs; None once the map is left unfiltered.

    progress: share of the run's steps done, [0, 1). The paper ends with the 11th epoch; the steps after it, on
    unfiltered maps, are ours.
    """
    epoch = 1 + int(progress / GRADUAL_SHARE * NUM_EPOCHS)
    return None if epoch > NUM_EPOCHS else float(epoch**3)


def gradual_target(ldr: torch.Tensor, progress: float) -> torch.Tensor:
    """Filter the LDR map [N, 3, H, 2H] as in the epoch at this progress (Eq. 6)."""
    exponent = sharpness(progress)
    if exponent is None:
        return ldr
    return blur_cosine_power(ldr.permute(0, 2, 3, 1), exponent).permute(0, 3, 1, 2)


def brightest_loss(shown: torch.Tensor, true: torch.Tensor) -> torch.Tensor:
    """Compute the mean difference of the brightest patches of two maps [N, C, H, W], wherever they are.

    Eq. 8 takes radiance from the HDR net where the LDR map is above .8, which a mean over all likely maps hardly is:
    the map must have as much light as the truth, and has it where that is most likely.
    """
    loss = shown.new_zeros(())
    for size, share in BRIGHTEST:
        values = []
        for radiance in (shown, true):
            patches = F.avg_pool2d(radiance, size).flatten(2)
            chosen = patches.mean(dim=1, keepdim=True).topk(max(1, round(share * patches.shape[2])), dim=2).indices
            values.append(patches.gather(2, chosen.expand(-1, patches.shape[1], -1)))
        loss = loss + (values[0] - values[1]).abs().mean() / len(BRIGHTEST)
    return loss


class _Stages(Learner):
    """Networks of the chain."""

    stages: tuple[str, ...]

    @classmethod
    def networks(cls) -> nn.ModuleDict:
        """Build the untrained networks."""
        return nn.ModuleDict({stage: NETS[stage]() for stage in cls.stages})

    def _run(self, stage: str, x: torch.Tensor, *more: torch.Tensor) -> torch.Tensor:
        with autocast(self.device):
            return self.nets[stage](x.contiguous(memory_format=torch.channels_last), *more).float()

    def _irradiance(self, batch: Batch) -> torch.Tensor:
        return self._run("irradiance", batch.photo, batch.tan_half[:, None])


class Irradiance(_Stages):
    """Loss of the irradiance net."""

    stages = columns = ("irradiance",)

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Compute the mean squared error; progress has no effect."""
        mask = batch.photo[:, 3:]
        return {"irradiance": irradiance_loss(self._irradiance(batch), batch.irradiance * mask, mask)}

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Return photos, true irradiance and its estimates."""
        mask = batch.photo[:, 3:]
        return batch.photo[:, :3], batch.irradiance * mask, self._irradiance(batch).clip(0, 1)


class Chain(_Stages):
    """Losses of all three networks; the input of each is the output of the one before, cut off from its gradient."""

    stages = tuple(NETS)
    columns = ("irradiance", "illumination", "hdr")

    def __init__(self, config: RunConfig, device: str) -> None:
        super().__init__(config, device)
        self._sent = Sent(device)
        self._teacher: LightNet | None = None

    def learn_from(self, teacher: LightNet, compiled: bool = False) -> None:
        """Set a teacher, whose maps are a share of the illumination net's targets (RunConfig.taught).

        What an object can tell varies less than the whole map, and so is learned from fewer pairs. The teacher is given
        normals and material.
        """
        self._teacher = teacher.to(self.device).eval().requires_grad_(False)
        self._teacher.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        if compiled:
            self._teacher = cast(LightNet, torch.compile(self._teacher))

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Compute the losses; progress sharpens the illumination net's targets."""
        seen, mask = self._irradiance(batch), batch.photo[:, 3:]
        with torch.no_grad():
            wanted = self._taught(batch)
        ldr, normals = self._shown_and_normals(seen.detach(), batch)
        losses = shown_losses(ldr, self._gradual(wanted, progress), self._sent.weight)
        losses["brightest"] = brightest_loss(ldr, self._gradual(batch.ldr, progress))
        losses["normals"] = normals_loss(normals, batch)
        return {
            "irradiance": irradiance_loss(seen, batch.irradiance * mask, mask),
            "illumination": sum((WEIGHTS[name] * losses[name] for name in WEIGHTS), ldr.new_zeros(())),
            "hdr": self._hdr_loss(ldr.clip(max=1.0), batch, progress),
        }

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Return photos, true LDR maps and those estimated from estimated irradiance."""
        return batch.photo[:, :3], batch.ldr, self._shown_and_normals(self._irradiance(batch), batch)[0].clip(max=1.0)

    def _shown_and_normals(self, irradiance: torch.Tensor, batch: Batch) -> tuple[torch.Tensor, torch.Tensor]:
        image = torch.cat([irradiance, batch.photo[:, 3:]], dim=1).contiguous(memory_format=torch.channels_last)
        with autocast(self.device):
            ldr, normals = cast(EarlierIlluminationNet, self.nets["illumination"]).shown_and_normals(
                image, batch.tan_half[:, None]
            )
        return ldr.float(), normals

    def _gradual(self, ldr: torch.Tensor, progress: float) -> torch.Tensor:
        return gradual_target(ldr, progress) if self.config.gradual else ldr

    def _taught(self, batch: Batch) -> torch.Tensor:
        """Return true LDR maps, or a blend of them with the teacher's."""
        if self._teacher is None:
            return batch.ldr
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        normals = F.normalize(F.avg_pool2d(batch.normals, 2), dim=1)
        with autocast(self.device):
            guess = self._teacher(photo, batch.tan_half[:, None], normals, None, batch.material)
        shown = display(guess.ln_radiance.float()).clip(max=1.0)
        return torch.lerp(batch.ldr, shown, self.config.taught)

    def _hdr_loss(self, estimate: torch.Tensor, batch: Batch, progress: float) -> torch.Tensor:
        """Return the squared error of ln radiance from true LDR maps, weighted by solid angle and 0.1 + gamma (Eq. 8):
        mostly where Eq. 7 will read it. From estimated ones, whose pixels are no longer those of the truth, how far
        the map that Eq. 7 makes is from the truth: in display values, in what spheres see, in power, and in where light
        comes from.

        estimate: display values [B, 3, H, 2H] of the illumination net.
        """
        count = max(1, int(self.config.hdr_share * len(estimate)))
        rng = np.random.default_rng(int(progress * 2**40))
        true, ln_true = self._shot_maps(batch.ln_radiance[:count], rng)
        ln = self._run("hdr", torch.cat([true, estimate.detach()]))
        weight = self._sent.angles / self._sent.angles.mean() * (0.1 + _last(blend_weight, true))
        of_pixels = (weight * (ln[:count] - ln_true) ** 2).sum() / weight.sum() / 3
        radiance = _last(reconstruct, torch.lerp(estimate.detach(), estimate, REACH), ln[count:])
        ln_sent = torch.log(radiance.clip(min=1e-6))
        shown = clipped_where_white(display(ln_sent.clip(max=LN_SHOWN)), batch.ldr)
        terms = {
            "pixels": of_pixels,
            "shown": shown_losses(shown, batch.ldr, self._sent.weight)["ldr"],
            "transport": self._sent.transport(ln_sent, batch.ln_radiance),
            "level": self._sent.level(ln_sent, batch.ln_radiance).mean(),
            "emitters": self._sent.emitters(self._sent.ln_share(ln_sent), batch.ln_radiance),
        }
        return sum((HDR_WEIGHTS[name] * terms[name] for name in HDR_WEIGHTS), ln.new_zeros(()))

    def _shot_maps(self, ln: torch.Tensor, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Return display values of maps [B, 3, H, 2H], each at its own exposure and camera curve, and their ln
        radiance."""
        least, most = np.log(TIMES_EXPOSURE)
        exposed = ln + column_of(least + rng.random(len(ln)) * (most - least), ln)
        curve = curves([draw_curve(rng) for _ in ln], ln)
        return cast(torch.Tensor, response(torch.exp(exposed), curve)), exposed


def _last(function, *pictures: torch.Tensor) -> torch.Tensor:
    """Apply a function of pictures [B, H, W, C] to pictures [B, C, H, W]."""
    return function(*(x.permute(0, 2, 3, 1) for x in pictures)).permute(0, 3, 1, 2)

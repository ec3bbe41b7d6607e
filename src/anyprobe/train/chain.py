"""Losses of the paper's three networks (nets.paper), with gradual targets (Eq. 6).

Each network's input is the one before's output, cut off from its gradient: the three
losses do not mix, and one pass over the pairs trains all three.
"""

from __future__ import annotations

import torch
from torch import nn

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.dataset.pairs import Batch
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.reconstruct import blend_weight
from anyprobe.nets.blocks import autocast
from anyprobe.nets.paper import NETS
from anyprobe.train.config import RunConfig
from anyprobe.train.lift import irradiance_loss

NUM_EPOCHS = 11
GRADUAL_SHARE = 0.7
"""Share of the steps that the 11 filtered epochs take; the rest sees the map itself."""


def sharpness(progress: float) -> float | None:
    """beta e with beta = e^2: 1, 8, ... 1331 over the epochs; None when the map is left alone.

    progress: share of the run's steps done, [0, 1). The paper ends with the 11th epoch; the steps after it, on
    unfiltered maps, are ours.
    """
    epoch = 1 + int(progress / GRADUAL_SHARE * NUM_EPOCHS)
    return None if epoch > NUM_EPOCHS else float(epoch**3)


def gradual_target(ldr: torch.Tensor, progress: float) -> torch.Tensor:
    """The LDR map [N, 3, H, 2H] filtered as in the epoch at this progress (Eq. 6)."""
    exponent = sharpness(progress)
    if exponent is None:
        return ldr
    return blur_cosine_power(ldr.permute(0, 2, 3, 1), exponent).permute(0, 3, 1, 2)


class Chain:
    """Losses of the three networks; float32 weights, the arithmetic of nets.blocks.autocast."""

    columns = tuple(NETS)

    def __init__(self, config: RunConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        weights = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self.solid_angle = (weights / weights.mean())[None, None]  # [1, 1, H, 1], mean 1

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained."""
        return nn.ModuleDict({stage: net() for stage, net in NETS.items()})

    def _run(self, stage: str, x: torch.Tensor) -> torch.Tensor:
        with autocast(self.device):
            return self.nets[stage](x.contiguous(memory_format=torch.channels_last)).float()

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Mean squared error of each network; progress is the share of the run done, in [0, 1)."""
        mask = batch.photo[:, 3:]
        irradiance = self._run("irradiance", batch.photo)
        ldr = self._run("illumination", self._object_image(batch, irradiance.detach()))
        target = gradual_target(batch.ldr, progress) if self.config.gradual else batch.ldr
        return {
            "irradiance": irradiance_loss(irradiance, batch.irradiance * mask, mask),
            "illumination": (self.solid_angle * (ldr - target) ** 2).mean(),
            "hdr": self._hdr_loss(ldr.detach(), batch),
        }

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Photos, true LDR maps and those estimated from estimated irradiance."""
        seen = torch.cat([self._run("irradiance", batch.photo), batch.photo[:, 3:]], dim=1)
        return batch.photo[:, :3], batch.ldr, self._run("illumination", seen)

    def _object_image(self, batch: Batch, irradiance: torch.Tensor) -> torch.Tensor:
        """The illumination net's input [B, 4, S, S]; the first truth_share of the batch sees the truth, as far as
        the photo's mask goes: that is all an irradiance net can show."""
        given, mask = int(self.config.truth_share * len(irradiance)), batch.photo[:, 3:]
        seen = torch.cat([batch.irradiance[:given] * mask[:given], irradiance[given:]])
        return torch.cat([seen, mask], dim=1)

    def _hdr_loss(self, estimate: torch.Tensor, batch: Batch) -> torch.Tensor:
        """Mean squared error of ln radiance from true and from estimated LDR maps, weighted by solid angle and
        0.1 + gamma (Eq. 8): mostly where Eq. 7 will read it.

        estimate: display values [B, 3, H, 2H] of the illumination net.
        """
        quarter = max(1, int(self.config.hdr_share * len(estimate)) // 2)
        true, estimated = slice(0, quarter), slice(len(estimate) - quarter, None)
        ldr = torch.cat([batch.ldr[true], estimate[estimated]])
        saturated = torch.cat([batch.ldr[true], torch.maximum(estimate, batch.ldr)[estimated]])
        target = torch.cat([batch.ln_radiance[true], batch.ln_radiance[estimated]])
        weight = self.solid_angle * (0.1 + blend_weight(saturated.permute(0, 2, 3, 1)).permute(0, 3, 1, 2))
        return (weight * (self._run("hdr", ldr) - target) ** 2).sum() / weight.sum() / 3

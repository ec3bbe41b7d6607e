"""HdrCurves (noun): the designs' HDR network alone, as the paper trains it: LDR map -> ln radiance, on true maps.

The maps are seen through cameras of random curve (dataset.map_views), while a reconstruction (Eq. 7) inverts the mean
curve alone. Nothing is done about that, as in the paper, for three reasons. The target is the true radiance, in units
in which white is 1, and all curves meet there: what is saturated under one is under all, and is worth as much. Below
white a curve says what the mean one does to within 5 % at a display value of 0.9 and 9 % at Eq. 8's threshold of 0.8
(one standard deviation), where gamma falls to 0. And the maps that the network will be given have the mean curve, or
are guesses of such: the middle of what it has seen, where its errors over all curves cancel.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.dataset.map_views import MapBatch
from anyprobe.nets.design_nets import ROWS, SmallHdrNet
from anyprobe.train.hdr_loss import hdr_loss

if TYPE_CHECKING:
    from anyprobe.train.config import RunConfig


class HdrCurves:
    """Loss of the HDR network; float32 weights, bfloat16 arithmetic."""

    columns = ("hdr",)

    def __init__(self, config: RunConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device, memory_format=torch.channels_last)
        weights = torch.from_numpy(pixel_solid_angles(ROWS)).to(device)
        self.solid_angle = (weights / weights.mean())[None, None]  # [1, 1, H, 1], mean 1

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained, with the first weights that it has among the designs."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(0)
            return nn.ModuleDict({"hdr": SmallHdrNet()})

    def losses(self, batch: MapBatch, progress: float) -> dict[str, torch.Tensor]:
        """As the designs' on their true maps; progress is the share of the run done, in [0, 1)."""
        ldr = F.avg_pool2d(batch.ldr, batch.ldr.shape[2] // ROWS)
        target = F.avg_pool2d(batch.ln_radiance, batch.ln_radiance.shape[2] // ROWS)
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            estimate = self.nets["hdr"](ldr.contiguous(memory_format=torch.channels_last)).float()
        return {"hdr": hdr_loss(estimate, target, ldr, self.solid_angle)}

"""Tiny designs: Direct, Irradiance and Ours on 32 x 32 pixels, where a core can show them a million pairs.

What each design sees and learns is as in train.designs. Each has two first weights; the irradiance network, one for
all, learns beside them from nothing. There are no rivals and no HDR network: that sees LDR maps alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.dataset.pairs import Batch
from anyprobe.nets.irradiance_net import IrradianceNet
from anyprobe.nets.tiny_nets import IRRADIANCE_WIDTHS, ROWS, TinyMapNet
from anyprobe.train.chain import irradiance_loss
from anyprobe.train.designs import DESIGNS, Design
from anyprobe.train.gradual import gradual_target

if TYPE_CHECKING:
    from anyprobe.train.config import RunConfig

TINY = DESIGNS | {"direct_2": Design(sees_irradiance=False, seed=1)}
SHARP = tuple(f"{name}_sharp" for name, design in TINY.items() if design.gradual)
SHOWN = (*TINY, *SHARP)
"""Losses of maps, of which also the change from step to step is logged."""
IMAGE = "image"
"""The irradiance network among those that learn."""


class TinyDesigns:
    """Losses of every tiny design; float32 weights, bfloat16 arithmetic. Wants photos of 32 x 32 pixels."""

    columns = (IMAGE, *SHOWN, *(f"{name}_change" for name in SHOWN))

    def __init__(self, config: RunConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device, memory_format=torch.channels_last)
        weights = torch.from_numpy(pixel_solid_angles(ROWS)).to(device)
        self.solid_angle = (weights / weights.mean())[None, None]  # [1, 1, H, 1], mean 1
        self._before: dict[str, torch.Tensor] = {}

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained; first weights depend on each design's seed alone."""
        nets: dict[str, nn.Module] = {}
        with torch.random.fork_rng(devices=[]):
            for name, design in TINY.items():
                torch.manual_seed(design.seed)
                nets[name] = TinyMapNet()
            torch.manual_seed(0)
            nets[IMAGE] = IrradianceNet(IRRADIANCE_WIDTHS)
        return nn.ModuleDict(nets)

    def _run(self, name: str, x: torch.Tensor) -> torch.Tensor:
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            return self.nets[name](x.contiguous(memory_format=torch.channels_last)).float()

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Mean squared errors; progress is the share of the run done, in [0, 1).

        For the curves only: "<design>_sharp", the gradual designs' error against the map itself, and "<loss>_change",
        by how much a loss is another than at the step before (Fig. 6); 0 at the first step of a process.
        """
        mask = batch.photo[:, 3:]
        truth = batch.irradiance * mask
        estimate = self._run(IMAGE, batch.photo)
        losses = {IMAGE: irradiance_loss(estimate, truth, mask)}
        given = int(self.config.truth_share * len(mask))
        seen = torch.cat([truth[:given], estimate.detach()[given:].clip(0, 1)])
        image = torch.cat([seen, mask], dim=1)
        ldr = F.avg_pool2d(batch.ldr, batch.ldr.shape[2] // ROWS)
        soft = gradual_target(ldr, progress, self.config.gradual_share)
        for name, design in TINY.items():
            guess = self._run(name, image if design.sees_irradiance else batch.photo)
            losses[name] = self._map_loss(guess, soft if design.gradual else ldr)
            if design.gradual:
                losses[f"{name}_sharp"] = self._map_loss(guess.detach(), ldr)
        now = {name: losses[name].detach() for name in SHOWN}
        before, self._before = self._before or now, now
        return losses | {f"{name}_change": (now[name] - before[name]).abs() for name in SHOWN}

    def _map_loss(self, estimate: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        return (self.solid_angle * (estimate - target) ** 2).mean()

"""Designs (noun): the paper's designs and two rivals, trained side by side on the same batches.

    direct      photo -> LDR map
    irradiance  estimated irradiance -> LDR map
    ours        estimated irradiance -> LDR map, targets that sharpen (Eq. 6)
    georgoulis  photo -> picture of a mirror ball, of which the map is unwrapped
    meka        photo and true normals -> grey mirror image, unwrapped by the normals
    hdr         LDR map -> ln radiance, one network for all: it learns from true maps and from
                those of direct, irradiance and ours (with 16 pairs a batch two, one and one of each)

"irradiance" and "ours" exist twice, from other first weights; those of the first of each and
of direct are the same. The estimated irradiance is that of the shipped network, which stays as it is or,
where the run says so, goes on learning (never from the designs' losses).
"""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.core.color import REC709
from anyprobe.core.latlong import direction_to_uv, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.dataset.pairs import Batch, pixel_wo
from anyprobe.nets.design_nets import ROWS, SIZE, BallNet, MapNet, MirrorNet, SmallHdrNet
from anyprobe.nets.lift import mirror_direction
from anyprobe.render.reflectance import reflectance_disc
from anyprobe.train.chain import irradiance_loss
from anyprobe.train.frozen_irradiance import load_frozen_irradiance
from anyprobe.train.gradual import gradual_target
from anyprobe.train.hdr_loss import hdr_loss

if TYPE_CHECKING:
    from anyprobe.train.config import RunConfig


@dataclass(frozen=True, kw_only=True, slots=True)
class Design:
    """One illumination network: what it sees, whether its targets sharpen, which first weights it has."""

    sees_irradiance: bool = True
    gradual: bool = False
    seed: int = 0


DESIGNS = {
    "direct": Design(sees_irradiance=False),
    "irradiance": Design(),
    "ours": Design(gradual=True),
    "irradiance_2": Design(seed=1),
    "ours_2": Design(gradual=True, seed=1),
}
CHAINS = ("direct", "irradiance", "ours")
"""Whose maps the HDR network learns from."""
RIVALS = {"georgoulis": BallNet, "meka": MirrorNet}
IMAGE = "irradiance_image"
"""The irradiance network among those that learn."""
IMAGE_RATE = 0.2
"""Its share of their learning rate: it was trained before, and has no batch normalisation left to bear more."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shrunk:
    """A batch at the designs' size: photo [B, 4, 64, 64], irradiance [B, 3, 64, 64], ldr and
    ln_radiance [B, 3, 32, 64], normals [B, 3, 64, 64] unit or zero, wo [B, 3, 64, 64]."""

    photo: torch.Tensor
    irradiance: torch.Tensor
    ldr: torch.Tensor
    ln_radiance: torch.Tensor
    normals: torch.Tensor
    wo: torch.Tensor


class Designs:
    """Losses of every design; float32 weights, bfloat16 arithmetic."""

    columns = (
        *DESIGNS,
        *(f"{name}_sharp" for name, design in DESIGNS.items() if design.gradual),
        *RIVALS,
        "hdr",
    )

    def __init__(self, config: RunConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks(config.irradiance_learns)
        self.nets.to(device, memory_format=torch.channels_last)
        if config.irradiance_learns:
            self.columns += (IMAGE,)
            self.irradiance = self.nets[IMAGE]
        else:
            frozen, _ = load_frozen_irradiance()
            self.irradiance = frozen.to(device, memory_format=torch.channels_last)
        weights = torch.from_numpy(pixel_solid_angles(ROWS)).to(device)
        self.solid_angle = (weights / weights.mean())[None, None]  # [1, 1, H, 1], mean 1
        uv, weight = ball_places()
        self.ball_uv, self.ball_weight = uv.to(device), weight.to(device)

    @staticmethod
    def networks(irradiance_learns: bool = False) -> nn.ModuleDict:
        """Untrained but for the irradiance network, if it is one; first weights depend on each design's seed alone."""
        makers = {name: (MapNet, design.seed) for name, design in DESIGNS.items()}
        makers |= {name: (maker, 0) for name, maker in RIVALS.items()} | {"hdr": (SmallHdrNet, 0)}
        nets = {}
        with torch.random.fork_rng(devices=[]):
            for name, (maker, seed) in makers.items():
                torch.manual_seed(seed)
                nets[name] = maker()
        if irradiance_learns:
            nets[IMAGE] = load_frozen_irradiance()[0].train().requires_grad_(True)
        return nn.ModuleDict(nets)

    def _run(self, net: nn.Module, x: torch.Tensor) -> torch.Tensor:
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            return net(x.contiguous(memory_format=torch.channels_last)).float()

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """Mean squared errors; progress is the share of the run done, in [0, 1).

        "<design>_sharp" is the gradual designs' error against the map itself, for the curves only.
        """
        small = shrink_batch(batch)
        seen, losses = self._see_irradiance(batch, small)
        maps = {}
        soft = gradual_target(small.ldr, progress, self.config.gradual_share)
        for name, design in DESIGNS.items():
            image = torch.cat([seen, small.photo[:, 3:]], dim=1) if design.sees_irradiance else small.photo
            ldr = self._run(self.nets[name], image)
            maps[name] = ldr.detach()
            losses[name] = self._map_loss(ldr, soft if design.gradual else small.ldr)
            if design.gradual:
                losses[f"{name}_sharp"] = self._map_loss(maps[name], small.ldr)
        ball = self._run(self.nets["georgoulis"], small.photo)
        losses["georgoulis"] = (self.ball_weight * (ball - see_map(small.ldr, self.ball_uv)) ** 2).mean()
        losses["meka"] = self._mirror_loss(small)
        losses["hdr"] = self._hdr_loss(maps, small)
        return losses

    def _see_irradiance(self, batch: Batch, small: Shrunk) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """What the designs see as irradiance [B, 3, 64, 64], the truth in the first truth_share, and the loss of the
        network that guesses the rest, where it learns."""
        given = int(self.config.truth_share * len(batch.photo))
        learns = self.config.irradiance_learns
        with nullcontext() if learns else torch.no_grad():
            estimate = self._run(self.irradiance, batch.photo if learns else batch.photo[given:])
        losses = {}
        if learns:
            mask = batch.photo[:, 3:]
            losses[IMAGE] = irradiance_loss(estimate, batch.irradiance * mask, mask)
            estimate = estimate.detach()[given:]
        return torch.cat([small.irradiance[:given], F.avg_pool2d(estimate.clip(0, 1), 2)]), losses

    def _map_loss(self, estimate: torch.Tensor, target: torch.Tensor) -> torch.Tensor:
        return (self.solid_angle * (estimate - target) ** 2).mean()

    def _mirror_loss(self, small: Shrunk) -> torch.Tensor:
        """Per object pixel, as the irradiance network's."""
        estimate = self._run(self.nets["meka"], torch.cat([small.photo, small.normals], dim=1))
        there = ((small.normals.square().sum(dim=1, keepdim=True) > 0) & (small.photo[:, 3:] > 0.5)).float()
        uv = direction_to_uv(mirror_direction(small.normals, small.wo).permute(0, 2, 3, 1))
        target = see_map(grey(small.ln_radiance), uv)
        share = there.mean(dim=(1, 2, 3)).clip(min=0.02)
        return ((there * (estimate - target) ** 2).mean(dim=(1, 2, 3)) / share).mean()

    def _hdr_loss(self, maps: dict[str, torch.Tensor], small: Shrunk) -> torch.Tensor:
        """As the chain's: ln radiance from true and from estimated maps, mostly where Eq. 7 will read it."""
        size = len(small.ldr)
        half = max(1, int(self.config.hdr_share * size) // 2)
        chosen = [(CHAINS[k % len(CHAINS)], size - 1 - k) for k in range(half)]
        estimated = torch.stack([maps[name][k] for name, k in chosen])
        places = [*range(half), *(k for _, k in chosen)]
        truth, target = small.ldr[places], small.ln_radiance[places]
        ldr = torch.cat([truth[:half], estimated])
        estimate = self._run(self.nets["hdr"], ldr)
        return hdr_loss(estimate, target, torch.maximum(ldr, truth), self.solid_angle)


def shrink_batch(batch: Batch) -> Shrunk:
    """Halve every picture and map; normals that an edge has mixed are made unit again."""
    normals = F.avg_pool2d(batch.normals, 2)
    length = normals.square().sum(dim=1, keepdim=True).sqrt()
    return Shrunk(
        photo=F.avg_pool2d(batch.photo, 2),
        irradiance=F.avg_pool2d(batch.irradiance * batch.photo[:, 3:], 2),
        ldr=F.avg_pool2d(batch.ldr, 2),
        ln_radiance=F.avg_pool2d(batch.ln_radiance, 2),
        normals=torch.where(length > 0.5, normals / length.clip(min=1e-6), 0.0),
        wo=pixel_wo(batch.tan_half.reshape(-1, 1, 1, 1), SIZE).permute(0, 3, 1, 2),
    )


def see_map(maps: torch.Tensor, uv: torch.Tensor) -> torch.Tensor:
    """Maps [B, C, H, 2H] at map coordinates uv [B or 1, S, S, 2]: [B, C, S, S], without a seam."""
    width = maps.shape[-1]
    wide = torch.cat([maps[..., -1:], maps, maps[..., :1]], dim=3)
    x = (uv[..., 0] * width + 1) / (width + 2) * 2 - 1
    place = torch.stack([x, uv[..., 1] * 2 - 1], dim=-1).expand(len(maps), -1, -1, -1)
    return F.grid_sample(wide, place.to(maps.dtype), padding_mode="border", align_corners=False)


def grey(ln_radiance: torch.Tensor) -> torch.Tensor:
    """Display value of the luminance of maps [B, 3, H, W]: [B, 1, H, W]."""
    weights = ln_radiance.new_tensor(REC709).reshape(1, 3, 1, 1)
    return response((torch.exp(ln_radiance) * weights).sum(dim=1, keepdim=True))


def ball_places() -> tuple[torch.Tensor, torch.Tensor]:
    """Where the mirror ball's pixels see the map, [1, 64, 64, 2], and their weight [1, 1, 64, 64].

    The weight is the solid angle of directions that a pixel stands for; its mean is 1.
    """
    normals, inside = reflectance_disc(SIZE)
    n = torch.from_numpy(normals)
    wo = torch.tensor([0.0, 0.0, 1.0])
    wi = 2.0 * n[..., 2:] * n - wo
    theta = 2 * torch.acos(n[..., 2].clip(-1, 1))
    weight = torch.sin(theta) / (theta / torch.pi).clip(min=1e-3) * torch.from_numpy(inside)
    return direction_to_uv(wi)[None], (weight / weight.mean())[None, None]

"""What each network learns: its inputs and its loss, on a batch of pairs."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.dataset.pairs import Batch
from anyprobe.errors import ModelError
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.reconstruct import blend_weight
from anyprobe.nets.hdr_net import HdrNet
from anyprobe.nets.illumination_net import IlluminationNet
from anyprobe.nets.irradiance_net import IrradianceNet
from anyprobe.train.config import RunConfig
from anyprobe.train.gradual import gradual_target

NETS = {"irradiance": IrradianceNet, "illumination": IlluminationNet, "hdr": HdrNet}


def load_net(folder: Path, stage: str) -> nn.Module:
    """A trained network, frozen, from its run's folder."""
    path = folder / stage / "checkpoint.pt"
    if not path.is_file():
        raise ModelError(
            f"{path}: expected the checkpoint of the {stage} run, found none; train {stage} first"
        )
    net = NETS[stage]()
    net.load_state_dict(torch.load(path, map_location="cpu", weights_only=True)["net"])
    return net.eval().requires_grad_(False).to(memory_format=torch.channels_last)


class Stage:
    """Loss of one network; earlier networks of the chain are frozen and read from `folder`."""

    def __init__(self, config: RunConfig, folder: Path, device: str) -> None:
        self.config, self.device = config, device
        self.net = NETS[config.stage]().to(device, memory_format=torch.channels_last)
        weights = torch.from_numpy(pixel_solid_angles(MAP_HEIGHT)).to(device)
        self.solid_angle = (weights / weights.mean())[None, None]  # [1, 1, H, 1], mean 1
        self.irradiance_net = self.illumination_net = None
        if config.stage == "hdr" or (config.stage == "illumination" and config.source == "estimate"):
            self.irradiance_net = load_net(folder, "irradiance").to(device)
        if config.stage == "hdr":
            self.illumination_net = load_net(folder, "illumination").to(device)

    def _cast(self):
        return torch.autocast(self.device, dtype=torch.bfloat16)

    def _channels_last(self, x: torch.Tensor) -> torch.Tensor:
        return x.contiguous(memory_format=torch.channels_last)

    def _object_image(self, batch: Batch, some: slice) -> torch.Tensor:
        """The illumination net's input [N, 4, S, S]."""
        photo, mask = batch.photo[some], batch.photo[some, 3:]
        if self.config.source == "photo":
            return photo
        truth = torch.cat([batch.irradiance[some], mask], dim=1)
        if self.config.source == "truth":
            return truth
        with torch.no_grad(), self._cast():
            estimate = self.irradiance_net(self._channels_last(photo)).float()
        image = torch.cat([estimate, mask], dim=1)
        given = int(self.config.truth_share * len(image))
        return torch.cat([truth[:given], image[given:]])

    def loss(self, batch: Batch, progress: float) -> torch.Tensor:
        """Mean squared error of this stage, on display values or ln radiance."""
        everything = slice(None)
        if self.config.stage == "irradiance":
            with self._cast():
                estimate = self.net(self._channels_last(batch.photo))
            mask = batch.photo[:, 3:]
            # mean over the object, so that small objects count as much as large ones
            share = mask.mean(dim=(1, 2, 3)).clip(min=0.02)
            error = ((estimate.float() - batch.irradiance * mask) ** 2).mean(dim=(1, 2, 3))
            return (error / share).mean()
        if self.config.stage == "illumination":
            image = self._object_image(batch, everything)
            with self._cast():
                estimate = self.net(self._channels_last(image))
            target = gradual_target(batch.ldr, progress) if self.config.gradual else batch.ldr
            return (self.solid_angle * (estimate.float() - target) ** 2).mean()
        half = len(batch.ldr) // 2
        with torch.no_grad(), self._cast():
            estimate = self.illumination_net(
                self._channels_last(self._object_image(batch, slice(half)))
            ).float()
        ldr = torch.cat([estimate, batch.ldr[half:]])
        with self._cast():
            ln_radiance = self.net(self._channels_last(ldr))
        # Eq. 7 reads the net where the LDR map saturates; the rest keeps it smooth
        gamma = blend_weight(torch.maximum(ldr, batch.ldr).permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        weight = self.solid_angle * (0.1 + gamma)
        return (weight * (ln_radiance.float() - batch.ln_radiance) ** 2).sum() / weight.sum() / 3

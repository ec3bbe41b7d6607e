"""The paper's three networks, irradiance (Fig. 5), illumination (Fig. 8) and HDR (Fig. 9), and their losses, with
gradual targets (Eq. 6).

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
from anyprobe.nets.blocks import UNet, Unwrap, Up, Wrap, autocast, conv
from anyprobe.train.config import RunConfig
from anyprobe.train.lift import irradiance_loss


class IrradianceNet(nn.Module):
    """photo [N, 4, 128, 128] (display RGB times mask, mask) -> display irradiance [N, 3, 128, 128].

    Zero outside the mask; values are in [0, 1] up to the network's error.
    """

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128, 192)) -> None:
        super().__init__()
        self.body = UNet(4, widths)
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, photo: torch.Tensor) -> torch.Tensor:
        residual = self.head(self.body(photo))
        return (photo[:, :3] + residual) * photo[:, 3:]


class IlluminationNet(nn.Module):
    """image [N, 4, 128, 128] (irradiance or photo, and mask) -> LDR map [N, 3, 64, 128] in [0, 1].

    Pixels of the object and pixels of the map do not correspond, so everything
    passes through one vector (`code` numbers), as in the paper.
    """

    def __init__(self, widths: tuple[int, ...] = (32, 64, 96, 160, 256), code: int = 512) -> None:
        super().__init__()
        layers, inputs = [], 4
        for width in widths:
            layers += [conv(inputs, width, stride=2), conv(width, width)]
            inputs = width
        self.encoder = nn.Sequential(*layers)  # [N, widths[-1], 4, 4]
        self.code = nn.Sequential(nn.Flatten(), nn.Linear(widths[-1] * 16, code), nn.LeakyReLU(0.1))
        self.start = nn.Sequential(nn.Linear(code, 192 * 4 * 8), nn.LeakyReLU(0.1))
        self.decoder = nn.Sequential(
            Wrap(2),
            Up(192, 192),  # 8 x 24, 4 columns of them beyond each side
            conv(192, 128),
            Unwrap(2),
            Up(128, 96),
            conv(96, 96),
            Up(96, 48),
            conv(48, 48),
            Up(48, 24),
            Unwrap(16),
        )
        self.head = nn.Conv2d(24, 3, 1)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        start = self.start(self.code(self.encoder(image))).reshape(-1, 192, 4, 8)
        return torch.sigmoid(self.head(self.decoder(start)))


class HdrNet(nn.Module):
    """LDR map [N, 3, 64, 128] in [0, 1] -> ln radiance [N, 3, 64, 128]."""

    def __init__(self, widths: tuple[int, ...] = (16, 32, 64, 128)) -> None:
        super().__init__()
        self.body = nn.Sequential(Wrap(16), UNet(3, widths), Unwrap(16))
        self.head = nn.Conv2d(widths[0], 3, 1)

    def forward(self, ldr: torch.Tensor) -> torch.Tensor:
        return self.head(self.body(ldr))


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


NETS = {"irradiance": IrradianceNet, "illumination": IlluminationNet, "hdr": HdrNet}


class Chain:
    """Losses of the three networks; float32 weights, the arithmetic of nets.blocks.autocast."""

    columns = tuple(NETS)

    def __init__(self, config: RunConfig, device: str) -> None:
        self.config, self.device = config, device
        self.nets = self.networks()
        self.nets.to(device, memory_format=torch.channels_last)
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

"""Normals (noun): the network of normals inside lift's, learning alone and so three times as fast.

The whole network is kept in the checkpoint, so that a run of lift can begin from its weights.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.dataset.pairs import Batch
from anyprobe.nets.light_net import LightNet


def normals_loss(normals: torch.Tensor, batch: Batch, where: torch.Tensor | float = 1.0) -> torch.Tensor:
    """Mean of 1 - cos(error) over the object's inner pixels.

    Args:
        normals: unit [N, 3, 64, 64].
        where: [N, 1, 64, 64], 0 where pixels do not count.
    """
    true = F.avg_pool2d(batch.normals, 2)
    inside = (F.avg_pool2d(batch.photo[:, 3:], 2) > 0.99).float() * where
    inside = inside * (true.square().sum(dim=1, keepdim=True) > 0.25)
    along = (F.normalize(true, dim=1) * normals).sum(dim=1, keepdim=True)
    return ((1 - along) * inside).sum() / inside.sum().clip(min=1.0)


class Normals:
    """Loss of NormalsNet, told nothing; float32 weights, bfloat16 arithmetic."""

    columns = ("normals",)

    def __init__(self, config: object, device: str) -> None:
        self.device = device
        self.nets = self.networks()
        self.nets.to(device, memory_format=torch.channels_last)

    @staticmethod
    def networks() -> nn.ModuleDict:
        """Untrained."""
        return nn.ModuleDict({"light": LightNet()})

    def losses(self, batch: Batch, progress: float) -> dict[str, torch.Tensor]:
        """The same whatever the progress."""
        return {"normals": normals_loss(self._guess(batch), batch)}

    def pictures(self, batch: Batch) -> tuple[torch.Tensor, ...]:
        """Photos, true normals and those it guesses, as colours: (n + 1) / 2 inside the mask."""
        inside = F.avg_pool2d(batch.photo[:, 3:], 2)
        true, guess = F.avg_pool2d(batch.normals, 2), self._guess(batch) * inside
        return batch.photo[:, :3], 0.5 + 0.5 * true, 0.5 + 0.5 * guess

    def _guess(self, batch: Batch) -> torch.Tensor:
        net = self.nets["light"]
        with torch.autocast(torch.device(self.device).type, dtype=torch.bfloat16):
            photo = batch.photo.contiguous(memory_format=torch.channels_last)
            return net.normals(photo, *net.eye(batch.tan_half[:, None]))

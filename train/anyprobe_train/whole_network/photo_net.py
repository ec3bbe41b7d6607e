"""The object alone, then the whole photo: LightNet and WholeNet as one network."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn

from anyprobe_train.nets.blocks import autocast
from anyprobe_train.nets.claims import AS_CALIBRATED, claims_of
from anyprobe_train.nets.light_net import LightNet, LightPrediction
from anyprobe_train.nets.whole_net import WholeNet, WholePrediction

Answers = tuple[LightPrediction, WholePrediction]


class PhotoNet(nn.Module):
    """A batch of photos by name -> answers for the object alone and for the whole photo.

    photo [N, 4, 128, 128], display RGB times mask, and mask; tan_half [N, 1]; surroundings [N, 4, 64, 128]; context
    [N, 5, 96, 96]; given_up [N, 3]; optional given_normals [N, 3, 64, 64] and material [N, 8] of LightNet.
    """

    def __init__(self) -> None:
        super().__init__()
        self.light, self.whole = LightNet(), WholeNet()

    def forward(self, batch: Mapping[str, torch.Tensor], object_learns: bool = True) -> Answers:
        """Answer a batch; object_learns: whether gradients reach what sees the object."""
        known = tuple(batch.get(name) for name in ("photo", "tan_half", "given_normals", "surroundings", "material"))
        device = batch["photo"].device
        with torch.set_grad_enabled(object_learns and torch.is_grad_enabled()), autocast(device):
            alone = self.light(*known)
        confidence, said = claims_of(alone, AS_CALIBRATED)
        lift = torch.cat([alone.ln_expected, alone.ln_radiance, confidence], dim=1).clamp(-15.0, 11.0)
        with autocast(device):
            whole = self.whole(
                batch["context"],
                batch["tan_half"],
                lift,
                said.clamp(max=100.0),
                batch["surroundings"],
                batch["given_up"],
            )
        return alone, whole

"""PhotoNet's export: an ONNX graph of each of its parts, weights stored small, checked against torch."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch import nn

from anyprobe.estimate.runtime import CONTEXT_SIZE, WHOLE, WHOLE_INPUTS, WHOLE_OUTPUTS
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe_train.nets.whole_net import SAID, WholeNet
from anyprobe_train.train.export_onnx import AS_CALIBRATED, CONVOLUTIONS, LINEAR_LAYERS, Graph, export_stage, graphs_of
from anyprobe_train.whole_network.whole_training import load_photo_net

TOLERANCE = 0.03
"""Largest median difference of ln radiance that storing weights in eight bits may make."""


class WholeGraph(nn.Module):
    """Outputs of WholeNet in the order of WHOLE_OUTPUTS: ln radiance with light sources of their sizes, ln radiance
    with their power spread as likely as it is, confidence [N, 1, 64, 128] in [0, 1], and posture [N, 3]: pitch
    downwards, its mean error and roll, in radians in the crop's frame."""

    def __init__(self, net: WholeNet) -> None:
        super().__init__()
        self.net = net

    def forward(
        self,
        context: torch.Tensor,
        tan_half: torch.Tensor,
        alone_expected: torch.Tensor,
        alone_radiance: torch.Tensor,
        alone_confidence: torch.Tensor,
        posterior: torch.Tensor,
        surroundings: torch.Tensor,
        up: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        lift = torch.cat([alone_expected, alone_radiance, alone_confidence], dim=1)
        guess = self.net(context, tan_half, lift, posterior, surroundings, up)
        pitch, ln_error, roll, _ = guess.posture.split(1, dim=1)
        posture = torch.cat([pitch, torch.exp(ln_error), roll], dim=1)
        return guess.ln_radiance, guess.ln_expected, torch.sigmoid(guess.confidence_logit), posture


def example_inputs() -> dict[str, torch.Tensor]:
    """One photo's, smooth, by the names of WHOLE_INPUTS."""
    generator = torch.Generator().manual_seed(0)

    def smooth(channels: int, *size: int) -> torch.Tensor:
        coarse = torch.rand((1, channels, 4, 8), generator=generator)
        return nn.functional.interpolate(coarse, size=size, mode="bilinear", align_corners=False)

    rows = MAP_HEIGHT, 2 * MAP_HEIGHT
    values = {
        "context": smooth(5, CONTEXT_SIZE, CONTEXT_SIZE),
        "tan_half": torch.full((1, 1), 0.2),
        "alone_expected": 3 * smooth(3, *rows) - 2,
        "alone_radiance": 3 * smooth(3, *rows) - 2,
        "alone_confidence": smooth(1, *rows),
        "posterior": torch.full((1, SAID), 0.3),
        "surroundings": smooth(4, *rows),
        "up": torch.zeros(1, 3),
    }
    return {name: values[name] for name in WHOLE_INPUTS}


def export_photo_net(
    checkpoint: Path, folder: Path, start: Sequence[Path] = (), share: float = 0.0
) -> dict[str, float]:
    """Write folder/light.onnx and folder/whole.onnx and return each one's largest median difference from torch;
    ModelError where that is more than its tolerance. start, share: see load_photo_net."""
    net, run = load_photo_net(checkpoint, start, share)
    recipe = {"run": run["name"], "steps": str(run["step"]), "pairs": str(run["step"] * run["batch"])}
    recipe["config"] = json.dumps(run)
    about = {**recipe, "sureness": " ".join(f"{v:g}" for v in AS_CALIBRATED.numbers)}
    (graph,) = graphs_of(nn.ModuleDict({"light": net.light}), AS_CALIBRATED).values()
    light = export_stage("light", graph, about, folder / "light.onnx")
    inputs = example_inputs()
    graph = Graph(
        net=WholeGraph(net.whole).eval(),
        inputs={name: tuple(value.shape) for name, value in inputs.items()},
        outputs=WHOLE_OUTPUTS,
        typical=np.median,
        small=(LINEAR_LAYERS, CONVOLUTIONS),
    )
    path = folder / f"{WHOLE}.onnx"
    return {"light": light, WHOLE: export_stage(WHOLE, graph, recipe, path, tuple(inputs.values()), TOLERANCE)}

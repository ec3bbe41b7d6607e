"""LightNet and WholeNet as the one graph that ships: weights stored small, checked against torch."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.estimate.photo import CONTEXT_SIZE
from anyprobe.estimate.runtime import CONTRACT, NORMALS_SIZE, PHOTO_SIZE
from anyprobe.files.atomic import atomic_path
from anyprobe.given_material import MATERIAL_INPUTS
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.nets.whole_net import WholeNet
from anyprobe.train.export_onnx import LightGraph, store_half, store_int8
from research.whole_network.looks import load_light_graph
from research.whole_network.train import load_whole_net

TOLERANCE = 0.08
"""Largest median difference of ln radiance that storing weights in eight bits may make."""
INPUTS = {
    "photo": (4, PHOTO_SIZE, PHOTO_SIZE),
    "tan_half": (1,),
    "given_normals": (3, NORMALS_SIZE, NORMALS_SIZE),
    "surroundings": (4, MAP_HEIGHT, 2 * MAP_HEIGHT),
    "material": (MATERIAL_INPUTS,),
    "context": (5, CONTEXT_SIZE, CONTEXT_SIZE),
    "up": (3,),
}
OUTPUTS = (
    "irradiance", "ln_radiance", "confidence", "normals", "ln_expected", "posterior", "posture", "density",
)  # fmt: skip


class OneGraph(nn.Module):
    """Photo to light in one pass: LightNet on the object, then WholeNet on its answer and on what lies around it.

    Inputs by the names and shapes of INPUTS, context and surroundings zero where only the object is known. Outputs:
    irradiance [N, 3, 128, 128] display; ln_radiance [N, 3, 64, 128] with sources of their own sizes; confidence
    [N, 1, 64, 128] in [0, 1]; normals [N, 3, 64, 64]; ln_expected [N, 3, 64, 128], power spread as likely as it is;
    posterior [N, 7]; posture [N, 3], pitch downwards, its mean error and roll in radians; density [N, 1, 64, 128] of
    the power above white, per steradian.
    """

    def __init__(self, light: LightGraph, whole: WholeNet) -> None:
        super().__init__()
        self.light, self.whole = light, whole

    def forward(
        self,
        photo: torch.Tensor,
        tan_half: torch.Tensor,
        given_normals: torch.Tensor,
        surroundings: torch.Tensor,
        material: torch.Tensor,
        context: torch.Tensor,
        up: torch.Tensor,
    ) -> tuple[torch.Tensor, ...]:
        alone = self.light.net(photo, tan_half, given_normals, surroundings, material)
        irradiance, drawn, confidence, normals, expected, posterior = self.light.outputs(alone)
        lift = torch.cat([expected, drawn, confidence], dim=1)
        guess = self.whole(context, tan_half, lift, posterior, surroundings, up, alone.lifted, alone.code)
        pitch, ln_error, roll, _ = guess.posture.split(1, dim=1)
        posture = torch.cat([pitch, torch.exp(ln_error), roll], dim=1)
        density = self.whole.emitters.density(guess.logit)
        confidence = torch.sigmoid(guess.confidence_logit)
        return irradiance, guess.ln_radiance, confidence, normals, guess.ln_expected, posterior, posture, density


def example_inputs() -> dict[str, torch.Tensor]:
    """Return one photo's inputs, smooth, by the names of INPUTS."""
    generator = torch.Generator().manual_seed(0)

    def smooth(channels: int, *size: int) -> torch.Tensor:
        coarse = torch.rand((1, channels, 4, 8), generator=generator)
        return nn.functional.interpolate(coarse, size=size, mode="bilinear", align_corners=False)

    values = {name: smooth(*shape) for name, shape in INPUTS.items() if len(shape) == 3}
    values |= {
        "tan_half": torch.full((1, 1), 0.2),
        "material": torch.zeros(1, MATERIAL_INPUTS),
        "up": torch.zeros(1, 3),
    }
    values["given_normals"] = torch.zeros_like(values["given_normals"])
    return {name: values[name] for name in INPUTS}


def export_one(checkpoint: Path, light: Path, folder: Path) -> float:
    """Write folder/light.onnx of a run and of LightNet; return the largest median difference from torch.

    Raises:
        ModelError: the graph disagrees with the networks by more than TOLERANCE.
    """
    import onnx

    from anyprobe.files.onnx_runtime import onnxruntime

    net, run = load_whole_net(checkpoint)
    graph, inputs = OneGraph(load_light_graph(light), net).eval(), example_inputs()
    recipe = {"run": run["name"], "steps": str(run["step"]), "pairs": str(run["step"] * run["batch"])}
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_path(folder / "light.onnx") as temporary:
        torch.onnx.export(
            graph,
            tuple(inputs.values()),
            str(temporary),
            input_names=list(inputs),
            output_names=list(OUTPUTS),
            dynamic_axes={name: {0: "n"} for name in (*inputs, *OUTPUTS)},
            opset_version=17,
            dynamo=False,
            do_constant_folding=False,  # else two matrices of 512 x 512 are stored that are made in no time
        )
        model = onnx.load(str(temporary))
        store_half(model)
        store_int8(model, (4,))
        about = {**CONTRACT, "stage": "light", "computes": "float32", "config": json.dumps(run)}
        onnx.helper.set_model_props(model, {**about, **recipe})
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = graph(*inputs.values())
        found = session.run(None, {name: value.numpy() for name, value in inputs.items()})
        differences = {
            n: float(np.median(np.abs(a - b.numpy()))) for n, a, b in zip(OUTPUTS, found, expected, strict=True)
        }
        off = max(differences.values())
        if not off <= TOLERANCE:
            raise ModelError(f"light: expected ONNX within {TOLERANCE} of torch, got {differences}")
    return off

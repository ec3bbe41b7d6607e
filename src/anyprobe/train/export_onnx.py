"""Checkpoint -> ONNX graph with its contract, half-float storage, checked against torch."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.infer.runtime import CONTRACT, PHOTO_SIZE, STAGES
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.train.chain import load_nets

INPUT_SHAPES = {
    "irradiance": (1, 4, PHOTO_SIZE, PHOTO_SIZE),
    "illumination": (1, 4, PHOTO_SIZE, PHOTO_SIZE),
    "hdr": (1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT),
}
TOLERANCE = 0.02
"""Largest difference of display values or ln radiance that half-float storage may make."""


def export(checkpoint: Path, folder: Path) -> dict[str, float]:
    """Write the three graphs of a chain and return each one's largest difference from torch.

    Raises:
        ModelError: a graph disagrees with its network by more than TOLERANCE.
    """
    nets = load_nets(checkpoint)
    stored = torch.load(checkpoint, map_location="cpu", weights_only=True)
    config = json.loads(stored["config"])
    recipe = {
        "run": config["name"],
        "steps": str(stored["step"]),
        "pairs": str(stored["step"] * config["pairs"]["batch"]),
        "config": stored["config"],
    }
    return {stage: _export_stage(stage, nets[stage], recipe, folder / f"{stage}.onnx") for stage in STAGES}


def _export_stage(stage: str, net: nn.Module, recipe: dict[str, str], path: Path) -> float:
    """One network: batch normalisation folded, weights stored as float16, computed as float32."""
    import onnx
    import onnxruntime

    example = torch.rand(INPUT_SHAPES[stage], generator=torch.Generator().manual_seed(0))
    with atomic_path(path) as temporary:
        torch.onnx.export(
            net,
            (example,),
            str(temporary),
            input_names=["input"],
            output_names=["output"],
            dynamic_axes={"input": {0: "n"}, "output": {0: "n"}},
            opset_version=17,
            dynamo=False,
        )
        model = onnx.load(str(temporary))
        store_half(model)
        onnx.helper.set_model_props(model, {**CONTRACT, "stage": stage, **recipe})
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = net(example).numpy()
        difference = float(np.abs(session.run(None, {"input": example.numpy()})[0] - expected).max())
        if not difference <= TOLERANCE:
            raise ModelError(f"{stage}: expected ONNX within {TOLERANCE} of torch, got {difference:.3g}")
    return difference


def store_half(model) -> None:
    """Keep large float32 weights as float16 behind a Cast; the runtime widens them once, when it opens."""
    import onnx
    from onnx import numpy_helper

    casts = []
    for tensor in list(model.graph.initializer):
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < 1024:
            continue
        name = tensor.name
        model.graph.initializer.remove(tensor)
        model.graph.initializer.append(numpy_helper.from_array(values.astype(np.float16), name + "_half"))
        casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    for node in reversed(casts):
        model.graph.node.insert(0, node)

"""Checkpoint -> ONNX graph with its contract, half-float storage, checked against torch."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.infer.runtime import CONTRACT, PHOTO_SIZE, STAGES
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.train.stages import load_net

INPUT_SHAPES = {
    "irradiance": (1, 4, PHOTO_SIZE, PHOTO_SIZE),
    "illumination": (1, 4, PHOTO_SIZE, PHOTO_SIZE),
    "hdr": (1, 3, MAP_HEIGHT, 2 * MAP_HEIGHT),
}
TOLERANCE = 0.02
"""Largest difference of display values or ln radiance that half-float storage may make."""


def export(runs: Path, folder: Path) -> dict[str, float]:
    """Write the three graphs of a chain and return each one's largest difference from torch.

    Raises:
        ModelError: a graph disagrees with its network by more than TOLERANCE.
    """
    return {stage: export_stage(runs, stage, folder / f"{stage}.onnx") for stage in STAGES}


def export_stage(runs: Path, stage: str, path: Path) -> float:
    """Export one network: batch normalisation folded, weights stored as float16, computed as float32."""
    import onnx
    import onnxruntime

    net = load_net(runs, stage).to(memory_format=torch.contiguous_format)
    stored = torch.load(runs / stage / "checkpoint.pt", map_location="cpu", weights_only=True)
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
        _store_half(model)
        config = json.loads(stored["config"])
        metadata = {
            **CONTRACT,
            "stage": stage,
            "steps": str(stored["step"]),
            "pairs": str(stored["step"] * config["pairs"]["batch"]),
            "config": stored["config"],
        }
        onnx.helper.set_model_props(model, metadata)
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = net(example).numpy()
        difference = float(np.abs(session.run(None, {"input": example.numpy()})[0] - expected).max())
        if not difference <= TOLERANCE:
            raise ModelError(f"{stage}: expected ONNX within {TOLERANCE} of torch, got {difference:.3g}")
    return difference


def _store_half(model) -> None:
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

"""The mask network's export: one ONNX graph with its contract, its weights stored small, checked against torch."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path
from anyprobe.learning.mask_network.mask_training import load_mask_net
from anyprobe.learning.train.export_onnx import store_half, store_int8
from anyprobe.masks.networks import MASK_CONTRACT, SMALL_PX

TOLERANCE = 0.01
"""Largest mean difference of the cover between graph and network."""


def export_mask(checkpoint: Path, folder: Path) -> float:
    """Write folder/mask.onnx: "input" [1, 4, 160, 160] to "output" [1, 1, 160, 160]; return its mean difference from
    torch.

    Raises:
        ModelError: the graph disagrees with the network by more than TOLERANCE.
    """
    import onnx

    from anyprobe.files.onnx_runtime import onnxruntime

    net, run = load_mask_net(checkpoint)
    recipe = {
        "run": run["name"],
        "steps": str(run["step"]),
        "scenes": str(run["scenes"]["scenes"] + run["step"] * run["scenes"]["fresh"]),
        "config": json.dumps(run),
    }
    example = torch.rand((1, 4, SMALL_PX, SMALL_PX), generator=torch.Generator().manual_seed(0))
    with atomic_path(folder / "mask.onnx") as temporary:
        torch.onnx.export(
            net,
            (example,),
            str(temporary),
            input_names=["input"],
            output_names=["output"],
            opset_version=17,
            dynamo=False,
        )
        model = onnx.load(str(temporary))
        store_half(model)
        store_int8(model)
        onnx.helper.set_model_props(model, {**MASK_CONTRACT, **recipe})
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = net(example).numpy()
        difference = float(np.abs(session.run(None, {"input": example.numpy()})[0] - expected).mean())
        if not difference <= TOLERANCE:
            raise ModelError(f"mask: expected ONNX within {TOLERANCE} of torch, got {difference:.3g}")
    return difference

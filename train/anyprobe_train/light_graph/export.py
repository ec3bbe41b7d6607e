"""Export of a network with front and back as light.onnx: python -m anyprobe_train.light_graph.export."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import torch

from anyprobe.estimate.light_graph import INPUTS, OUTPUTS, graph_inputs
from anyprobe.estimate.runtime import CONTRACT
from anyprobe_train.light_graph.today import PhotoGraph
from anyprobe_train.train.export_onnx import AS_CALIBRATED, CONVOLUTIONS, FLOATS, LINEAR_LAYERS, Graph, write_graph
from anyprobe_train.whole_network.photo_net import PhotoNet

TOLERANCE = 0.02
"""Largest median difference of any output from torch that compact storage may cause."""
DYNAMIC = {
    "photo": {1: "height", 2: "width"},
    "window": {1: "window_height", 2: "window_width"},
    "normals": {1: "normals_height", 2: "normals_width"},
}


def smooth_photo() -> tuple[torch.Tensor, ...]:
    """Return those of a smooth photo of a ball, in the order of INPUTS."""
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:96, :128]
    mask = ((rows - 54) ** 2 + (columns - 60) ** 2 < 24**2).astype(np.float32)
    waves = rng.uniform(0.02, 0.12, (3, 2))
    rgb = np.stack([0.5 + 0.4 * np.sin(a * rows + b * columns) for a, b in waves], axis=-1).astype(np.float32)
    given = graph_inputs(rgb, mask, 60.0)
    return tuple(torch.from_numpy(given[name]) for name in INPUTS)


def export_light(net: PhotoNet, path: Path, recipe: dict[str, str]) -> float:
    """Write light.onnx of a network; return its largest median difference from torch."""
    graph = Graph(
        net=PhotoGraph(net).eval(),
        inputs={name: tuple(value.shape) for name, value in zip(INPUTS, smooth_photo(), strict=True)},
        outputs=OUTPUTS,
        typical=np.median,
        small=(LINEAR_LAYERS, CONVOLUTIONS),
        dynamic=DYNAMIC,
        exact="net.light",
    )
    about = {**CONTRACT, "stage": "light", "computes": FLOATS, **recipe}
    about["sureness"] = " ".join(f"{value:g}" for value in AS_CALIBRATED.numbers)
    return write_graph("light", graph, smooth_photo(), about, path, TOLERANCE)


def recipe_of(run: dict) -> dict[str, str]:
    """Return what a graph's metadata say of the run that its weights are from."""
    recipe = {"run": run["name"], "steps": str(run["step"]), "pairs": str(run["step"] * run["batch"])}
    return {**recipe, "config": json.dumps(run)}

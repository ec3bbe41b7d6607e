"""Export of checkpoints to ONNX graphs with their contract, in compact storage, checked against torch."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from anyprobe.errors import ModelError
from anyprobe.estimate.light_graph import INPUTS, OUTPUTS
from anyprobe.estimate.runtime import CONTRACT, LIGHT_STAGE
from anyprobe.files.atomic import atomic_path
from anyprobe_train.light_graph.photo_graph import LIGHT_AXES, PhotoGraph, smooth_photo
from anyprobe_train.nets.claims import AS_LEARNED, Sureness
from anyprobe_train.nets.light_net import LightNet
from anyprobe_train.nets.whole_net import WholeNet
from anyprobe_train.train.checkpoint import read_checkpoint
from anyprobe_train.train.loop import load_nets, pairs_seen

FLOATS = "float32"
"""Precision that a graph computes in, as its metadata states it."""
LARGE = 8192
"""Smallest number of weights of a layer that is stored as int8, with a scale per output channel."""
LINEAR_LAYERS, CONVOLUTIONS = 2, 4
"""Kinds of layers, by the number of dimensions of their weights."""
TOLERANCE, LIGHT_TOLERANCE = 0.02, 0.03
"""Largest difference that compact storage may cause: of display values or ln radiance, in the median; of any output of
light.onnx, whose harmonics are larger."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Graph:
    """One graph: its network, and the shapes of its inputs and names of its outputs in order.

    typical: of the differences from torch; their median, where a last bit may move a pixel to its neighbour.
    small: which layers keep their weights as int8, see store_int8.
    exact: beginning of the names of linear layers that keep theirs as float16.
    dynamic: names of the axes of inputs that may have other lengths; None: the first of each, so that it takes several
        examples at a time.
    """

    net: nn.Module
    inputs: dict[str, tuple[int, ...]]
    outputs: tuple[str, ...] = ("output",)
    typical: Callable[[np.ndarray], float] = np.max
    small: tuple[int, ...] = ()
    exact: str | None = None
    dynamic: dict[str, dict[int, str]] | None = None


def light_graph(light: LightNet, whole: WholeNet | None, sureness: Sureness) -> Graph:
    """Return the graph of the whole way from a photo to its light, see estimate.light_graph; without WholeNet, by the
    object alone."""
    return Graph(
        net=PhotoGraph(light, whole, sureness).eval(),
        inputs={name: tuple(value.shape) for name, value in zip(INPUTS, smooth_photo(), strict=True)},
        outputs=OUTPUTS,
        typical=np.median,
        small=(LINEAR_LAYERS, CONVOLUTIONS),
        exact="light.",
        dynamic=LIGHT_AXES,
    )


def export_graphs(checkpoint: Path, folder: Path, sureness: Sureness = AS_LEARNED) -> dict[str, float]:
    """Write the graphs of a run; return each one's largest difference from torch, ModelError if beyond
    LIGHT_TOLERANCE."""
    nets = load_nets(checkpoint)
    stored = read_checkpoint(checkpoint)
    config = json.loads(stored["config"])
    recipe = {
        "run": config["name"],
        "steps": str(stored["step"]),
        "pairs": str(pairs_seen(stored)),
        "config": stored["config"],
        "sureness": " ".join(f"{value:g}" for value in sureness.numbers),
        **provenance(stored),
    }
    graph = light_graph(cast(LightNet, nets[LIGHT_STAGE]), None, sureness)
    return {LIGHT_STAGE: export_stage(LIGHT_STAGE, graph, recipe, folder / f"{LIGHT_STAGE}.onnx")}


def provenance(stored: Mapping[str, Any]) -> dict[str, str]:
    """Return the provenance of a checkpoint's weights besides its own steps, as far as known:

    start           identity of the file of weights that the run started from, or "nothing"
    assets          the maps and shapes of its data, as dataloader.name_assets has them
    mean_with       identity of the file of weights that they are the mean with
    mean_with_pairs the pairs that those have seen
    mean_with_share how much of the mean those are
    """
    origin, other = stored.get("origin", {}), stored.get("mean_with", {})
    known = {
        "start": (origin["start"] or "nothing") if "start" in origin else None,
        "assets": origin.get("assets"),
        "mean_with": other.get("start"),
        "mean_with_pairs": other.get("pairs"),
        "mean_with_share": other.get("share"),
    }
    return {name: str(value) for name, value in known.items() if value is not None}


def export_stage(
    stage: str,
    graph: Graph,
    recipe: dict[str, str],
    path: Path,
    examples: tuple[torch.Tensor, ...] | None = None,
    tolerance: float | None = None,
) -> float:
    """Export one network of a model, see write_graph; examples: random ones if None, tolerance: TOLERANCE."""
    if stage == LIGHT_STAGE:
        examples, tolerance = examples or smooth_photo(), tolerance or LIGHT_TOLERANCE
    if examples is None:
        generator = torch.Generator().manual_seed(0)
        examples = tuple(_smooth(shape, generator) for shape in graph.inputs.values())
    about = {**CONTRACT, "stage": stage, "computes": FLOATS, **recipe}
    return write_graph(stage, graph, examples, about, path, TOLERANCE if tolerance is None else tolerance)


def write_graph(
    name: str, graph: Graph, examples: tuple[torch.Tensor, ...], about: dict[str, str], path: Path, tolerance: float
) -> float:
    """Write a graph with its metadata: batch normalisation folded, weights stored small, computed as float32.

    Return the typical difference of its outputs for the examples from torch's, relative where they are above 1, as
    degrees are; ModelError if it is more than tolerance.
    """
    import onnx

    from anyprobe.files.graphs import onnxruntime

    every_first = {name: {0: "n"} for name in (*graph.inputs, *graph.outputs)}
    with atomic_path(path) as temporary:
        torch.onnx.export(
            graph.net,
            examples,
            str(temporary),
            input_names=list(graph.inputs),
            output_names=list(graph.outputs),
            dynamic_axes=every_first if graph.dynamic is None else graph.dynamic,
            opset_version=17,
            dynamo=False,
        )
        model = onnx.load(str(temporary))
        store_half(model)
        if graph.small:
            store_int8(model, graph.small, graph.exact)
        onnx.helper.set_model_props(model, about)
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = graph.net(*examples)
        expected = (expected,) if isinstance(expected, torch.Tensor) else expected
        outputs = session.run(None, dict(zip(graph.inputs, (example.numpy() for example in examples), strict=True)))
        off = (
            np.abs(a - b.numpy()) / np.maximum(1.0, np.abs(b.numpy())) for a, b in zip(outputs, expected, strict=True)
        )
        difference = max(float(graph.typical(one)) for one in off)
        if not difference <= tolerance:
            raise ModelError(
                f"expected ONNX within {tolerance} of torch, got {difference:.3g}: the weights do not bear "
                "compact storage; train further; --keep FILE saves them all the same",
                source=name,
            )
    return difference


def _smooth(shape: tuple[int, ...], generator: torch.Generator) -> torch.Tensor:
    """Draw a picture in [0, 1] as smooth as photos, since in noise a last bit may flip a normal."""
    coarse = torch.rand((*shape[:2], 8, 8), generator=generator)
    return F.interpolate(coarse, size=shape[2:], mode="bilinear", align_corners=False)


def store_half(model) -> None:
    """Store large float32 weights as float16 behind a Cast, equal ones once; the runtime widens them when it opens."""
    import onnx
    from onnx import numpy_helper

    exact: set[str] = set()
    for node in [node for node in model.graph.node if node.op_type == "Constant"]:  # the tracer writes each use anew
        tensor = next((a.t for a in node.attribute if a.HasField("t")), None)
        if tensor is not None and numpy_helper.to_array(tensor).size >= 1024:
            tensor.name = node.output[0]
            model.graph.initializer.append(tensor)
            model.graph.node.remove(node)
            exact.add(tensor.name)  # directions and the like, whose angles half floats would blur
    casts: list[Any] = []
    first_of: dict[Any, str] = {}
    renamed: dict[str, str] = {}
    for tensor in list(model.graph.initializer):
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32 or values.size < 1024:
            continue
        name = tensor.name
        first = first_of.setdefault((values.shape, values.tobytes()), name)
        if first == name and name in exact:
            continue
        model.graph.initializer.remove(tensor)
        if first != name:
            renamed[name] = first
            continue
        model.graph.initializer.append(numpy_helper.from_array(values.astype(np.float16), name + "_half"))
        casts.append(onnx.helper.make_node("Cast", [name + "_half"], [name], to=onnx.TensorProto.FLOAT))
    for node in model.graph.node:
        node.input[:] = [renamed.get(name, name) for name in node.input]
    for node in reversed(casts):
        model.graph.node.insert(0, node)


def store_int8(model, kinds: tuple[int, ...] = (LINEAR_LAYERS, CONVOLUTIONS), exact: str | None = None) -> None:
    """Store the halved weights of large layers of some kinds as int8 behind a DequantizeLinear.

    store_half must come before; the runtime widens the weights once, when it opens.
    exact: beginning of the names of layers that stay as they are.
    """
    import onnx
    from onnx import numpy_helper

    for node in [one for one in model.graph.node if one.op_type == "Cast"]:
        tensor = next((one for one in model.graph.initializer if one.name == node.input[0]), None)
        if tensor is None or len(tensor.dims) not in kinds or np.prod(tensor.dims) < LARGE:
            continue
        if exact is not None and tensor.name.startswith(exact):
            continue
        name, values = node.output[0], numpy_helper.to_array(tensor).astype(np.float32)
        scale = np.maximum(np.abs(values).reshape(len(values), -1).max(axis=1), 1e-8) / 127
        steps = np.round(values / scale.reshape(-1, *[1] * (values.ndim - 1))).astype(np.int8)
        model.graph.initializer.remove(tensor)
        parts = {"int8": steps, "scale": scale, "zero": np.zeros(len(values), np.int8)}
        model.graph.initializer.extend(numpy_helper.from_array(part, f"{name}_{kind}") for kind, part in parts.items())
        widened = onnx.helper.make_node("DequantizeLinear", [f"{name}_{kind}" for kind in parts], [name], axis=0)
        place = list(model.graph.node).index(node)
        model.graph.node.remove(node)
        model.graph.node.insert(place, widened)

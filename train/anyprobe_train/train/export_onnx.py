"""Export of checkpoints to ONNX graphs with their contract, in compact storage, checked against torch."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path

FLOATS = "float32"
"""Precision that a graph computes in, as its metadata states it."""
LARGE = 8192
"""Smallest number of weights of a layer that is stored as int8, with a scale per output channel."""
LINEAR_LAYERS, CONVOLUTIONS = 2, 4
"""Kinds of layers, by the number of dimensions of their weights."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Graph:
    """One graph: its network, and the shapes of its inputs and names of its outputs in order.

    typical: of the differences from torch; their median, where a last bit may move a pixel to its neighbour.
    ranked: outputs of which only the first row is compared, as a last bit may exchange the others.
    small: which layers keep their weights as int8, see store_int8.
    dynamic: names of the axes of inputs that may have other lengths; None: the first of each, so that it takes several
        examples at a time.
    """

    net: nn.Module
    inputs: dict[str, tuple[int, ...]]
    outputs: tuple[str, ...] = ("output",)
    typical: Callable[[np.ndarray], float] = np.max
    ranked: tuple[str, ...] = ()
    small: tuple[int, ...] = ()
    dynamic: dict[str, dict[int, str]] | None = None


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
            store_int8(model, graph.small)
        onnx.helper.set_model_props(model, about)
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = graph.net(*examples)
        expected = (expected,) if isinstance(expected, torch.Tensor) else expected
        outputs = session.run(None, dict(zip(graph.inputs, (example.numpy() for example in examples), strict=True)))
        differences = []
        for output, ours, torchs in zip(graph.outputs, outputs, expected, strict=True):
            rows = slice(1 if output in graph.ranked else None)
            a, b = ours[:, rows], torchs.numpy()[:, rows]
            differences.append(float(graph.typical(np.abs(a - b) / np.maximum(1.0, np.abs(b)))))
        difference = max(differences)
        if not difference <= tolerance:
            raise ModelError(
                f"expected ONNX within {tolerance} of torch, got {difference:.3g}: the weights do not bear "
                "compact storage; train further; --keep FILE saves them all the same",
                source=name,
            )
    return difference


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


def store_int8(model, kinds: tuple[int, ...] = (LINEAR_LAYERS, CONVOLUTIONS)) -> None:
    """Store the halved weights of large layers of some kinds as int8 behind a DequantizeLinear.

    store_half must come before; the runtime widens the weights once, when it opens.
    """
    import onnx
    from onnx import numpy_helper

    for node in [one for one in model.graph.node if one.op_type == "Cast"]:
        tensor = next((one for one in model.graph.initializer if one.name == node.input[0]), None)
        if tensor is None or len(tensor.dims) not in kinds or np.prod(tensor.dims) < LARGE:
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

"""Export of checkpoints to ONNX graphs with their contract, in compact storage, checked against torch."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from anyprobe.errors import ModelError
from anyprobe.files.atomic import atomic_path

FLOATS = "float32"
"""Precision that a graph computes in, as its metadata states it."""
LARGE, LAYERS = 8192, (2, 4)
"""Smallest number of weights of a layer that is stored as int8, with a scale per output channel; and dimensions of the
weights of layers that are: linear ones and convolutions."""


def write_graph(
    net: nn.Module,
    inputs: dict[str, torch.Tensor],
    outputs: tuple[str, ...],
    about: dict[str, str],
    path: Path,
    *,
    tolerance: float,
    dynamic: dict[str, dict[int, str]],
    typical: Callable[[np.ndarray], float] = np.median,
    ranked: tuple[str, ...] = (),
) -> float:
    """Write a graph with its metadata: batch normalisation folded, weights stored small, computed as float32.

    Return the typical difference of its outputs for the inputs from torch's, relative where they are above 1, as
    degrees are; ModelError if it is more than tolerance.

    Args:
        inputs: examples by name; outputs: names; both in order. about: metadata.
        dynamic: names of the axes of inputs and outputs that may have other lengths.
        typical: of the differences from torch; their median, where a last bit may move a pixel to its neighbour.
        ranked: outputs of which only the first row is compared, as a last bit may exchange the others.
    """
    import onnx

    from anyprobe.files.graphs import onnxruntime

    examples = tuple(inputs.values())
    with atomic_path(path) as temporary:
        torch.onnx.export(
            net,
            examples,
            str(temporary),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes=dynamic,
            opset_version=17,
            dynamo=False,
        )
        model = onnx.load(str(temporary))
        store_small(model)
        onnx.helper.set_model_props(model, about)
        onnx.checker.check_model(model)
        onnx.save(model, str(temporary))
        session = onnxruntime.InferenceSession(str(temporary), providers=["CPUExecutionProvider"])
        with torch.no_grad():
            expected = net(*examples)
        expected = (expected,) if isinstance(expected, torch.Tensor) else expected
        found = session.run(None, {name: example.numpy() for name, example in inputs.items()})
        differences = []
        for output, ours, torchs in zip(outputs, found, expected, strict=True):
            rows = slice(1 if output in ranked else None)
            a, b = ours[:, rows], torchs.numpy()[:, rows]
            differences.append(float(typical(np.abs(a - b) / np.maximum(1.0, np.abs(b)))))
        difference = max(differences)
        if not difference <= tolerance:
            raise ModelError(
                f"expected ONNX within {tolerance} of torch, got {difference:.3g}: the weights do not bear "
                "compact storage; train further; --keep FILE saves them all the same",
                source=path.stem,
            )
    return difference


def store_small(model) -> None:
    """Store large float32 weights small, equal ones once, each behind a node that widens them when the runtime opens.

    Large LAYERS become int8, with a scale for each output channel; all others float16.
    """
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
    widened: list[Any] = []
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
        half = values.astype(np.float16)
        if half.ndim in LAYERS and half.size >= LARGE:
            values = half.astype(np.float32)
            scale = np.maximum(np.abs(values).reshape(len(values), -1).max(axis=1), 1e-8) / 127
            steps = np.round(values / scale.reshape(-1, *[1] * (values.ndim - 1))).astype(np.int8)
            parts = {"int8": steps, "scale": scale, "zero": np.zeros(len(values), np.int8)}
            widen = partial(onnx.helper.make_node, "DequantizeLinear", axis=0)
        else:
            parts, widen = {"half": half}, partial(onnx.helper.make_node, "Cast", to=onnx.TensorProto.FLOAT)
        model.graph.initializer.extend(numpy_helper.from_array(part, f"{name}_{kind}") for kind, part in parts.items())
        widened.append(widen([f"{name}_{kind}" for kind in parts], [name]))
    for node in reversed(widened):
        model.graph.node.insert(0, node)
    short = {one.name: one.name for one in (*model.graph.input, *model.graph.output)} | {"": ""}
    for number, node in enumerate(model.graph.node):  # names of the tracer's take a quarter of a megabyte
        node.name = f"{number:x}"
        for names in (node.input, node.output):
            names[:] = [short.setdefault(renamed.get(name, name), f"{len(short):x}") for name in names]
    for tensor in model.graph.initializer:
        tensor.name = short.setdefault(tensor.name, f"{len(short):x}")

"""The shipped graph of `lift` without 8-bit operators, for engines that lack QuantizeLinear (Unity Sentis).

    python -m research.export_weights.float_twin FOLDER
    anyprobe estimate photo.jpg --model FOLDER

Its weights are those of the shipped graph, in floats; its activations are not rounded, so that answers differ by what
that rounding changes.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from anyprobe.estimate.runtime import weights_folder
from anyprobe.files.atomic import atomic_path

QUANTIZE, DEQUANTIZE = "QuantizeLinear", "DequantizeLinear"


def float_twin(source: Path, target: Path) -> None:
    """Write a graph in which no tensor is of 8 bits, from one that onnxruntime quantised as QDQ.

    Raises:
        ValueError: an 8-bit tensor that is neither a weight nor between a pair of the two operators.
    """
    import onnx
    from onnx import numpy_helper

    model = onnx.load(str(source))
    graph = model.graph
    stored = {one.name: one for one in graph.initializer}
    rounded = {node.output[0]: node.input[0] for node in graph.node if node.op_type == QUANTIZE}
    renamed: dict[str, str] = {}
    for node in graph.node:
        if node.op_type != DEQUANTIZE:
            continue
        name = node.input[0]
        if name in rounded:
            renamed[node.output[0]] = rounded[name]
        elif name in stored:
            axis = next((one.i for one in node.attribute if one.name == "axis"), 1)
            values = [numpy_helper.to_array(stored[one]) for one in node.input]
            graph.initializer.append(numpy_helper.from_array(_dequantized(values, axis), node.output[0]))
        else:
            raise ValueError(f"{node.name}: expected a weight or a rounded activation, got {name}")
    kept = [node for node in graph.node if node.op_type not in (QUANTIZE, DEQUANTIZE)]
    for node in kept:
        for place, name in enumerate(node.input):
            while name in renamed:
                name = renamed[name]
            node.input[place] = name
    for output in graph.output:
        if output.name in renamed:
            kept.append(onnx.helper.make_node("Identity", [renamed[output.name]], [output.name]))
    del graph.node[:]
    graph.node.extend(kept)
    used = {name for node in kept for name in node.input}
    left = [one for one in graph.initializer if one.name in used]
    del graph.initializer[:]
    graph.initializer.extend(left)
    onnx.checker.check_model(model)
    with atomic_path(target) as temporary:
        temporary.write_bytes(model.SerializeToString())


def _dequantized(values: list[np.ndarray], axis: int) -> np.ndarray:
    """(q - zero) scale, scale and zero a number or one of each slice along an axis; ONNX, DequantizeLinear."""
    q, scale, *zero = values
    shape = [-1 if k == axis else 1 for k in range(q.ndim)] if scale.ndim else []
    offset = zero[0].astype(np.int32).reshape(shape) if zero else 0
    return ((q.astype(np.int32) - offset) * scale.reshape(shape)).astype(np.float32)


def main(to: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder for light.onnx.")]) -> None:
    """Write the float twin of the shipped graph."""
    float_twin(weights_folder("lift") / "light.onnx", to / "light.onnx")
    typer.echo(f"{to / 'light.onnx'}: {(to / 'light.onnx').stat().st_size / 2**20:.1f} MiB")


if __name__ == "__main__":
    typer.run(main)

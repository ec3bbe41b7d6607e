"""The shipped graph of `lift` with its weights in floats, for engines that lack DequantizeLinear (Unity Sentis).

    python -m research.float_twin FOLDER
    anyprobe estimate photo.jpg --model FOLDER

It computes the same: the shipped one keeps weights as int8 and half floats, and widens them when it is opened.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from anyprobe.cli.app import main as run_command
from anyprobe.estimate.runtime import weights_folder
from anyprobe.files.atomic import atomic_path

WIDENED = ("DequantizeLinear", "Cast")


def float_twin(source: Path, target: Path) -> None:
    """Write a graph again with every weight as it is computed with."""
    import onnx
    from onnx import numpy_helper

    model = onnx.load(str(source))
    graph = model.graph
    stored = {one.name: one for one in graph.initializer}
    kept = []
    for node in graph.node:
        if node.op_type not in WIDENED or node.input[0] not in stored:
            kept.append(node)
            continue
        values = [numpy_helper.to_array(stored[name]) for name in node.input]
        wide = _dequantized(*values) if len(values) > 1 else values[0].astype(np.float32)
        graph.initializer.append(numpy_helper.from_array(wide, node.output[0]))
    del graph.node[:]
    graph.node.extend(kept)
    used = {name for node in kept for name in node.input}
    left = [one for one in graph.initializer if one.name in used]
    del graph.initializer[:]
    graph.initializer.extend(left)
    onnx.checker.check_model(model)
    with atomic_path(target) as temporary:
        temporary.write_bytes(model.SerializeToString())


def _dequantized(q: np.ndarray, scale: np.ndarray, zero: np.ndarray) -> np.ndarray:
    """(q - zero) scale along the first axis; ONNX, DequantizeLinear."""
    shape = (-1, *[1] * (q.ndim - 1))
    return ((q.astype(np.int32) - zero.astype(np.int32).reshape(shape)) * scale.reshape(shape)).astype(np.float32)


def main(to: Annotated[Path, Parameter(name="FOLDER", help="Folder for light.onnx.")], /) -> None:
    """Write the float twin of the shipped graph."""
    path = to / "light.onnx"
    float_twin(weights_folder("lift") / path.name, path)
    print(f"{path}: {path.stat().st_size / 2**20:.1f} MiB")


if __name__ == "__main__":
    run_command(main)

"""The float twin of the shipped graph: weights in floats, the same light."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.response import response
from anyprobe.estimate.light_graph import graph_inputs
from anyprobe.estimate.runtime import Models

onnx = pytest.importorskip("onnx")
from support.scenes import sphere_photo  # noqa: E402

from research.float_twin import float_twin, weights_folder  # noqa: E402


def test_the_twin_has_no_small_weights_and_answers_alike(tmp_path):
    float_twin(weights_folder("lift") / "light.onnx", tmp_path / "light.onnx")
    graph = onnx.load(str(tmp_path / "light.onnx")).graph
    assert not {node.op_type for node in graph.node} & {"QuantizeLinear", "DequantizeLinear", "ConvInteger"}
    assert not {one.data_type for one in graph.initializer} & {onnx.TensorProto.INT8, onnx.TensorProto.FLOAT16}
    photo = sphere_photo().astype(np.float32) / 255
    inputs = graph_inputs(photo[..., :3], photo[..., 3], 60.0)
    shipped, twin = (Models(name, threads=1)(inputs) for name in ("lift", str(tmp_path)))
    assert np.abs(response(shipped.radiance) - response(twin.radiance)).max() < 1e-4
    np.testing.assert_allclose(shipped.object_normals, twin.object_normals, atol=1e-4)

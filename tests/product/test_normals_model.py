"""Normals by an estimator of others: its spec, its window, and axes that are another frame's."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.refused import refused

from anyprobe.estimate.normals_hint import normals_from_outline
from anyprobe.estimate.normals_model import estimated_normals, open_normals_model
from anyprobe.estimate.photo import load_photo

OPENCV = {"axes": ["x", "-y", "-z"], "size": 32}


def sphere_mask(height=120, width=160, center=(110, 50), radius=30) -> np.ndarray:
    y, x = np.mgrid[:height, :width] + 0.5
    return (np.hypot(x - center[0], y - center[1]) < radius).astype(np.float32)


def answering(frame: np.ndarray):
    """An estimator that knows the sphere's normals as its own camera, which looks at the window's centre, sees them."""

    def estimate(window: np.ndarray) -> np.ndarray:
        found = (window.sum(axis=-1) > 0.1).astype(np.float32)
        height, width = found.shape
        y, x = np.mgrid[:height, :width] + 0.5
        inside = found > 0
        middle = x[inside].mean(), y[inside].mean()
        radius = np.sqrt(inside.sum() / np.pi)
        n = np.stack([(x - middle[0]) / radius, (middle[1] - y) / radius, np.zeros_like(x)], axis=-1)
        n[..., 2] = np.sqrt(np.maximum(1 - (n**2).sum(axis=-1), 0.0))
        return n @ frame.T

    return estimate


def test_a_sphere_beside_the_axis_has_the_normals_of_its_outline():
    """Turned back from the window's camera: within the sphere's own perspective of the exact ones."""
    mask = sphere_mask()
    found = estimated_normals(answering(np.eye(3)), np.repeat(mask[..., None], 3, axis=-1), mask, 60.0)
    exact = normals_from_outline(mask, 60.0)
    inner = sphere_mask(radius=26) > 0
    cosine = (found * exact).sum(axis=-1)[inner]
    assert np.degrees(np.arccos(cosine.clip(-1, 1))).mean() < 7.0
    unturned = answering(np.eye(3))(np.repeat(mask[..., None], 3, axis=-1))
    worse = (unturned * exact).sum(axis=-1)[inner]
    assert cosine.mean() > worse.mean() + 0.01
    assert not found[mask == 0].any()


@pytest.mark.parametrize("frame", [np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, 1.0]), np.diag([-1.0, -1.0, 1.0])])
def test_another_frame_s_axes_are_refused(frame):
    mask = sphere_mask()
    with refused("normals"):
        estimated_normals(answering(frame), np.repeat(mask[..., None], 3, axis=-1), mask, 60.0)


def test_another_shape_is_refused():
    mask = sphere_mask()
    with refused("normals", naming="(4, 4)"):
        estimated_normals(lambda rgb: np.zeros((4, 4)), np.ones((120, 160, 3)), mask, 60.0)


def graph(path, num_tokens: bool = False):
    """A graph that answers its own input's values as vectors: channels first, with another input where asked."""
    onnx = pytest.importorskip("onnx", reason="needs onnx, of the extra 'train'")
    h = onnx.helper
    image = h.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, 3, None, None])
    tokens = h.make_tensor_value_info("num_tokens", onnx.TensorProto.INT64, [])
    out = h.make_tensor_value_info("normal", onnx.TensorProto.FLOAT, None)
    nodes = [h.make_node("Identity", ["image"], ["normal"])]
    if num_tokens:
        nodes = [
            h.make_node("Cast", ["num_tokens"], ["scale"], to=onnx.TensorProto.FLOAT),
            h.make_node("Mul", ["image", "scale"], ["normal"]),
        ]
    made = h.make_graph(nodes, "normals", [image, *([tokens] if num_tokens else [])], [out])
    onnx.save(h.make_model(made, opset_imports=[h.make_opsetid("", 17)], ir_version=8), path)
    return path


def spec_of(path, **values):
    path.with_suffix(".json").write_text(json.dumps(values))
    return path


def test_a_graph_whose_answer_is_no_picture_is_one_line(tmp_path):
    onnx = pytest.importorskip("onnx", reason="needs onnx, of the extra 'train'")
    path = spec_of(graph(tmp_path / "flat.onnx"), **OPENCV)
    model = onnx.load(path)
    shape = onnx.numpy_helper.from_array(np.array([3, -1]), "shape")
    model.graph.initializer.append(shape)
    del model.graph.node[:]
    model.graph.node.append(onnx.helper.make_node("Reshape", ["image", "shape"], ["normal"]))
    onnx.save(model, path)
    with refused(code="invalid-model", source="flat.onnx", naming="(3, 1024)"):
        open_normals_model(path)(np.full((50, 40, 3), 0.5, np.float32))


def test_a_graph_and_its_spec(tmp_path):
    """Axes, mean and deviation, sizes and further inputs are the spec's."""
    path = spec_of(graph(tmp_path / "m.onnx"), **OPENCV, mean=[0.5, 0.5, 0.5], std=0.5)
    answer = open_normals_model(path)(np.full((50, 40, 3), [0.75, 0.25, 0.0], np.float32))
    assert answer.shape == (32, 32, 3)
    np.testing.assert_allclose(answer[10, 10], [0.5, 0.5, 1.0], atol=1e-6)
    path = spec_of(graph(tmp_path / "t.onnx", num_tokens=True), **OPENCV, inputs={"num_tokens": 3}, encoding="picture")
    answer = open_normals_model(path)(np.full((50, 40, 3), 0.25, np.float32))
    np.testing.assert_allclose(answer[0, 0], [0.5, -0.5, -0.5], atol=1e-6)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"size": 32}, "axes and size"),
        ({**OPENCV, "colour": 1}, "axes and size"),
        ({**OPENCV, "axes": ["x", "x", "z"]}, "expected x, y and z"),
        ({**OPENCV, "axes": "xy"}, "axes of three"),
        ({**OPENCV, "size": 0}, "size of one number"),
        ({**OPENCV, "mean": [1, 2]}, "expected a spec with"),
        ({**OPENCV, "encoding": "colour"}, "encoding vector or picture"),
        ({**OPENCV, "input": "other"}, "input other"),
    ],
)
def test_a_spec_that_does_not_fit_is_refused_in_one_line(tmp_path, values, words):
    path = spec_of(graph(tmp_path / "m.onnx"), **values)
    with pytest.raises(Exception, match=words) as caught:
        open_normals_model(path)
    assert type(caught.value).__module__ == "anyprobe.errors"
    assert "\n" not in str(caught.value)


def test_without_spec_or_graph(tmp_path):
    with refused(source="m.json"):
        open_normals_model(graph(tmp_path / "m.onnx"))
    with refused(source="gone.onnx", naming="no such file"):
        open_normals_model(spec_of(tmp_path / "gone.onnx", **OPENCV))


def test_a_photo_takes_a_callable_for_its_normals():
    mask = sphere_mask()
    rgb = np.uint8(200 * np.repeat(mask[..., None], 3, axis=-1))
    photo = load_photo(rgb, mask=np.uint8(255 * mask), normals=answering(np.eye(3)), fov_deg=60.0)
    assert np.linalg.norm(photo.normals.values[mask > 0.5], axis=-1).min() > 0.99

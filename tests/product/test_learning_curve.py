"""The benchmark of what more pairs taught: graphs of other versions are run, or the line says why not."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.some_pair import ball_pair

from anyprobe.errors import InputError, ModelError
from anyprobe.files.graphs import open_graph
from anyprobe.infer.runtime import Models, weights_folder

onnx = pytest.importorskip("onnx", reason="needs the train extra")

SIZES = {
    "photo": [1, 4, 128, 128],
    "tan_half": [1, 1],
    "known_normals": [1, 3, 64, 64],
    "around": [1, 4, 64, 128],
    "depth": [1, 1, 64, 64],
    "ln_radiance": [1, 3, 64, 128],
    "irradiance": [1, 3, 128, 128],
}


@pytest.fixture(scope="module")
def curve():
    path = Path(__file__).parents[2] / "benchmarks" / "learning_curve.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module  # where dataclasses look their names up
    spec.loader.exec_module(module)
    yield module
    del sys.modules[path.stem]


def write_graph(folder: Path, inputs: list[str], radiance: np.ndarray, outputs=("irradiance", "ln_radiance")):
    """A graph that says the same map for every photo and its crop's tan_half for every irradiance."""
    ln_radiance = np.log(radiance).astype(np.float32).transpose(2, 0, 1)[None]
    floats = onnx.TensorProto.FLOAT
    sized = {name: onnx.helper.make_tensor_value_info(name, floats, size) for name, size in SIZES.items()}
    nodes = [
        onnx.helper.make_node("Identity", ["map"], ["ln_radiance"]),
        onnx.helper.make_node("Add", ["black", "tan_half"], ["irradiance"]),
    ]
    constants = {"map": ln_radiance, "black": np.zeros(SIZES["irradiance"], np.float32)}
    graph = onnx.helper.make_graph(
        [node for node in nodes if node.output[0] in outputs],
        "old",
        [sized[name] for name in inputs],
        [sized[name] for name in outputs],
        [onnx.numpy_helper.from_array(values, name) for name, values in constants.items()],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 17)], ir_version=8)
    folder.mkdir(parents=True, exist_ok=True)
    onnx.save(model, folder / "light.onnx")
    return folder


def test_the_shipped_graph_answers_as_it_does_elsewhere(curve):
    pair, folder = ball_pair(1), weights_folder("lift")
    radiance, irradiance = curve.answer(open_graph(folder / "light.onnx"), pair)
    expected = Models("lift")(pair.crop, pair.tan_half)
    np.testing.assert_allclose(radiance, expected.radiance, rtol=1e-5)
    np.testing.assert_allclose(irradiance, expected.irradiance, atol=1e-6)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_older_graphs_are_given_what_they_have(curve, tmp_path, count):
    """A graph that says the truth of one pair is right there and only there."""
    pairs = [ball_pair(1), ball_pair(2)]
    folder = write_graph(tmp_path, list(SIZES)[:count], pairs[0].radiance)
    learned = curve.read_learned(f"{folder}:500+70")
    exact, both = (curve.measure(learned, chosen) for chosen in (pairs[:1], pairs))
    other = curve.measure(learned, pairs[1:])
    assert (exact["pairs"], exact["pairs_of_normals"], exact["scored_on"]) == (500, 70, 1)
    assert exact["ldr_rmse"] == pytest.approx(0, abs=1e-5)
    assert exact["ldr_ssim"] == pytest.approx(1, abs=1e-4)
    assert exact["main_light_median_deg"] == pytest.approx(0, abs=0.1)
    assert other["ldr_rmse"] > 0.01
    for name in (*curve.SHOWN, "irradiance_rmse"):
        assert both[name] == pytest.approx((exact[name] + other[name]) / 2, abs=1e-4)
    shown = np.float32(pairs[0].tan_half) - pairs[0].irradiance / 255.0
    assert exact["irradiance_rmse"] == pytest.approx(np.sqrt((shown**2).mean()), abs=1e-4)


@pytest.mark.parametrize(
    ("inputs", "outputs", "words"),
    [
        (["photo", "tan_half", "depth"], ("irradiance", "ln_radiance"), "got depth"),
        (["photo", "tan_half"], ("irradiance",), "expected ln_radiance and irradiance"),
    ],
)
def test_a_graph_that_cannot_be_run_says_so_in_its_line(curve, tmp_path, inputs, outputs, words):
    pair = ball_pair(1)
    folder = write_graph(tmp_path, inputs, pair.radiance, outputs)
    line = curve.measure(curve.read_learned(f"{folder}:500"), [pair])
    assert words in line["not_run"]
    assert (line["pairs"], "ldr_rmse" in line) == (500, False)


def test_a_revision_gives_the_graph_of_its_time(curve, tmp_path):
    """Also one that the working tree no longer has; another name is not one."""
    root = tmp_path / "repository"

    def git(*arguments: str) -> str:
        author = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        command = ["git", "-C", str(root), *author, *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()

    path = root / curve.GRAPH
    path.parent.mkdir(parents=True)
    git("init", "-q")
    revisions = []
    for content in (b"first", b"second"):
        path.write_bytes(content)
        git("add", ".")
        git("commit", "-q", "-m", "graph")
        revisions.append(git("rev-parse", "--short", "HEAD"))
    path.unlink()
    for revision, content in zip(revisions, (b"first", b"second"), strict=True):
        assert curve.find_graph(revision, tmp_path, root).read_bytes() == content
    with pytest.raises(ModelError, match="nothing: expected a folder with light.onnx or a revision"):
        curve.find_graph("nothing", tmp_path, root)
    line = curve.measure(curve.read_learned(f"{revisions[0]}:5"), [], root)
    assert "expected a readable ONNX graph" in line["not_run"]


def test_pairs_are_read_beside_the_place(curve):
    assert curve.read_learned("a:b/c:12") == curve.Learned(place="a:b/c", pairs=12)
    assert curve.read_learned("66acab8:5+7") == curve.Learned(place="66acab8", pairs=5, pairs_of_normals=7)
    for text in ("66acab8", ":5", "66acab8:", "66acab8:5+", "66acab8:many"):
        with pytest.raises(InputError, match="expected a folder or revision and its pairs"):
            curve.read_learned(text)
    pairs = [curve.read_learned(text).pairs for text in curve.SHIPPED]
    assert pairs == sorted(set(pairs)), "each revision learned from more"

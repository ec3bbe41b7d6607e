"""Whole numbers of 8 bits: the same answers but for their steps, in weights that no processor's sums overflow with."""

import warnings
from collections import Counter

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from support.some_pair import sphere_pair  # noqa: E402

from anyprobe.errors import ModelError  # noqa: E402
from anyprobe.estimate.runtime import LIFT_INPUTS, Models, weights_folder  # noqa: E402
from anyprobe.nets.light_net import LightNet  # noqa: E402
from anyprobe.train import export_onnx  # noqa: E402
from research.export_weights.quantize import EXACT, difference, lift_examples, quantize  # noqa: E402


@pytest.fixture(scope="module")
def pairs():
    return [sphere_pair(seed) for seed in range(6)]


@pytest.fixture(scope="module")
def graphs(tmp_path_factory, pairs):
    """An untrained network's graph in floats, and in 8 bits."""
    folder = tmp_path_factory.mktemp("quantized")
    torch.manual_seed(3)
    nets = torch.nn.ModuleDict({"light": LightNet()})
    recipe = {"run": "untrained", "sureness": "1 0"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        graph = export_onnx.graphs_of(nets)["light"]
        export_onnx._export_stage("light", graph, recipe, folder / "float" / "light.onnx")
    quantize(folder / "float" / "light.onnx", folder / "int8" / "light.onnx", lift_examples(pairs))
    return folder


def weights_of(path) -> dict[str, np.ndarray]:
    """Whole-number weights by the name of their convolution, and what convolutions have others."""
    onnx = pytest.importorskip("onnx", reason="needs onnx, of the extra 'train'")
    graph = onnx.load(str(path)).graph
    values = {one.name: onnx.numpy_helper.to_array(one) for one in graph.initializer}
    made = {name: node for node in graph.node for name in node.output}
    found = {}
    for node in graph.node:
        if node.op_type == "Conv":
            weight = made.get(node.input[1])
            whole = weight is not None and weight.op_type == "DequantizeLinear"
            found[node.name] = values[weight.input[0]] if whole else None
    return found


@pytest.mark.parametrize("which", ["fresh", "shipped"])
def test_all_but_the_exact_convolutions_are_whole_numbers_of_seven_bits(graphs, which):
    path = (graphs / "int8" if which == "fresh" else weights_folder("lift")) / "light.onnx"
    weights = weights_of(path)
    exact = {name for name, whole in weights.items() if whole is None}
    assert exact == {name for name in weights if any(part in name for part in EXACT)}
    assert len(exact) == 9
    whole = [values for values in weights.values() if values is not None]
    assert all(values.dtype == np.int8 for values in whole)
    assert max(np.abs(values.astype(int)).max() for values in whole) == 64
    assert min(np.abs(values.astype(int)).max(axis=(1, 2, 3)).min() for values in whole) >= 63  # each channel's own


def test_the_same_answers_but_for_their_steps(graphs, pairs):
    exact, whole = (Models(str(graphs / kind), threads=1) for kind in ("float", "int8"))
    for pair in pairs:
        one, two = exact(pair.crop, pair.tan_half), whole(pair.crop, pair.tan_half)
        assert np.abs(one.ldr - two.ldr).mean() < 0.02
        assert np.abs(one.irradiance - two.irradiance).mean() < 0.02
        assert (one.ldr != two.ldr).any()


def test_steps_that_change_too_much_are_refused(graphs, pairs, tmp_path, monkeypatch):
    """With nothing left behind, and the bound is on what is told of them."""
    source = graphs / "float" / "light.onnx"
    given = difference(source, graphs / "int8" / "light.onnx", lift_examples(pairs))
    assert 0 < given < 0.02
    assert difference(source, source, lift_examples(pairs[:2])) == 0
    monkeypatch.setattr("research.export_weights.quantize.INT8_TOLERANCE", 0.5 * given)
    with pytest.raises(ModelError, match="expected 8 bits to change maps by .* got 0.0"):
        quantize(source, tmp_path / "light.onnx", lift_examples(pairs))
    assert list(tmp_path.iterdir()) == []


def test_contract_stays_but_for_what_it_computes_in(graphs):
    onnx = pytest.importorskip("onnx", reason="needs onnx, of the extra 'train'")
    said = [
        {entry.key: entry.value for entry in onnx.load(str(graphs / kind / "light.onnx")).metadata_props}
        for kind in ("float", "int8")
    ]
    assert [one.pop("computes") for one in said] == ["float32", "int8 convolutions"]
    assert said[0] == said[1]
    assert said[1]["run"] == "untrained"


def test_half_the_size(graphs):
    exact, whole = ((graphs / kind / "light.onnx").stat().st_size for kind in ("float", "int8"))
    assert whole < 0.75 * exact


def test_examples_are_told_nothing_normals_surroundings_and_both():
    given = Counter()
    for example in lift_examples(4 * [sphere_pair(1)]):
        assert tuple(example) == LIFT_INPUTS
        given[bool(example["given_normals"].any()), bool(example["surroundings"].any())] += 1
    assert given == {(False, False): 1, (True, False): 1, (False, True): 1, (True, True): 1}


def test_without_examples_nothing_is_written(graphs, tmp_path):
    with pytest.raises(ModelError, match="light.onnx: expected examples"):
        quantize(graphs / "float" / "light.onnx", tmp_path / "light.onnx", [])
    assert list(tmp_path.iterdir()) == []


def test_another_network_is_refused(tmp_path):
    with pytest.raises(ModelError, match="hdr.onnx: expected convolutions named /head/ and /sphere"):
        quantize(weights_folder("paper") / "hdr.onnx", tmp_path / "hdr.onnx", [{}])
    assert list(tmp_path.iterdir()) == []


def test_the_shipped_graph_stores_equal_tables_once():
    onnx = pytest.importorskip("onnx")
    initializers = onnx.load(weights_folder("lift") / "light.onnx").graph.initializer
    large = [t.raw_data for t in initializers if len(t.raw_data) > 4096]
    assert len(large) == len(set(large)) > 50

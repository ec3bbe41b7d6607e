"""The training loop: an interruption leaves no trace; the exported graphs say what torch says."""

import csv
import warnings
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")


from anyprobe.estimate.light_graph import INPUTS  # noqa: E402
from anyprobe.estimate.runtime import Models  # noqa: E402
from anyprobe_train.dataset.asset_store import draw_map  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.pair_source import PairSource  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe_train.light_graph.photo_graph import smooth_photo  # noqa: E402
from anyprobe_train.train import export_onnx  # noqa: E402
from anyprobe_train.train.checkpoint import load_init_weights, save_init_weights  # noqa: E402
from anyprobe_train.train.config import lift, normals, smoke  # noqa: E402
from anyprobe_train.train.lift import Lift  # noqa: E402
from anyprobe_train.train.loop import learning_rate, train  # noqa: E402


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Train for a few steps on tiny pairs: run(folder, stop_after) -> checkpoint."""
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=1))

    def call(folder, stop_after=None, steps=3, named=normals, start=None):
        config = smoke(named(), steps)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # TensorBoard warns about itself
            pairs = PairSource(illuminator, surfaces, config.pairs)
            return train(config, data=None, runs=folder, stop_after=stop_after, pairs=pairs, start=start)

    return call


@pytest.fixture(scope="module")
def two_steps(run, tmp_path_factory):
    """Checkpoints of runs of two steps, each trained once and not to be written to: two_steps(lift)."""
    return lru_cache(lambda named: run(tmp_path_factory.mktemp("two_steps"), steps=2, named=named))


@pytest.mark.ci
@pytest.mark.parametrize("named", [normals, lift])
def test_resumed_run_equals_the_straight_one_to_the_bit(run, two_steps, tmp_path, named):
    straight = torch.load(two_steps(named), weights_only=True)
    part = run(tmp_path, stop_after=1, steps=2, named=named)
    # a kill leaves rows that no checkpoint knows of
    log = part.with_name("log.csv")
    log.write_text(log.read_text() + "2,10,0.5,1e-3,1\n")
    resumed = torch.load(run(tmp_path, steps=2, named=named), weights_only=True)
    assert straight["step"] == resumed["step"] == 2
    for name, value in straight["nets"].items():
        assert torch.equal(value, resumed["nets"][name]), name
    steps = [row["step"] for row in csv.DictReader(log.read_text().splitlines())]
    assert steps == ["1", "2"]


def test_a_finished_run_is_left_alone(run, two_steps):
    path = two_steps(normals)
    before = path.stat().st_mtime_ns
    assert run(path.parents[1], steps=2) == path
    assert path.stat().st_mtime_ns == before


def test_learning_rate_rises_stays_and_falls():
    config = replace(lift(), steps=1000, warmup=100, cooldown=0.2)
    rates = [learning_rate(config, step) for step in range(1000)]
    assert rates[0] < rates[50] < rates[100] == rates[700] == config.learning_rate
    assert rates[-1] < 0.01 * config.learning_rate


@pytest.mark.ci
def test_exported_lift_agrees_with_torch_and_runs_on_a_photo(two_steps, tmp_path):
    """The graph passes the parity check that export makes; see test_train_commands for one that does not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        differences = export_onnx.export_graphs(two_steps(lift), tmp_path / "mine")
    assert set(differences) == {"light"}
    assert differences["light"] < 0.02
    inputs = dict(zip(INPUTS, (one.numpy() for one in smooth_photo()), strict=True))
    said = Models(str(tmp_path / "mine"))(inputs)
    assert said.radiance.shape == (64, 128, 3)
    assert said.confidence.shape == (64, 128)
    assert 0 <= said.confidence.min() <= said.confidence.max() <= 1
    wider = Models(str(tmp_path / "mine"))({**inputs, "lens": inputs["lens"] * 2})
    assert np.abs(wider.radiance - said.radiance).max() > 0.001


@pytest.mark.ci
def test_a_run_begins_from_kept_weights(run, two_steps, tmp_path):
    """Half of the size, within half floats; a checkpoint goes before; others' weights are refused."""
    kept = tmp_path / "start.pt"
    checkpoint, moved, weight = two_steps(lift), tmp_path / "moved.pt", "light.sphere.head.weight"
    stored = torch.load(checkpoint, weights_only=True)
    stored["nets"][weight] += 0.5  # farther than a run from elsewhere comes
    torch.save(stored, moved)
    save_init_weights(moved, kept)
    assert kept.stat().st_size < 0.25 * moved.stat().st_size
    learner = Lift(lift().lift, "cpu")
    load_init_weights(learner.nets, kept)
    trained = stored["nets"]
    for name, value in learner.nets.state_dict().items():
        torch.testing.assert_close(value, trained[name], rtol=1e-3, atol=1e-6)
    begun = torch.load(run(tmp_path / "b", steps=1, named=lift, start=kept), weights_only=True)["nets"]
    assert (begun[weight] - trained[weight]).abs().max() < 0.02
    torch.save({"hdr.head.bias": torch.zeros(12)}, tmp_path / "other.pt")
    with refused(code="invalid-model", source="other.pt"):
        run(tmp_path / "d", steps=2, named=lift, start=tmp_path / "other.pt")

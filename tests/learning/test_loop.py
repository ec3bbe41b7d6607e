"""The training loop: an interruption leaves no trace; the exported graphs say what torch says."""

import csv
import warnings
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("onnx", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.pairs import PairSource  # noqa: E402
from anyprobe.dataset.procedural_light import draw_map  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.errors import ModelError  # noqa: E402
from anyprobe.train.config import RUNS, smoke  # noqa: E402
from anyprobe.train.loop import learning_rate, train  # noqa: E402


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Train a stage for a few steps on tiny pairs: run(stage, folder, stop_after)."""
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=1))

    def call(stage, folder, stop_after=None, steps=6):
        config = smoke(RUNS[stage](), steps)
        config = replace(config, pairs=replace(config.pairs, batch=2))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch's exporter and TensorBoard warn about themselves
            pairs = PairSource(illuminator, surfaces, config.pairs)
            return train(config, data=None, runs=folder, stop_after=stop_after, pairs=pairs)

    return call


def test_resumed_run_equals_the_straight_one_to_the_bit(run, tmp_path):
    straight = torch.load(run("irradiance", tmp_path / "a"), weights_only=True)
    run("irradiance", tmp_path / "b", stop_after=3)
    # a kill leaves rows that no checkpoint knows of
    log = tmp_path / "b" / "irradiance" / "log.csv"
    log.write_text(log.read_text() + "5,10,0.5,1e-3,1\n")
    resumed = torch.load(run("irradiance", tmp_path / "b"), weights_only=True)
    assert straight["step"] == resumed["step"] == 6
    for name, value in straight["net"].items():
        assert torch.equal(value, resumed["net"][name]), name
    steps = [row["step"] for row in csv.DictReader(log.read_text().splitlines())]
    assert steps == ["3", "6"]


def test_a_finished_run_is_left_alone(run, tmp_path):
    path = run("irradiance", tmp_path)
    before = path.stat().st_mtime_ns
    run("irradiance", tmp_path)
    assert path.stat().st_mtime_ns == before


def test_later_networks_ask_for_the_earlier_ones(run, tmp_path):
    with pytest.raises(ModelError, match="train irradiance first"):
        run("illumination", tmp_path)


def test_learning_rate_rises_stays_and_falls():
    config = replace(RUNS["irradiance"](), steps=1000, warmup=100, cooldown=0.2)
    rates = [learning_rate(config, step) for step in range(1000)]
    assert rates[0] < rates[50] < rates[100] == rates[700] == config.learning_rate
    assert rates[-1] < 0.01 * config.learning_rate


def test_exported_chain_agrees_with_torch(run, tmp_path):
    """All three stages run, and their graphs pass the parity check that export makes."""
    from anyprobe.train.export_onnx import INPUT_SHAPES, export

    for stage in INPUT_SHAPES:
        run(stage, tmp_path, steps=2)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        differences = export(tmp_path, tmp_path / "weights")
    assert set(differences) == set(INPUT_SHAPES)
    assert max(differences.values()) < 0.02


def test_export_refuses_a_graph_that_disagrees(run, tmp_path, monkeypatch):
    from anyprobe.train import export_onnx

    run("irradiance", tmp_path, steps=2)
    monkeypatch.setattr(export_onnx, "TOLERANCE", 0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(ModelError, match="expected ONNX within"):
            export_onnx.export_stage(tmp_path, "irradiance", tmp_path / "x.onnx")
    assert not (tmp_path / "x.onnx").exists()

"""A run goes on with what it began with, or not at all."""

import json
import warnings
from dataclasses import asdict, replace
from types import SimpleNamespace

import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from support.some_batch import some_batch  # noqa: E402

from anyprobe.errors import InputError, ModelError  # noqa: E402
from anyprobe_train.train import loop  # noqa: E402
from anyprobe_train.train.checkpoint import save_init_weights  # noqa: E402
from anyprobe_train.train.config import normals, smoke  # noqa: E402

CONFIG = smoke(normals(), 4)
PAIRS = SimpleNamespace(batch=lambda step: some_batch())


def go(runs, config=CONFIG, pairs=PAIRS, **settings):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # TensorBoard warns about itself
        return loop.train(config, data=None, runs=runs, pairs=pairs, **settings)


def changed(path, **parts):
    """Write a checkpoint anew with other parts, None for those that it shall lack."""
    stored = torch.load(path, weights_only=True) | parts
    torch.save({name: value for name, value in stored.items() if value is not None}, path)


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    """A folder of runs in which one has done two of four steps."""
    runs = tmp_path_factory.mktemp("begun")
    go(runs, stop_after=2)
    return runs


REFUSED = {
    "a loss": ({"config": replace(CONFIG, learning_rate=0.5)}, "learning_rate 0.0015, as the run started, got 0.5"),
    "other pairs": (
        {"config": replace(CONFIG, pairs=replace(CONFIG.pairs, seed=5))},
        "pairs.seed 71, as the run started, got 5",
    ),
    "another network": ({"config": replace(CONFIG, model="lift")}, "model normals, as the run started, got lift"),
    "workers": ({"workers": 3, "pairs": None}, r"2 without workers\) of 2, as the run started, got 3"),
    "fewer steps": ({"config": replace(CONFIG, steps=1)}, "at least the 2 steps that are done, got 1"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_another_run_does_not_go_on_from_a_checkpoint(begun, case):
    settings, message = REFUSED[case]
    path = begun / CONFIG.name / "checkpoint.pt"
    before = path.read_bytes()
    with pytest.raises(InputError, match=message) as error:
        go(begun, **settings)
    assert str(error.value).startswith(f"{path}: expected ")
    assert "\n" not in str(error.value)
    assert path.read_bytes() == before


def test_start_is_for_the_run_that_began_from_it(tmp_path):
    """The command that began a run goes on with it; other weights, or none, do not."""
    weights, others = tmp_path / "start.pt", tmp_path / "others.pt"
    save_init_weights(go(tmp_path / "a", stop_after=1), weights)
    save_init_weights(go(tmp_path / "a", stop_after=2), others)
    path = go(tmp_path / "b", stop_after=1, start=weights)
    assert torch.load(go(tmp_path / "b", stop_after=2, start=weights), weights_only=True)["step"] == 2
    assert torch.load(go(tmp_path / "b", stop_after=3), weights_only=True)["step"] == 3
    with pytest.raises(InputError, match="expected --init-weights with [0-9a-f]{16}, as the run started, got"):
        go(tmp_path / "b", start=others)
    with pytest.raises(ModelError, match="none.pt: no such file; save weights"):
        go(tmp_path / "b", start=tmp_path / "none.pt")
    with refused(source="checkpoint.pt", naming="--init-weights with nothing"):
        go(tmp_path / "a", start=weights)
    assert torch.load(path, weights_only=True)["step"] == 3
    with pytest.raises(ModelError, match="none.pt: no such file"):
        go(tmp_path / "c", start=tmp_path / "none.pt")
    assert not (tmp_path / "c").exists()


def test_an_older_checkpoint_goes_on_exactly(tmp_path):
    """It says nothing of its origin, and lacks settings that came later."""
    straight = torch.load(go(tmp_path / "a"), weights_only=True)
    path = go(tmp_path / "b", stop_after=2)
    config = asdict(CONFIG)
    del config["pairs"]["merged_surroundings"], config["light"]["extra"]
    config["name"] = "before"
    changed(path, origin=None, pairs=None, config=json.dumps(config))
    resumed = torch.load(go(tmp_path / "b"), weights_only=True)
    assert resumed["step"] == straight["step"] == 4
    for name, value in straight["nets"].items():
        assert torch.equal(value, resumed["nets"][name]), name

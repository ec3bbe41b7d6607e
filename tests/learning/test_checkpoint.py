"""A checkpoint that cannot be read, or is of another network, is one clear line wherever it is asked for."""

import json
from dataclasses import asdict

import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe.errors import ModelError  # noqa: E402
from anyprobe_train.train.checkpoint import load_weights, save_checkpoint, save_init_weights  # noqa: E402
from anyprobe_train.train.config import normals, smoke  # noqa: E402
from anyprobe_train.train.export_onnx import export_graphs  # noqa: E402
from anyprobe_train.train.loop import load_nets, make_learner, train  # noqa: E402

CONFIG = smoke(normals())


def write_run(runs, config=CONFIG):
    """A run of five steps that has learned nothing."""
    nets = make_learner(config, "cpu").nets
    path = runs / config.name / "checkpoint.pt"
    optimizer = torch.optim.AdamW(nets.parameters())
    state = {"nets": nets.state_dict(), "optimizer": optimizer.state_dict(), "pairs": 20}
    save_checkpoint(path, config, 5, {}, state)
    return path


def is_one_short_line(error) -> bool:
    return "\n" not in str(error.value) and len(str(error.value)) < 400


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (b"no checkpoint at all\n", "a damaged file"),
        (b"", "a damaged file"),
        (5_000, "a damaged file"),
        (100_000, "a damaged file"),
        ([1, 2], "a list"),
        ({"step": 3, "config": "{}"}, "a file without nets"),
        ({"nets": {}, "step": 3}, "a file without its configuration"),
        ({"nets": {}, "config": "{}"}, "a file without its configuration or step"),
    ],
)
def test_a_damaged_checkpoint_is_one_clear_line(tmp_path, content, found):
    path = write_run(tmp_path)
    if isinstance(content, int):  # a copy that was cut short
        content = path.read_bytes()[:content]
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        torch.save(content, path)
    before = path.read_bytes()
    asked = (
        lambda: train(CONFIG, data=None, runs=tmp_path),
        lambda: export_graphs(path, tmp_path / "to"),
        lambda: save_init_weights(path, tmp_path / "to.pt"),
    )
    for ask in asked:
        with pytest.raises(ModelError, match=f"expected a run's checkpoint, got {found}") as error:
            ask()
        assert is_one_short_line(error)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == [CONFIG.name]


def test_another_networks_weights_are_one_clear_line(tmp_path):
    """Hundreds of names differ; the first is told."""
    path = write_run(tmp_path)
    stored = torch.load(path, weights_only=True)
    torch.save({**stored, "nets": {f"old.{name}": one for name, one in stored["nets"].items()}}, path)
    first = next(iter(stored["nets"]))
    for ask in (lambda: load_nets(path), lambda: train(CONFIG, data=None, runs=tmp_path)):
        with pytest.raises(ModelError, match=rf"with {first} \[.*\], got none") as error:
            ask()
        assert is_one_short_line(error)
    net = make_learner(CONFIG, "cpu").nets
    weights = net.state_dict()
    name = next(iter(weights))
    with pytest.raises(ModelError, match=rf"with {name} .*, got \[3\]"):
        load_weights(net, {**weights, name: torch.zeros(3)}, path)
    with refused(code="invalid-model", source="checkpoint.pt", naming="more none"):
        load_weights(net, {**weights, "more": torch.tensor(1)}, path)


def test_a_run_of_another_release_says_so(tmp_path):
    path = write_run(tmp_path)
    stored = torch.load(path, weights_only=True)
    torch.save({**stored, "config": json.dumps(asdict(CONFIG) | {"model": "older"})}, path)
    with refused(code="invalid-model", source="checkpoint.pt", naming="older"):
        load_nets(path)

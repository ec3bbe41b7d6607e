"""A checkpoint that cannot be read, or is of another network, is one clear line wherever it is asked for."""

from dataclasses import replace

import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")

from anyprobe.errors import InputError, ModelError  # noqa: E402
from anyprobe_train.light.light_run import LightRunConfig  # noqa: E402
from anyprobe_train.light.network import LeanNet  # noqa: E402
from anyprobe_train.train.checkpoint import load_trained, load_weights, resumed, save_checkpoint, save_init_weights  # noqa: E402

CONFIG = LightRunConfig()


def write_run(runs):
    """A run of five steps that has learned nothing."""
    path = runs / CONFIG.name / "checkpoint.pt"
    weights = torch.nn.Linear(200, 300).state_dict()
    save_checkpoint(path, CONFIG, 5, {"start": None}, {"net": weights, "moving": weights, "optimizer": {}})
    return path


def is_one_short_line(error) -> bool:
    return "\n" not in str(error.value) and len(str(error.value)) < 400


@pytest.mark.parametrize(
    "content",
    [
        b"no checkpoint at all\n",
        b"",
        5_000,
        100_000,
        [1, 2],
        {"step": 3, "config": "{}"},
        {"net": {}, "step": 3},
        {"net": {}, "config": "{}"},
    ],
)
def test_a_damaged_checkpoint_is_one_clear_line(tmp_path, content):
    path = write_run(tmp_path)
    if isinstance(content, int):  # a copy that was cut short
        content = path.read_bytes()[:content]
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        torch.save(content, path)
    before = path.read_bytes()
    asked = (
        lambda: resumed(path, CONFIG, {}, None),
        lambda: load_trained(LeanNet(), path),
        lambda: save_init_weights(path, tmp_path / "to.pt"),
    )
    for ask in asked:
        with pytest.raises(ModelError, match="expected a run's checkpoint, got a damaged file") as error:
            ask()
        assert is_one_short_line(error)
    assert path.read_bytes() == before
    assert [one.name for one in tmp_path.iterdir()] == [CONFIG.name]


def test_another_networks_weights_are_one_clear_line(tmp_path):
    """Hundreds of names may differ; the first is told."""
    path = write_run(tmp_path)
    net = torch.nn.Linear(2, 3)
    weights = net.state_dict()
    with pytest.raises(ModelError, match=r"with weight \[3, 2\], got none") as error:
        load_weights(net, {f"old.{name}": one for name, one in weights.items()}, path)
    assert is_one_short_line(error)
    with pytest.raises(ModelError, match=r"with weight .*, got \[3\]"):
        load_weights(net, {**weights, "weight": torch.zeros(3)}, path)
    with refused(code="invalid-model", source="checkpoint.pt", naming="more none"):
        load_weights(net, {**weights, "more": torch.tensor(1)}, path)


def test_a_run_goes_on_with_its_own_settings_alone(tmp_path):
    path = write_run(tmp_path)
    stored, _ = resumed(path, replace(CONFIG, steps=50), {}, None)
    assert stored["step"] == 5
    with pytest.raises(InputError, match="learning_rate"):
        resumed(path, replace(CONFIG, learning_rate=1.0), {}, None)

"""The weights of `lift` that ship, exported once more."""

from __future__ import annotations

from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")

from anyprobe.estimate.runtime import weights_folder  # noqa: E402
from anyprobe_train.train.loop import load_nets, pairs_seen  # noqa: E402
from research.export_weights.checkpoints import kept_checkpoint, mean_checkpoint  # noqa: E402

KEPT = Path(__file__).parents[2] / "train" / "checkpoints" / "lift.pt"
"""Weights of both networks, of which light.onnx has the first."""


@pytest.fixture
def checkpoint(tmp_path) -> Path:
    return kept_checkpoint(KEPT, weights_folder("lift") / "light.onnx", tmp_path / "kept.pt")


def test_shipped_weights_are_those_of_a_run_of_lift(checkpoint):
    nets = load_nets(checkpoint)
    assert list(nets) == ["light"]
    stored = torch.load(KEPT, weights_only=True)
    assert all(torch.equal(value, stored[name].float()) for name, value in nets.state_dict().items() if value.ndim > 1)
    assert pairs_seen(torch.load(checkpoint, weights_only=True)) == 320_000


def test_the_mean_with_shipped_weights_is_of_what_both_have(checkpoint, tmp_path):
    path = mean_checkpoint(checkpoint, KEPT, tmp_path / "mean.pt")
    wanted = load_nets(checkpoint).state_dict()
    assert all(torch.allclose(value, wanted[name]) for name, value in load_nets(path).state_dict().items())

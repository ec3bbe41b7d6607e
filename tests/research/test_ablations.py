"""Ablations: each changes what it says of lift_trial, and a checkpoint becomes a method."""

import json
from dataclasses import replace

import pytest
from support.some_pair import sphere_pair

pytest.importorskip("torch", reason="needs ./train[torch]")

import torch

from anyprobe.errors import InputError
from anyprobe_train.train.checkpoint import save_checkpoint
from anyprobe_train.train.config import smoke
from anyprobe_train.train.loop import make_learner
from research import ablations
from research.ablations import ABLATIONS, score


@pytest.fixture
def runs(tmp_path):
    """Two runs that have learned nothing, as training would leave them."""
    for name in ("clean_trial", "lift_trial"):
        config = replace(smoke(ABLATIONS[name]()), name=name)
        nets = make_learner(config, "cpu").nets
        folder = tmp_path / name
        folder.mkdir()
        optimizer = torch.optim.AdamW(nets.parameters())
        state = {"nets": nets.state_dict(), "optimizer": optimizer.state_dict(), "pairs": 28}
        save_checkpoint(folder / "checkpoint.pt", config, 7, {}, state)
    return tmp_path


def test_what_is_trained_is_set_beside_the_first(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(ablations, "left_out_pairs", lambda data, kept: [sphere_pair(0), sphere_pair(1, 0.6)])
    score(tmp_path / "data", runs, tmp_path / "out.json")
    rows = json.loads((tmp_path / "out.json").read_text())["rows"]
    assert list(rows) == ["lift_trial", "clean_trial"]
    assert rows["lift_trial"]["differences"]["ldr_rmse"]["mean"] == 0
    (runs / "lift_trial" / "checkpoint.pt").unlink()
    with pytest.raises(InputError, match="expected the run lift_trial"):
        score(tmp_path / "data", runs, tmp_path / "out.json")

"""Ablations: each changes what it says of lift_trial, and a checkpoint becomes a method."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from support.some_pair import sphere_pair

pytest.importorskip("torch", reason="needs ./train[torch]")

import torch

from anyprobe.errors import InputError
from anyprobe_train.train.checkpoint import save_checkpoint
from anyprobe_train.train.config import smoke
from anyprobe_train.train.loop import load_nets, make_learner
from research import ablations
from research.ablations import ABLATIONS, OTHER_MODEL, lift_trial, network_method, score


def changed(run, base) -> set[str]:
    """Settings, as part.name, in which two runs differ."""
    a, b = asdict(run), asdict(base)
    flat = {(key, name) for key, part in a.items() if isinstance(part, dict) for name in part}
    return {f"{key}.{name}" for key, name in flat if a[key][name] != b[key][name]} | {
        key for key, value in a.items() if not isinstance(value, dict) and value != b[key]
    }


ALLOWED = {
    "lift_again": {"seed", "pairs.seed"},
    "tasks_trial": {"lift.irradiance", "lift.alpha"},
    "pixels_trial": {"lift.scales", "lift.structure", "lift.transport"},
    "light_train": {"light.extra", "light.procedural", "light.variants"},
    "light_real": {"light.procedural", "light.variants"},
    "light_both": {"light.variants"},
    "clean_trial": {"pairs.conditions", "pairs.cut_out"},
}


@pytest.mark.parametrize("name", ALLOWED)
def test_an_ablation_changes_only_what_it_says(name):
    assert changed(ABLATIONS[name](), lift_trial()) == {"name"} | ALLOWED[name]


def test_none_is_without_its_check():
    assert set(ABLATIONS) == {"lift_trial", OTHER_MODEL, *ALLOWED}


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


def test_a_network_becomes_a_method(runs):
    pair, net = sphere_pair(0), load_nets(runs / "lift_trial" / "checkpoint.pt")["light"]
    photo = torch.from_numpy(pair.crop).permute(2, 0, 1)[None]
    with torch.no_grad():
        whole = torch.exp(net(photo, torch.tensor([[pair.tan_half]])).ln_radiance)
    estimate = network_method(net)(pair)
    np.testing.assert_allclose(estimate.radiance, whole[0].permute(1, 2, 0), rtol=1e-5)


def test_what_is_trained_is_set_beside_the_first(runs, tmp_path, monkeypatch):
    monkeypatch.setattr(ablations, "left_out_pairs", lambda data, kept: [sphere_pair(0), sphere_pair(1, 0.6)])
    score(tmp_path / "data", runs, tmp_path / "out.json")
    rows = json.loads((tmp_path / "out.json").read_text())["rows"]
    assert list(rows) == ["lift_trial", "clean_trial"]
    assert rows["lift_trial"]["differences"]["ldr_rmse"]["mean"] == 0
    (runs / "lift_trial" / "checkpoint.pt").unlink()
    with pytest.raises(InputError, match="expected the run lift_trial"):
        score(tmp_path / "data", runs, tmp_path / "out.json")

"""Trials: each changes what it says of lift_trial, and what a table says of them follows from their figures."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from support.some_pair import ball_pair

pytest.importorskip("torch", reason="needs the train extra")

import torch
from typer.testing import CliRunner

from anyprobe.cli.app import app
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.evaluate.panel import Estimate
from anyprobe.evaluate.trials import score_trials, trial_lines
from anyprobe.train.loop import load_nets, make_learner, save_checkpoint
from anyprobe.train.runs import RUNS, smoke
from anyprobe.train.trial_methods import read_trial, trained_trials, trial_method
from anyprobe.train.trials import TRIALS, lift_trial


def changed(run, base) -> set[str]:
    """Settings, as part.name, in which two runs differ."""
    a, b = asdict(run), asdict(base)
    flat = {(key, name) for key, part in a.items() if isinstance(part, dict) for name in part}
    return {f"{key}.{name}" for key, name in flat if a[key][name] != b[key][name]} | {
        key for key, value in a.items() if not isinstance(value, dict) and value != b[key]
    }


ALLOWED = {
    "lift_again": {"seed", "pairs.seed"},
    "code_trial": {"lift.lifting"},
    "queries_trial": {"lift.queries"},
    "queries_alone": {"lift.queries", "lift.lifting"},
    "tasks_trial": {"lift.irradiance", "lift.alpha"},
    "pixels_trial": {"lift.scales", "lift.structure", "lift.transport"},
    "harmonics_trial": {"lift.harmonics"},
    "anchors_trial": {"lift.anchors"},
    "still_trial": {"lift.stillness"},
    "dual_trial": {"lift.tones", "lift.lamps", "lift.flux"},
    "light_train": {"light.extra", "light.procedural", "light.variants"},
    "light_real": {"light.procedural", "light.variants"},
    "light_both": {"light.variants"},
    "clean_trial": {"pairs.conditions", "pairs.cut_out"},
}


@pytest.mark.parametrize("trial", TRIALS[1:], ids=lambda trial: trial.__name__)
def test_a_trial_changes_only_what_it_says(trial):
    assert changed(trial(), lift_trial()) == {"name"} | ALLOWED[trial.__name__]


def test_every_trial_can_be_run_by_its_name():
    assert {trial.__name__ for trial in TRIALS} == {"lift_trial", *ALLOWED}


def test_what_lift_learns_with_later_stays_out_of_the_trials():
    pairs = lift_trial().pairs
    assert (pairs.around, pairs.gathered, pairs.joined, pairs.reshaped) == (0, 0, 0, 0)
    assert (pairs.textured, pairs.two_materials) == (0, 0)
    for trial in TRIALS:
        assert trial().name == trial.__name__
        assert RUNS[trial.__name__]() == trial()


def estimates(pair, *gains):
    made = [pair.radiance * np.float32(gain) for gain in gains]
    return [Estimate(ldr=response(one), radiance=one) for one in made]


def test_differences_are_paired_and_only_sure_ones_bold():
    """One trial is hardly another, one twice as bright, one is so for one pair only, and one only beyond chance."""
    pairs = [ball_pair(seed) for seed in range(4)]
    gains = {"lift_trial": [1.1] * 4, "lift_again": [1.2] * 4, "same": [1.1] * 4}
    gains |= {"worse": [2.0] * 4, "unsure": [2, 1, 1.1, 1.1], "chance": [1.25] * 4}
    order = iter(range(10))

    def method(name):
        turn = iter(gains[name])
        return lambda pair: estimates(pair, next(turn))[0]

    scores = score_trials(pairs, {name: method(name) for name in gains}, lambda: next(order))
    assert next(order) == 4
    rows = {row["trial"]: row for row in scores.result()}
    assert rows["same"]["difference"]["ldr_rmse"] == (0.0, 0.0)
    assert rows["lift_trial"]["flux_stops"] == pytest.approx(np.log2(1.1), abs=1e-3)
    mean, error = rows["worse"]["difference"]["flux_stops"]
    assert mean == pytest.approx(1 - np.log2(1.1), abs=1e-3)
    assert error == pytest.approx(0.0, abs=1e-3)
    d = np.array([1, 0, np.log2(1.1), np.log2(1.1)]) - np.log2(1.1)
    mean, error = rows["unsure"]["difference"]["flux_stops"]
    assert (mean, error) == pytest.approx((d.mean(), d.std(ddof=1) / 2), abs=1e-3)
    scores.places[0] = [(where, "ball") for where in "aabb"]  # pairs of one map may err together
    mean, error = {row["trial"]: row for row in scores.result()}["unsure"]["difference"]["flux_stops"]
    of_maps = d.reshape(2, 2).mean(axis=1)
    assert (mean, error) == pytest.approx((d.mean(), of_maps.std(ddof=1) / np.sqrt(2)), abs=1e-3)
    table = trial_lines({"rows": [add_missing(row) for row in rows.values()]})
    cells = {line.split(" | ")[0].strip("| "): line.split(" | ") for line in table[2:]}
    column = table[0].split(" | ").index("flux, stops")
    assert cells["lift_trial"][column] == f"{np.log2(1.1):.2f}"
    assert cells["worse"][column] == f"**{1 - np.log2(1.1):+.2f}**"
    assert cells["unsure"][column] == f"{d.mean():+.2f}"
    for name, gain in (("chance", 1.25), ("lift_again", 1.2)):  # as sure as pairs can make it
        assert rows[name]["difference"]["flux_stops"][1] < 1e-3
        assert cells[name][column] == f"{np.log2(gain / 1.1):+.2f}"


def add_missing(row):
    """Figures that these estimates lack, so that a table can be made."""
    extra = {"irradiance_rmse": 0.1, "ldr_rmse_world": 0.1}
    return {**row, **extra, "difference": {**row["difference"], **dict.fromkeys(extra, (0.0, 1.0))}}


def test_photos_of_the_world_have_a_figure_of_their_own():
    pair = ball_pair(0)
    world = replace(pair, recipe=replace(pair.recipe, conditions=1))
    made = estimates(pair, 1.5)[0]
    row = score_trials([pair, world], {"lift_trial": lambda pair: made}).result()[0]
    assert row["ldr_rmse"] == row["ldr_rmse_world"] > 0.01


@pytest.fixture
def trained(tmp_path):
    """Two trials that have learned nothing, as training would leave them."""
    for name in ("queries_trial", "lift_trial"):
        config = replace(smoke(RUNS[name]()), name=name)
        nets = make_learner(config, "cpu").nets
        folder = tmp_path / name
        folder.mkdir()
        optimizer = torch.optim.AdamW(nets.parameters())
        save_checkpoint(folder / "checkpoint.pt", nets, config, optimizer, 7, 28)
    return tmp_path


def test_a_checkpoint_becomes_a_method(trained):
    found = trained_trials(trained)
    assert list(found) == ["lift_trial", "queries_trial"]
    assert read_trial(found["lift_trial"]) == {
        "steps": 7,
        "of_steps": 20,
        "pairs": 28,
        "seed": 0,
        "pairs_seed": lift_trial().pairs.seed,
    }
    pair = ball_pair(0)
    made = [trial_method(path)(pair) for path in found.values()]
    net = load_nets(found["lift_trial"])["light"]
    photo = torch.from_numpy(pair.crop).permute(2, 0, 1)[None]
    with torch.no_grad():
        whole = torch.exp(net(photo, torch.tensor([[pair.tan_half]])).ln_radiance)
    np.testing.assert_allclose(made[0].radiance, whole[0].permute(1, 2, 0), rtol=1e-5)
    for estimate in made:
        assert estimate.radiance.shape == (64, 128, 3)
        assert estimate.irradiance.shape == (128, 128, 3)
        assert np.isfinite(estimate.radiance).all()
        np.testing.assert_allclose(estimate.ldr, response(estimate.radiance))
    assert not np.allclose(made[0].radiance, made[1].radiance)


def test_the_command_writes_what_it_prints(trained, tmp_path, monkeypatch):
    from anyprobe.evaluate import calibrate

    def some_pairs(data, kept, conditions):
        pair = ball_pair(conditions)
        return [replace(pair, recipe=replace(pair.recipe, conditions=conditions))]

    monkeypatch.setattr(calibrate, "left_out_pairs", some_pairs)
    asked = ["trials", "--data", "data", "--runs", str(trained), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(app, asked)
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / "out" / "trials.json").read_text())
    assert [row["trial"] for row in content["rows"]] == ["lift_trial", "queries_trial"]
    assert content["standard_errors"] == "by map and shape"
    assert "\n".join(trial_lines(content)) in done.stdout
    (trained / "lift_trial" / "checkpoint.pt").unlink()
    refused = CliRunner().invoke(app, asked)
    assert isinstance(refused.exception, InputError)
    assert "lift_trial" in str(refused.exception)

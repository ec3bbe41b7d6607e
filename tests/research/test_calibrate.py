"""Calibration of what ships: claims are made true on pairs that no weights learn from."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.response import inverse_response, response
from anyprobe.errors import InputError
from anyprobe_train.dataset.asset_store import AssetStore
from research import left_out
from research.export_weights.calibrate import calibrate, fit_logit, to_logit


def test_a_fitted_logit_gives_back_what_was_done_to_it(rng):
    """Chances of which every claim exaggerates: claimed logit = (true logit + 0.8) / 0.7; pixels weigh unequally."""
    chance = rng.uniform(0.02, 0.9, size=200_000)
    claimed = 1 / (1 + np.exp(-(to_logit(chance) + 0.8) / 0.7))
    right = rng.random(len(chance)) < chance
    weight = rng.uniform(0.1, 2.0, size=len(chance))
    slope, offset = fit_logit(claimed, right, weight)
    assert (slope, offset) == (pytest.approx(0.7, abs=0.02), pytest.approx(-0.8, abs=0.03))


def test_weight_decides_whom_a_fit_believes(rng):
    claimed = rng.uniform(0.2, 0.8, size=20_000)
    right = np.concatenate([rng.random(10_000) < claimed[:10_000], np.zeros(10_000, bool)])
    weight = np.concatenate([np.ones(10_000), np.full(10_000, 1e-9)])
    assert fit_logit(claimed, right, weight) == (pytest.approx(1, abs=0.1), pytest.approx(0, abs=0.1))


def test_a_model_that_boasts_is_told_by_how_much(rng):
    """Right where its claim of 0.9, 0.5 or 0.1 comes true in 0.6, 0.3 or 0.05 of the pixels."""
    pairs = [sphere_pair(seed) for seed in range(3)]
    truths = [response(pair.radiance) for pair in pairs]
    answers = []
    for truth in truths:
        which = rng.integers(3, size=truth.shape[:2])
        wrong = rng.random(which.shape) > np.array([0.6, 0.3, 0.05])[which]
        ldr = np.where(wrong[..., None], truth + np.where(truth > 0.5, -0.3, 0.3), truth)
        answers.append(
            SimpleNamespace(confidence=np.array([0.9, 0.5, 0.1], np.float32)[which], radiance=inverse_response(ldr))
        )
    given = iter(answers)
    slope, offset = calibrate(lambda inputs: next(given), pairs)
    chance = 1 / (1 + np.exp(-(slope * to_logit(np.array([0.9, 0.5, 0.1])) + offset)))
    np.testing.assert_allclose(chance, [0.6, 0.3, 0.05], atol=0.1)


def test_what_is_left_out_is_what_no_run_learns_from(monkeypatch):
    def assets(names):
        return [SimpleNamespace(id=name, lifted=name == "d") for name in names]

    made = {True: assets("ab"), False: assets("abcd")}
    monkeypatch.setattr(
        left_out, "load_asset_store", lambda data, split, commercial_only: AssetStore(*2 * [made[commercial_only]])
    )
    left = left_out.load_left_out(Path("data"))
    assert (list(left.maps), list(left.shapes)) == (["c"], ["c", "d"])  # d: its lights are made up
    made[False] = made[True]
    with pytest.raises(InputError, match="0 maps and 0 shapes"):
        left_out.load_left_out(Path("data"))

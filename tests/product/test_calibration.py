"""Confidence: claims against what came true, on maps where both are known."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.some_pair import ball_pair

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.dataset import stock
from anyprobe.errors import InputError, ModelError
from anyprobe.evaluate.calibrate import calibrate
from anyprobe.evaluate.calibration import CLOSE, Calibration, fit_logit, to_logit


def maps(rng, confidence, chance):
    """A true map, and one that is right with the given chance at every pixel."""
    truth = rng.random(confidence.shape + (3,))
    wrong = rng.random(confidence.shape) > chance
    return truth + np.where(wrong, 2 * CLOSE, 0.5 * CLOSE)[..., None], truth


def test_honest_confidence_has_no_error(rng):
    calibration = Calibration()
    for _ in range(20):
        confidence = rng.random((64, 128))
        calibration.add(confidence, *maps(rng, confidence, confidence))
    result = calibration.result()
    assert result["error"] < 0.02
    assert len(result["bins"]) == 10
    assert sum(share for share, _, _ in result["bins"]) == pytest.approx(1, abs=1e-3)


def test_boasting_shows(rng):
    confidence = np.full((64, 128), 0.9)
    calibration = Calibration()
    calibration.add(confidence, *maps(rng, confidence, 0.5))
    result = calibration.result()
    assert result["error"] == pytest.approx(0.4, abs=0.03)
    assert (result["claimed"], len(result["bins"])) == (0.9, 1)


def test_the_sphere_counts_not_the_pixels():
    """Right in the top row alone, which is small."""
    truth = np.zeros((64, 128, 3))
    estimate = np.ones_like(truth)
    estimate[0] = 0
    calibration = Calibration()
    calibration.add(np.ones((64, 128)), estimate, truth)
    share = float(pixel_solid_angles(64)[0, 0] * 128 / (4 * np.pi))
    assert calibration.result()["right"] == pytest.approx(share, abs=1e-4)


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
    pairs = [ball_pair(seed) for seed in range(3)]
    truths = [response(pair.radiance) for pair in pairs]
    answers = []
    for truth in truths:
        which = rng.integers(3, size=truth.shape[:2])
        wrong = rng.random(which.shape) > np.array([0.6, 0.3, 0.05])[which]
        ldr = np.where(wrong[..., None], truth + np.where(truth > 0.5, -0.3, 0.3), truth)
        answers.append(SimpleNamespace(confidence=np.array([0.9, 0.5, 0.1], np.float32)[which], ldr=ldr))
    given = iter(answers)
    slope, offset = calibrate(lambda crop, tan_half: next(given), pairs)
    chance = 1 / (1 + np.exp(-(slope * to_logit(np.array([0.9, 0.5, 0.1])) + offset)))
    np.testing.assert_allclose(chance, [0.6, 0.3, 0.05], atol=0.1)


def test_a_model_without_confidence_cannot_be_calibrated():
    class Silent:
        name = "paper"

        def __call__(self, crop, tan_half):
            return SimpleNamespace(confidence=None)

    with pytest.raises(ModelError, match="paper: expected a model that tells its confidence"):
        calibrate(Silent(), [ball_pair(1)])


def test_what_is_left_out_is_what_no_run_learns_from(monkeypatch):
    def assets(names):
        return [SimpleNamespace(id=name, lifted=name == "d") for name in names]

    made = {True: assets("ab"), False: assets("abcd")}
    monkeypatch.setattr(
        stock, "load_stock", lambda data, split, commercial_only: stock.Stock(*2 * [made[commercial_only]])
    )
    left = stock.load_left_out(Path("data"))
    assert (list(left.maps), list(left.shapes)) == (["c"], ["c", "d"])  # d: its lights are made up
    made[False] = made[True]
    with pytest.raises(InputError, match="0 maps and 0 shapes"):
        stock.load_left_out(Path("data"))

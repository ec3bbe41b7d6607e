"""Confidence: claims against what came true, on maps where both are known."""

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_solid_angles
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

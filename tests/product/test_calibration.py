"""Confidence: claims against what came true, on maps where both are known."""

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe_train.evaluate.calibration import CLOSE, Calibration


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


def test_figures_are_those_of_their_definitions(rng):
    """Pixel by pixel, and for the AUC pair by pair but for those of one bin."""
    confidence = rng.uniform(0.1, 1.0, size=(16, 32)) ** 3
    estimate, truth = maps(rng, confidence, 0.8 * confidence + 0.1)
    calibration = Calibration()
    calibration.add(confidence, estimate, truth)
    result = calibration.result()
    right = (np.abs(estimate - truth).mean(axis=-1) < CLOSE).ravel()
    weight = np.broadcast_to(pixel_solid_angles(16), (16, 32)).ravel()
    claim, share = confidence.ravel(), weight / weight.sum()
    assert result["brier"] == pytest.approx(share @ (claim - right) ** 2, abs=1e-4)
    assert result["log_loss"] == pytest.approx(-share @ np.log(np.where(right, claim, 1 - claim)), abs=1e-4)
    larger = np.sign(claim[right, None] - claim[~right]) / 2 + 0.5
    assert result["auc"] == pytest.approx(
        share[right] @ larger @ share[~right] / (p := share @ right) / (1 - p), abs=2e-3
    )
    constant = result["constant"]
    assert constant["claimed"] == result["right"] == pytest.approx(p, abs=1e-4)
    assert (constant["error"], constant["auc"]) == (0.0, 0.5)
    assert constant["brier"] == pytest.approx(p * (1 - p), abs=1e-4)
    assert constant["log_loss"] == pytest.approx(-p * np.log(p) - (1 - p) * np.log(1 - p), abs=1e-4)


@pytest.mark.parametrize(("change", "auc"), [(0.9, 1.0), (0.1, 0.0), (0.5, 0.5)])
def test_ranking_is_seen_where_a_constant_claims_as_well(change, auc):
    """Claims of 0.5 and, on what is right, of another."""
    truth = np.zeros((64, 128, 3))
    estimate = np.ones_like(truth)
    estimate[:, :64] = 0
    confidence = np.full((64, 128), 0.5)
    confidence[:, :64] = change
    calibration = Calibration()
    calibration.add(confidence, estimate, truth)
    assert calibration.result()["auc"] == pytest.approx(auc)

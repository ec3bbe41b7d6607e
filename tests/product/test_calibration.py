"""Confidence: claims against what came true, on maps where both are known."""

import pickle

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
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


def test_the_error_is_over_ten_bins(rng):
    """Model cards quote it so: claims of 0.52 and 0.58 that are off by as much in turn are one honest bin."""
    confidence = np.where(np.arange(128) % 2, 0.52, 0.58) * np.ones((64, 1))
    truth = np.zeros((64, 128, 3))
    estimate = np.where(rng.random((64, 128)) < 0.55, 0.0, 1.0)[..., None] * np.ones(3)
    calibration = Calibration()
    calibration.add(confidence, estimate, truth)
    result = calibration.result()
    assert result["error"] == pytest.approx(abs(result["claimed"] - result["right"]), abs=1e-4)
    assert len(result["bins"]) == 1


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


def test_where_nothing_is_wrong_nothing_is_ranked():
    truth = np.zeros((64, 128, 3))
    calibration = Calibration()
    calibration.add(np.full((64, 128), 1.0), truth, truth)
    result = calibration.result()
    assert (result["auc"], result["brier"], result["error"]) == (None, 0.0, 0.0)
    assert result["log_loss"] == result["constant"]["log_loss"] == 0.0


def test_a_sure_claim_that_fails_costs_no_more_than_all_there_is():
    """ln 0 is none: a claim of 1 that is wrong costs -ln 1e-4, in the mean of half of the map half of it."""
    truth = np.zeros((64, 128, 3))
    estimate = np.where(np.arange(128)[:, None] < 64, 0.0, 1.0) * np.ones_like(truth)
    calibration = Calibration()
    calibration.add(np.ones((64, 128), np.float32), estimate, truth)
    assert calibration.result()["log_loss"] == pytest.approx(-np.log(1e-4) / 2, abs=1e-3)


def test_groups_are_their_own_pairs_beside_the_constant_of_all():
    """Outdoors all is right, indoors nothing: the one constant is as wrong in both."""
    truth, half = np.zeros((64, 128, 3)), np.full((64, 128), 0.5)
    calibration = Calibration()
    calibration.add(half, truth, truth, {"all", "outdoor"})
    calibration.add(half, truth + 1, truth, {"all", "indoor"})
    result = calibration.result()
    assert result["right"] == 0.5
    assert set(result["groups"]) == {"indoor", "outdoor", "seen half", "unseen half"}
    assert [result["groups"][name]["right"] for name in ("outdoor", "indoor")] == [1.0, 0.0]
    assert [result["groups"][name]["constant"]["error"] for name in ("outdoor", "indoor")] == [0.5, 0.5]
    assert [result["groups"][name]["constant"]["brier"] for name in ("outdoor", "indoor")] == [0.25, 0.25]


def test_the_seen_half_is_behind_the_camera():
    truth = np.zeros((64, 128, 3))
    estimate = np.where(pixel_directions(64)[..., 2:] > 0, truth, 1.0)
    calibration = Calibration()
    calibration.add(np.full((64, 128), 0.25), estimate, truth)
    groups = calibration.result()["groups"]
    assert (groups["seen half"]["right"], groups["unseen half"]["right"]) == (1.0, 0.0)


def test_what_is_kept_does_not_grow(rng):
    """Two hundred maps of one pair's sums are the sums of one."""
    confidence = rng.random((64, 128))
    estimate, truth = maps(rng, confidence, confidence)
    once, often = Calibration(), Calibration()
    once.add(confidence, estimate, truth)
    for _ in range(200):
        often.add(confidence, estimate, truth)
    assert often.result() == once.result()
    assert len(pickle.dumps(often)) == len(pickle.dumps(once))

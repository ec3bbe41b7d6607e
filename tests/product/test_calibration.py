"""Confidence: claims against what came true, on maps where both are known."""

import pickle
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.dataset import asset_store
from anyprobe.errors import InputError, ModelError
from anyprobe.evaluate.calibration import CLOSE, Calibration, calibrate, calibrate_errors, fit_logit, to_logit
from anyprobe.scatter.materials import total_reflectance


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

    with pytest.raises(ModelError, match="paper: expected a model that estimates its confidence"):
        calibrate(Silent(), [sphere_pair(1)])


def test_claimed_errors_hold_in_two_of_three_cases():
    """A model whose map is twice too bright, whose colour is true and which claims half a stop."""
    pairs = [sphere_pair(seed) for seed in range(3)]
    answers = iter([pair for pair in pairs for _ in range(2)])

    def model(crop, tan_half, material=None):
        pair = next(answers)
        claims = {"metal": 0.0, "red": 0.3, "green": 0.3, "blue": 0.3, "reflectance_error": 0.5}
        claims |= {"level_error": 0.5 * np.log(2.0), "color_error": 1.0}
        return SimpleNamespace(radiance=2 * pair.radiance, posterior=claims)

    of_reflectance, of_level, of_color = calibrate_errors(model, pairs)
    assert of_level == pytest.approx(2.0, rel=1e-5)
    assert of_color == pytest.approx(0.0, abs=0.05)
    given = pairs[0].material
    true = np.log(0.3 / total_reflectance(given.albedo, given.f0))
    assert of_reflectance == pytest.approx(np.abs(true).mean() / 0.5, rel=0.5)


def test_a_model_without_errors_cannot_be_asked_for_them():
    class Silent:
        name = "paper"

        def __call__(self, crop, tan_half, material):
            return SimpleNamespace(posterior=None)

    with pytest.raises(ModelError, match="paper: expected a model that estimates its errors"):
        calibrate_errors(Silent(), [sphere_pair(1)])


def test_what_is_left_out_is_what_no_run_learns_from(monkeypatch):
    def assets(names):
        return [SimpleNamespace(id=name, lifted=name == "d") for name in names]

    made = {True: assets("ab"), False: assets("abcd")}
    monkeypatch.setattr(
        asset_store,
        "load_asset_store",
        lambda data, split, commercial_only: asset_store.AssetStore(*2 * [made[commercial_only]]),
    )
    left = asset_store.load_left_out(Path("data"))
    assert (list(left.maps), list(left.shapes)) == (["c"], ["c", "d"])  # d: its lights are made up
    made[False] = made[True]
    with pytest.raises(InputError, match="0 maps and 0 shapes"):
        asset_store.load_left_out(Path("data"))

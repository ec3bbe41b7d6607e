"""What limits the irradiance image: gains that are found again, surfaces told apart, words that follow."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.some_pair import ball_pair

from anyprobe.cli.compare import irradiance_methods
from anyprobe.core.response import inverse_response, response
from anyprobe.evaluate.irradiance_limits import IrradianceLimits, best_gain, surface_groups
from anyprobe.evaluate.panel import Estimate, irradiance_scores
from anyprobe.evaluate.report import write_report
from anyprobe.evaluate.verdict import irradiance_lines

DARKER = np.array(0.5)
TINT = np.array([0.5, 0.25, 0.9])
FOUND = 5e-4
"""RMSE that the search's tolerance leaves."""


def dim_pair(seed=0, alpha=0.3, metal=False):
    """A pair whose irradiance is dark enough that no gain here clips it."""
    pair = ball_pair(seed, alpha=alpha)
    albedo = np.zeros(3) if metal else pair.material.albedo
    material = replace(pair.material, albedo=albedo)
    return replace(pair, irradiance=pair.irradiance // 2, material=material)


def lit_by(pair, gain):
    """The true irradiance image under gain times the light."""
    truth = pair.irradiance / 255.0
    return Estimate(ldr=np.zeros((64, 128, 3)), irradiance=response(inverse_response(truth) * gain))


def figures(pair, estimate, group="all"):
    limits = IrradianceLimits(["one"])
    limits.add(pair, {"one": estimate})
    photo, row = limits.result()["groups"][group]["rows"]
    assert (photo["design"], row["design"]) == ("photo", "one")
    return row


def test_one_gain_is_taken_away():
    row = figures(dim_pair(), lit_by(dim_pair(), DARKER))
    assert row["rmse"] > 0.03
    assert row["gain_rmse"] < FOUND
    assert row["gain_ssim"] == pytest.approx(1, abs=1e-4)
    assert row["gain_stops"] == pytest.approx(1, abs=2e-3)
    assert row["gain_explained"] == pytest.approx(1, abs=1e-3)


def test_a_tint_is_taken_away_by_channel_gains_alone():
    row = figures(dim_pair(), lit_by(dim_pair(), TINT))
    assert row["rmse"] > row["gain_rmse"] > 0.02
    assert row["channel_rmse"] < FOUND
    assert row["channel_ssim"] == pytest.approx(1, abs=1e-4)
    assert row["gain_explained"] < 0.95 < row["channel_explained"]


def test_what_no_gain_changes_stays():
    pair = dim_pair()
    black = figures(pair, Estimate(ldr=np.zeros(1), irradiance=np.zeros((128, 128, 3))))
    assert black["gain_rmse"] == black["channel_rmse"] == black["rmse"] > 0.03
    assert black["gain_explained"] == black["gain_stops"] == 0
    exact = figures(pair, lit_by(pair, 1.0))
    assert exact["rmse"] < 1e-6
    assert best_gain(pair.irradiance / 255.0, pair.irradiance / 255.0) == 0
    assert exact["gain_rmse"] < 1e-6


@pytest.mark.parametrize("stops", [-2.4, -0.3, 0.0, 1.7])
def test_the_gain_is_found_within_its_bounds(stops):
    linear = np.random.default_rng(0).uniform(0.02, 0.2, (32, 32, 3))
    assert best_gain(response(linear), response(linear * 2.0**stops)) == pytest.approx(stops, abs=2e-3)


def test_a_gain_out_of_bounds_stops_at_three():
    linear = np.random.default_rng(0).uniform(0.001, 0.01, (32, 32, 3))
    assert best_gain(response(linear), response(linear * 2.0**4)) == pytest.approx(3, abs=2e-3)


def test_figures_as_they_are_are_those_of_table_1():
    pair = ball_pair(2)
    estimate = replace(lit_by(pair, TINT), irradiance=lit_by(pair, TINT).irradiance + 0.01)  # around it, too
    table = irradiance_scores(estimate.irradiance, pair.irradiance / 255.0)
    row = figures(pair, estimate)
    assert row["rmse"] == pytest.approx(table["irradiance_rmse"], abs=1e-5)
    assert row["ssim"] == pytest.approx(table["irradiance_ssim"], abs=1e-5)


def test_the_photo_is_scored_inside_the_mask_it_was_given():
    pair = ball_pair(0)
    limits = IrradianceLimits([])
    limits.add(pair, {})
    assert limits.result()["groups"]["all"]["rows"][0]["rmse"] == 0  # a ball pair's photo is its irradiance
    cut = pair.photo.copy()
    cut[:, :64, 3] = 0
    limits = IrradianceLimits([])
    limits.add(replace(pair, photo=cut), {})
    assert limits.result()["groups"]["all"]["rows"][0]["rmse"] > 0.1


@pytest.mark.parametrize(
    ("alpha", "metal", "group"),
    [
        (0.05, True, "metal, alpha 0-0.1"),
        (0.1, False, "dielectric, alpha 0.1-0.5"),
        (0.49, True, "metal, alpha 0.1-0.5"),
        (0.5, False, "dielectric, alpha 0.5-1"),
        (1.0, True, "metal, alpha 0.5-1"),
    ],
)
def test_groups_are_split_by_material(alpha, metal, group):
    kind = "metal" if metal else "dielectric"
    assert surface_groups(dim_pair(alpha=alpha, metal=metal)) == ("all", kind, group)


def three_surfaces():
    """Models of which one is exact, one too dark, and one wrong on the smooth dielectric alone."""
    limits = IrradianceLimits(["exact", "dark", "flat"])
    for seed, alpha, metal in ((0, 0.05, False), (1, 0.3, True), (2, 0.8, False)):
        pair = dim_pair(seed, alpha, metal)
        noise = np.random.default_rng(0).uniform(size=(128, 128, 3))
        flat = lit_by(pair, 1.0) if alpha > 0.1 else Estimate(ldr=np.zeros(1), irradiance=noise)
        estimates = {"exact": lit_by(pair, 1.0), "dark": lit_by(pair, DARKER**2), "flat": flat}
        limits.add(pair, estimates)
    return limits.result()


def test_groups_have_their_own_pairs_and_means():
    groups = three_surfaces()["groups"]
    assert {name: one["pairs"] for name, one in groups.items()} == {
        "all": 3,
        "metal": 1,
        "metal, alpha 0.1-0.5": 1,
        "dielectric": 2,
        "dielectric, alpha 0-0.1": 1,
        "dielectric, alpha 0.5-1": 1,
    }
    flat = {name: one["rows"][3] for name, one in groups.items()}
    assert flat["metal"]["rmse"] < 1e-6
    assert flat["dielectric, alpha 0-0.1"]["rmse"] > 0.2
    assert flat["all"]["rmse"] == pytest.approx(flat["dielectric, alpha 0-0.1"]["rmse"] / 3, abs=1e-5)


def test_the_share_explained_is_of_the_squared_error_over_all_pairs():
    pairs, gains = (dim_pair(0), dim_pair(1)), (TINT, DARKER)
    each = [figures(pair, lit_by(pair, gain)) for pair, gain in zip(pairs, gains, strict=True)]
    limits = IrradianceLimits(["one"])
    for pair, gain in zip(pairs, gains, strict=True):
        limits.add(pair, {"one": lit_by(pair, gain)})
    left = sum(one["gain_rmse"] ** 2 for one in each) / sum(one["rmse"] ** 2 for one in each)
    explained = limits.result()["groups"]["all"]["rows"][1]["gain_explained"]
    assert explained == pytest.approx(1 - left, abs=1e-3)


def test_sentences_follow_from_the_figures():
    text = " ".join(" ".join(irradiance_lines(three_surfaces())).split())
    exact, dark, flat = (
        text.partition(f"- {one}: ")[2].partition(" - ")[0] for one in ("exact", "dark", "flat")
    )
    assert "As it is it meets the paper's SSIM on each of the 3 surfaces." in exact
    assert "(chosen with the truth; 2.00 stops up or down in the mean) has 100% less squared error" in dark
    assert "As it is it meets the paper's SSIM on none of the 3 surfaces." in dark
    assert "After the one gain it meets the paper's SSIM on each of the 3 surfaces." in dark
    assert (
        "on metal, alpha 0.1-0.5; dielectric, alpha 0.5-1, not on dielectric, alpha 0-0.1. After the one gain"
        in flat
    )
    assert "is that of dielectric, alpha 0-0.1 (the irradiance image of a smooth surface" in flat


def test_the_explanation_by_smooth_dielectrics_needs_them_to_be_worst():
    result = three_surfaces()
    worst = result["groups"]["metal, alpha 0.1-0.5"]["rows"][3]
    worst["gain_ssim"] = -0.5
    text = " ".join(irradiance_lines(result)).partition("- flat: ")[2]
    assert "-0.5000, is that of metal, alpha 0.1-0.5" in text
    assert "mirror image" not in text


SIZE = {"maps": 2, "shapes": 1}


def test_page_has_the_section_where_there_is_a_file(tmp_path):
    (tmp_path / "table1.json").write_text(
        json.dumps(
            dict.fromkeys(("command", "commit", "recipes", "note"), "x") | {"pairs": 3, "rows": []} | SIZE
        )
    )
    page = write_report(tmp_path, tmp_path / "page.md")
    assert "What limits the irradiance image" not in page.read_text()
    (tmp_path / "irradiance.json").write_text(json.dumps(three_surfaces()))
    text = write_report(tmp_path, page).read_text()
    assert "### What limits the irradiance image" in text
    assert "| dielectric, alpha 0-0.1 | 1 | flat |" in text
    assert "nan" not in text


def test_designs_show_as_the_model_whose_network_they_share():
    some_designs = SimpleNamespace(has_own_irradiance=False)
    assert irradiance_methods(["paper", "runs/lift"], some_designs) == ["paper", "lift"]
    assert irradiance_methods(["lift"], some_designs) == ["irradiance", "lift"]
    assert irradiance_methods(["lift"]) == ["lift"]
    learned = SimpleNamespace(has_own_irradiance=True)
    assert irradiance_methods(["paper"], learned) == ["irradiance", "paper"]

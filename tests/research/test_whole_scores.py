"""Figures of whole photos: false sources, sky over ground, what is said of errors, groups."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.ground import up_of
from anyprobe.estimate.result import Light
from anyprobe_train.evaluate.metrics import false_sources
from research.world.cut_outs import CutOut
from research.world.whole_scores import Answer, score, sky_over_ground, summary, world_from_photo


def lamps(*places: tuple[float, float, float], level: float = 0.1) -> np.ndarray:
    """A map with round lamps 4 degrees wide of a power, each given as azimuth, elevation [degrees] and power."""
    radiance, d = np.full((64, 128, 3), level, np.float32), pixel_directions(64)
    for azimuth, elevation, power in places:
        a, e = np.radians([azimuth, elevation])
        towards = np.array([np.sin(a) * np.cos(e), np.sin(e), -np.cos(a) * np.cos(e)])
        radiance[d @ towards > np.cos(np.radians(4))] += power / 0.0153
    return radiance


TRUTH = lamps((20, 40, 3.0), (-120, 30, 1.0))


@pytest.mark.parametrize(
    ("estimate", "drawn", "false"),
    [
        (TRUTH, 2, 0),
        (8 * TRUTH, 2, 0),  # the level is another figure's
        (lamps((20, 40, 3.0), (100, 30, 1.0)), 2, 1),
        (lamps((30, 40, 3.0), (-120, 40, 1.0)), 2, 0),  # 8 and 10 degrees off
        (lamps((55, 40, 3.0)), 1, 1),  # 26 off
        (lamps((-120, 30, 2.0)), 1, 0),  # stronger than it is, by less than four
        (lamps((20, 40, 0.4), (-120, 30, 60.0)), 1, 1),  # by more
        (lamps(level=0.5), 0, 0),
    ],
)
def test_a_source_is_false_where_the_truth_has_little_light(estimate, drawn, false):
    answer = Answer.of(estimate)
    assert (len(answer.sources), false_sources(answer.sources, estimate, TRUTH)) == (drawn, false)


@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(0, 0), (35, 0), (20, -15)])
def test_sky_over_ground_is_of_the_world_s_horizon(pitch_deg, roll_deg):
    above = pixel_directions(64) @ up_of(pitch_deg, roll_deg) > 0
    radiance = np.where(above[..., None], np.full(3, 2.0), 0.25).astype(np.float32)
    assert sky_over_ground(radiance, pitch_deg, roll_deg) == pytest.approx(3.0, abs=0.05)


def judged(truth=TRUTH):
    return CutOut(truth=truth, pitch_deg=20.0, roll_deg=0.0)


@pytest.mark.ci
def test_colour_is_of_the_dominant_light_and_sky_is_signed():
    red = TRUTH * np.array([1.0, 0.5, 0.5], np.float32)
    darker = TRUTH.copy()
    darker[pixel_directions(64) @ up_of(20.0) > 0] /= 4
    rows = score(judged(), {"same": TRUTH, "red": red, "dark sky": darker})
    assert rows["same"]["dominant_color"] == rows["same"]["sky_ground"] == 0
    assert rows["red"]["dominant_color"] == pytest.approx(np.degrees(np.arccos(2 / np.sqrt(3 * 1.5))), abs=0.1)
    assert rows["red"]["sky_ground"] == pytest.approx(0, abs=1e-5)
    assert rows["dark sky"]["sky_ground"] == pytest.approx(-2)


@pytest.mark.ci
def test_an_estimate_says_its_own_error(monkeypatch):
    light = Light(radiance=TRUTH)
    said = replace(light.dominant_light(), error_deg=3.5)
    monkeypatch.setattr(Light, "sources", lambda self: (said,))
    rows = score(judged(), {"estimate": light, "map": TRUTH})
    assert rows["estimate"]["said_deg"] == 3.5 != rows["map"]["said_deg"]


@lru_cache(maxsize=1)
def _perfect():
    return score(judged(), {"row": TRUTH})["row"]


def figures(**more):
    """A photo's figures, some of them others."""
    return _perfect() | more


@pytest.mark.ci
def test_the_summary_takes_thirds_by_hardness_and_errors_by_map():
    """The hardest of six lights are found best; photos of one map are the same photo."""
    degrees = [40.0, 30.0, 25.0, 12.0, 6.0, 2.0]
    rows = [figures(dominant_deg=deg, said_deg=12.0, true_hardness=0.1 * k) for k, deg in enumerate(degrees)]
    made = summary(rows, list("abcdef"))
    assert (made["dominant_deg"], made["dominant_deg_harder"], made["dominant_deg_hardest"]) == (18.5, 6, 4)
    assert made["said_holds"] == 0.5
    assert made["said_ranks"] == 0
    assert summary(rows * 5, list("abcdef") * 5)["ldr_rmse_error"] == made["ldr_rmse_error"]
    uneven = [figures(ldr_rmse=value) for value in np.random.default_rng(4).random(30)]
    by_photo, by_map = (summary(uneven, maps)["ldr_rmse_error"] for maps in (range(30), sorted("abc" * 10)))
    assert by_photo != by_map
    assert np.isnan(summary(uneven, ["one"] * 30)["ldr_rmse_error"])


@pytest.mark.parametrize("pitch_deg", [0.0, 30.0])
def test_the_camera_of_a_cut_out_looks_down_as_it_was_set_up(pitch_deg):
    turned = rotation_y(1.1) @ world_from_camera(0.7, np.radians(pitch_deg))
    pair = replace(sphere_pair(1), map_from_camera=turned)
    posture = CutOut.of(pair)
    assert posture.pitch_deg == pytest.approx(pitch_deg, abs=1e-6)
    np.testing.assert_allclose(world_from_photo(pitch_deg, 0.0)[1], turned[1], atol=1e-9)

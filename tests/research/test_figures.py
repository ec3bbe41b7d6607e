"""Every figure of the panel against a closed form or a case done by hand."""

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response, response
from anyprobe.light.environment import reduced
from anyprobe_train.dataset.asset_store import draw_map
from research.compare.figures import Estimate, ln_unit, relight_scores, score_pair, sh_irradiance_error, tone
from research.compare.lights import nearest_mean_deg, peak_direction
from research.compare.three_spheres import clean_scores, field_scores


def uniform(value=1.0):
    return np.full((64, 128, 3), value, np.float32)


def emitter(*places, ground=0.01):
    """A dark map with blocks of light, each (row, column, colour)."""
    radiance = uniform(ground)
    for row, column, color in places:
        radiance[row - 1 : row + 2, column - 1 : column + 2] = color
    return radiance


def drawn():
    return reduced(draw_map(np.random.default_rng(4), height=64)[0], 64).astype(np.float32)


def test_ln_unit_has_its_ends_where_it_says():
    values = ln_unit(np.exp(np.array([-9.0, -7.0, 0.0, 9.0, 10.0])))
    np.testing.assert_allclose(values, [0, 0, 7 / 16, 1, 1], atol=1e-6)
    assert float(tone(np.array(1.0))) == pytest.approx(0.5 ** (1 / 2.2))


def test_sh_irradiance_error_in_closed_form():
    g = uniform(1.0)
    p = g + 0.3 * pixel_directions(64)[..., 1:2]
    assert sh_irradiance_error(p, g) == pytest.approx(np.sqrt(4 / 27) * 0.3, rel=2e-3)
    assert sh_irradiance_error(2 * drawn(), drawn()) == pytest.approx(1.0, rel=1e-5)


def test_peak_is_where_the_most_light_is_not_the_brightest_pixel():
    radiance = emitter((20, 40, 5.0))
    radiance[50, 100] = 9.0  # one pixel: less within 5 degrees
    expected = pixel_directions(64)[20, 40]
    assert np.degrees(np.arccos(peak_direction(radiance) @ expected)) < 2.0


def test_nearest_mean_by_hand():
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert nearest_mean_deg([x], [x, y]) == pytest.approx(22.5)
    assert nearest_mean_deg([x, y], [y, x]) == 0.0


@pytest.mark.ci
def test_field_scores_do_not_see_exposure_and_clean_ones_do():
    truth = drawn()
    (field,) = field_scores(truth, [2 * truth])
    assert max(field.values()) < 0.05
    (clean,) = clean_scores(uniform(1.0), [uniform(2.0)])
    assert clean["clean_diffuse_rmse"] == pytest.approx(1.0, rel=1e-3)
    assert clean["clean_silver_si_rmse"] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.ci
def test_the_truth_scores_perfectly_and_ldr_methods_have_no_hdr_figures():
    pair = sphere_pair()
    ldr = response(pair.radiance)
    rows = score_pair(
        pair,
        {
            "truth": Estimate(ldr=ldr, radiance=pair.radiance, irradiance=pair.irradiance / 255.0),
            "grey": Estimate(ldr=np.repeat(ldr.mean(axis=2, keepdims=True), 3, axis=2)),
        },
    )
    truth = rows["truth"]
    for name, value in truth.items():
        if name.endswith("psnr"):
            assert value == np.inf
        elif name.endswith("ssim"):
            assert value == pytest.approx(1.0)
        else:
            assert value == pytest.approx(0.0, abs=0.1), name
    assert "hdr_rmse" not in rows["grey"]
    assert "total_power_stops" not in rows["grey"]
    linear = inverse_response(np.repeat(ldr.mean(axis=2, keepdims=True), 3, axis=2))
    (relit,) = relight_scores([pair.radiance, linear])
    assert rows["grey"]["relight_rmse"] == pytest.approx(relit["relight_rmse"])
    assert {"field_mirror_rmse", "clean_mirror_rmse", "array_rmse"} <= set(rows["grey"])
    assert "irradiance_ssim" not in rows["grey"]
    assert rows["grey"]["ldr_rmse"] > 0.0

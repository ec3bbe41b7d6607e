"""Every figure of the panel against a closed form or a case done by hand."""

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response, response
from anyprobe.core.sampling import hammersley
from anyprobe.light.environment import shrink
from anyprobe.light.octahedral import build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS, shade_specular
from anyprobe.render.spheres import sphere_normals
from anyprobe_train.dataset.asset_store import draw_map
from research.compare.figures import (
    Estimate,
    hdr_scores,
    ldr_scores,
    ln_unit,
    mirror_sphere,
    relight_scores,
    score_pair,
    sh_irradiance_error,
    sphere_scores,
    tone,
    total_power_stops,
)
from research.compare.lights import find_lights, matched_lights_deg, nearest_mean_deg, peak_direction
from research.compare.three_spheres import (
    MIRROR_SIZE,
    _mirror,
    clean_scores,
    field_scores,
    field_tone,
    normalised_rmse,
    pixel_angle_deg,
    pixel_rmse,
    pixel_si_rmse,
)
from research.compare.transport import array_of_spheres, light, sphere_matrix


def uniform(value=1.0):
    return np.full((64, 128, 3), value, np.float32)


def emitter(*places, ground=0.01):
    """A dark map with blocks of light, each (row, column, colour)."""
    radiance = uniform(ground)
    for row, column, color in places:
        radiance[row - 1 : row + 2, column - 1 : column + 2] = color
    return radiance


def drawn():
    return shrink(draw_map(np.random.default_rng(4), height=64)[0], 64).astype(np.float32)


def test_ln_unit_has_its_ends_where_it_says():
    values = ln_unit(np.exp(np.array([-9.0, -7.0, 0.0, 9.0, 10.0])))
    np.testing.assert_allclose(values, [0, 0, 7 / 16, 1, 1], atol=1e-6)
    assert float(tone(np.array(1.0))) == pytest.approx(0.5 ** (1 / 2.2))


def test_hdr_scores_by_hand():
    scores = hdr_scores(uniform(np.e), uniform(1.0))  # one step of ln, of sixteen
    assert scores["hdr_rmse"] == pytest.approx(1 / 16, rel=1e-5)
    assert scores["hdr_psnr"] == pytest.approx(20 * np.log10(16), rel=1e-5)
    assert hdr_scores(drawn(), drawn())["hdr_ssim"] == pytest.approx(1.0)


def test_halves_of_the_map_are_told_apart():
    truth = uniform(0.5)
    estimate = truth.copy()
    estimate[pixel_directions(64)[..., 2] < 0] += 0.1  # behind the object
    scores = ldr_scores(estimate, truth)
    assert scores["ldr_rmse_seen"] == 0.0
    assert scores["ldr_rmse_unseen"] == pytest.approx(0.1, rel=1e-5)
    assert scores["ldr_rmse"] == pytest.approx(0.1 / np.sqrt(2), rel=1e-5)


def test_mirror_sphere_shows_the_camera_in_its_middle_and_the_sky_above():
    sphere = mirror_sphere((pixel_directions(64) + 1) / 2)
    np.testing.assert_allclose(sphere[31:33, 31:33].mean(axis=(0, 1)), [0.5, 0.5, 1.0], atol=0.01)
    row = round(32 - 32 * np.sin(np.pi / 4))  # n at 45 degrees mirrors +Y
    np.testing.assert_allclose(sphere[row, 31:33].mean(axis=0), [0.5, 1.0, 0.5], atol=0.04)
    scores = sphere_scores(uniform(0.5), uniform(0.6))
    assert scores["sphere_rmse"] == pytest.approx(0.1, rel=1e-5)


def test_power_is_told_channel_by_channel():
    truth = drawn()
    stops = total_power_stops(truth * np.array([2, 0.25, 1], np.float32), truth)
    assert [stops[f"power_{c}_stops"] for c in "rgb"] == pytest.approx([1, 2, 0], abs=1e-5)


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


def test_lights_are_found_brightest_first_and_by_blue_alone_as_published():
    red, blue = (10.0, 0.0, 0.0), (0.0, 0.0, 14.0)
    radiance = emitter((30, 30, red), (30, 90, blue), ground=0.0)
    d = pixel_directions(64)
    found = find_lights(radiance)
    assert len(found) == 2
    np.testing.assert_allclose(found[0], d[30, 30], atol=0.01)
    published = find_lights(radiance, published=True)
    assert len(published) == 1
    np.testing.assert_allclose(published[0], d[30, 90], atol=0.01)


def test_an_even_map_has_no_light_and_close_ones_are_one():
    assert find_lights(uniform()) == []
    sky = uniform(0.0)
    sky[:40] = 1.0  # over half of the picture
    assert find_lights(sky) == []
    sky[:, 64:] = 0.0  # a quarter of it is one
    assert len(find_lights(sky)) == 1
    assert len(find_lights(emitter((30, 30, 5.0), (30, 34, 5.0)))) == 1
    assert matched_lights_deg([], find_lights(emitter((30, 30, 5.0)))) is None


def test_nearest_mean_by_hand():
    x, y = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert nearest_mean_deg([x], [x, y]) == pytest.approx(22.5)
    assert nearest_mean_deg([x, y], [y, x]) == 0.0


def test_field_arithmetic_by_hand():
    g = np.array([[1.0, 1.0, 0.0], [2.0, 1.0, 1.0]])
    assert pixel_rmse(g + 1, g) == pytest.approx(np.sqrt(3))
    assert pixel_si_rmse(2 * g, g) == pytest.approx(0.0, abs=1e-7)
    assert pixel_si_rmse(np.array([[1.0, 0, 0]]), np.array([[1.0, 1.0, 0]])) == pytest.approx(1.0)
    assert normalised_rmse(3 * g, g) == pytest.approx(0.0, abs=1e-9)
    toned = field_tone(drawn())
    assert np.median(toned[toned > 0]) == pytest.approx(0.5)
    np.testing.assert_allclose(field_tone(7 * drawn()), toned, rtol=1e-5)  # exposure drops out


@pytest.mark.ci
def test_field_scores_do_not_see_exposure_and_clean_ones_do():
    truth = drawn()
    (field,) = field_scores(truth, [2 * truth])
    assert max(field.values()) < 0.05
    (clean,) = clean_scores(uniform(1.0), [uniform(2.0)])
    assert clean["clean_diffuse_rmse"] == pytest.approx(1.0, rel=1e-3)
    assert clean["clean_silver_si_rmse"] == pytest.approx(0.0, abs=1e-4)


def test_a_mirror_sphere_shows_as_much_light_as_the_sphere_sends():
    """Seen from far away, each pixel of the sphere shows the same solid angle: its mean is the map's, sun or not."""
    sun = uniform(0.02)
    sun[20, 17] = 900.0  # one pixel of 2.8 degrees
    weights = np.broadcast_to(pixel_solid_angles(64), (64, 128)) / (4 * np.pi)
    (sphere,) = _mirror([sun], 1.0)
    assert sphere.mean() == pytest.approx((sun[..., 0] * weights).sum(), rel=0.03)


def test_the_fields_mirror_grows_brighter_towards_its_edge():
    (sphere,) = _mirror([uniform()], 0.8)
    slant = sphere_normals(MIRROR_SIZE)[0][:, 2]
    np.testing.assert_allclose(sphere[slant > 0.99], 0.8, atol=1e-4)
    assert sphere[slant < 0.1].min() > 0.9


def test_black_pixels_count_no_angle_in_the_published_figure():
    p, g = np.array([[1.0, 0, 0], [0, 0, 0]]), np.array([[0, 1.0, 0], [1.0, 0, 0]])
    assert pixel_angle_deg(p, g) == pytest.approx(45.0)
    assert pixel_angle_deg(np.zeros((2, 3)), g) == 0.0


def test_white_sphere_sends_back_what_it_gets():
    matrix = sphere_matrix(64, 16, albedo=1.0)
    (sphere,) = light(matrix, [uniform(0.7)])
    np.testing.assert_allclose(sphere, 0.7, rtol=2e-3)


@pytest.mark.ci
def test_silver_matrix_agrees_with_the_sampled_renderer():
    radiance = drawn()
    some = slice(None, None, 97)
    normals = sphere_normals(64)[0][some]
    wo = np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape)
    pyramid = build_pyramid(radiance, side=128, emitters=NUM_EMITTERS)
    _, s1, ss = shade_specular(pyramid, normals, wo, 0.3, hammersley(2048))
    (sphere,) = light(sphere_matrix(64, 64, f0=0.9, alpha=0.3), [radiance])
    sampled = 0.9 * s1 + 0.1 * ss
    inside = normals[:, 2] > 0.3
    assert np.abs(sphere[some] - sampled)[inside].mean() < 0.02 * sampled[inside].mean()


@pytest.mark.ci
def test_spheres_stand_in_the_light_and_cast_shadows():
    even = array_of_spheres([uniform()])[0]
    assert even[0, 0].mean() == pytest.approx(0.8, rel=0.05)  # far plane: nearly the whole sky
    sky = uniform(0.0)
    sky[:2] = 1.0  # from straight above
    picture = array_of_spheres([sky])[0]
    rows = pixel_solid_angles(64)[:2, 0]
    expected = 0.8 / np.pi * 128 * (rows * np.cos((np.arange(2) + 0.5) * np.pi / 64)).sum()
    assert picture[0, 0].mean() == pytest.approx(expected, rel=0.02)
    assert picture.max() == pytest.approx(expected, rel=0.05)  # their tops
    low = uniform(0.0)
    low[24:26, 95:97] = 1.0  # 20 degrees up on the right: half of each sphere and its long shadow are dark
    assert (array_of_spheres([low])[0].max(axis=-1) < 1e-6).mean() > 0.2


@pytest.mark.ci
def test_relighting_by_the_truth_has_no_error():
    truth = drawn() * np.float32(0.2)
    same, brighter = relight_scores([truth, truth, 2 * truth])
    assert same["relight_rmse"] == 0.0
    assert brighter["relight_rmse"] > 0.01


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

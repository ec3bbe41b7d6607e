"""Metrics by hand and against another implementation; the three spheres under simple lights."""

import math

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.render.spheres import sphere_images, sphere_normals
from anyprobe_train.evaluate.metrics import (
    color_angle_deg,
    direction_error_deg,
    power_ratio_stops,
    psnr,
    rmse,
    si_rmse,
    ssim,
)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_rmse_is_a_sum_or_a_square():
    assert rmse(np.zeros((4, 4, 3)), np.full((4, 4, 3), 0.5)) == pytest.approx(0.5)
    assert rmse(np.zeros(4), np.array([2.0, 0, 0, 0])) == pytest.approx(1.0)


def test_psnr_uses_the_wrong_peak():
    a, b = np.zeros((4, 4)), np.full((4, 4), 0.1)
    assert psnr(a, b) == pytest.approx(20.0)
    assert psnr(a, b, peak=10.0) == pytest.approx(40.0)
    assert psnr(b, b) == math.inf


@pytest.mark.parametrize("shape", [(40, 33), (24, 48, 3), (11, 11, 3)])
def test_ssim_is_not_the_published_one(rng, shape):
    metrics = pytest.importorskip("skimage.metrics", reason="scikit-image is a development dependency")
    a = rng.random(shape)
    b = np.clip(0.7 * a + 0.3 * rng.random(shape), 0, 1)
    expected = metrics.structural_similarity(
        a,
        b,
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1.0,
        channel_axis=-1 if len(shape) == 3 else None,
    )
    assert ssim(a, b) == pytest.approx(expected, abs=1e-6)


def test_si_rmse_by_hand_and_by_search(rng):
    """p = (1, 0), g = (1, 1) in every channel: s = 1, residual (0, 1). Any other scale is worse."""
    p, g = np.array([[1.0] * 3, [0.0] * 3]), np.ones((2, 3))
    assert si_rmse(p, g, np.ones(2, bool)) == pytest.approx(math.sqrt(0.5))
    p, g, mask = rng.random((50, 3)), rng.random((50, 3)), np.ones(50, bool)
    assert si_rmse(p, g, mask) <= min(rmse(s * p, g) for s in np.linspace(0, 2, 201))
    assert si_rmse(0 * p, g, mask) == pytest.approx(rmse(0 * g, g))


def test_color_angle_is_not_the_mean_over_the_mask():
    p = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 1.0]])
    g = np.array([[1.0, 0, 0], [1.0, 1.0, 0], [0, 1.0, 0]])
    assert color_angle_deg(p, g, np.array([True, True, False])) == pytest.approx(22.5)


def test_direction_error_loses_small_angles():
    """arccos of a rounded cosine is blind below 0.02 degrees in float32 and NaN above 1."""
    a = np.array([0.0, 0.6, -0.8], np.float32)
    assert direction_error_deg(a, a) == 0
    assert direction_error_deg(a, -a) == pytest.approx(180)
    assert direction_error_deg([1, 0, 0], [0, 0, 2]) == pytest.approx(90)
    tiny = 1e-5
    assert direction_error_deg([1, 0, 0], [math.cos(tiny), math.sin(tiny), 0]) == pytest.approx(math.degrees(tiny))


def test_power_ratio_counts_rows_alike(rng):
    g = rng.random((16, 32, 3))
    assert power_ratio_stops(2 * g, g) == pytest.approx(1.0)
    assert power_ratio_stops(g / 4, g) == pytest.approx(-2.0)
    pole, equator = np.zeros((2, 16, 32, 3))
    pole[0], equator[8] = 1, 1
    expected = math.log2(float(pixel_solid_angles(16)[0, 0] / pixel_solid_angles(16)[8, 0]))
    assert power_ratio_stops(pole, equator) == pytest.approx(expected, abs=1e-5)
    assert power_ratio_stops(np.ones((8, 16, 3)), np.ones((64, 128, 3))) == pytest.approx(0, abs=1e-6)


def test_sphere_is_upside_down_or_inside_out():
    normals, mask = sphere_normals(64)
    assert normals.shape == (mask.sum(), 3)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    assert (normals[:, 2] >= 0).all()
    assert mask.mean() == pytest.approx(np.pi / 4, abs=0.01)
    picture = np.zeros((64, 64, 3))
    picture[mask] = normals
    assert picture[2, 32, 1] > 0.8  # the picture's top is +Y
    assert picture[32, 61, 0] > 0.8  # its right is +X


def test_spheres_under_even_light():
    """Lambert 1 and a mirror show the light itself; silver a little less, nowhere more."""
    spheres = sphere_images(np.full((64, 128, 3), 2.0, np.float32))
    _, mask = sphere_normals(64)
    np.testing.assert_allclose(spheres["diffuse"][mask], 2.0, rtol=1e-3)
    np.testing.assert_allclose(spheres["mirror"][mask], 2.0, rtol=1e-5)
    assert (spheres["silver"][mask] < 2.0).all()
    assert (spheres["silver"][mask] > 1.3).all()
    for picture in spheres.values():
        assert picture.shape == (64, 64, 3)
        assert (picture[~mask] == 0).all()

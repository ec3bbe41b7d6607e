"""Skies, rooms and studios of our own, and new light from old: closed forms, energy, real numbers."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.color import luminance
from anyprobe.core.latlong import direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.light.environment import integral
from anyprobe_train.dataset import room as rooms
from anyprobe_train.dataset.asset_store import room, sky, studio
from anyprobe_train.dataset.sky import (
    REC709_FROM_XYZ,
    clear_sky,
    direction_at,
    horizontal_irradiance,
    matching_functions,
    scattered_irradiance,
    sky_radiance,
    soft_box,
    soft_cap,
    sun_disc,
    sun_irradiance,
    zenith_luminance,
)

HALF = np.array([2.0, 1.2, 3.1])
"""A box with no two sides alike: axes in the wrong order show."""


def mean_luminance(radiance: np.ndarray) -> float:
    return float(luminance(integral(radiance.astype(np.float64)))) / (4 * np.pi)


def daylight(height: int, sun: np.ndarray, turbidity: float, ground: np.ndarray | float = 0.2) -> np.ndarray:
    """Clear sky, sun, and an even Lambert ground of albedo `ground` under the horizon: [H, 2H, 3]."""
    d = pixel_directions(height).astype(np.float64)
    beam = sun_irradiance(np.arcsin(np.clip(sun[1], 0.0, 1.0)), turbidity)
    above = np.where(d[..., 1:2] > 0, clear_sky(d, sun, turbidity), 0.0)
    floor = ground * (horizontal_irradiance(above) + beam * max(sun[1], 0.0)) / np.pi
    return np.where(d[..., 1:2] > 0, above + sun_disc(height, sun, beam), floor)


# Families


@pytest.mark.ci
@pytest.mark.parametrize("family", [sky, room, studio])
def test_a_map_is_light_of_mean_one(family):
    for seed in range(6):
        radiance = family(np.random.default_rng(seed), height=64)
        assert radiance.shape == (64, 128, 3)
        assert radiance.dtype == np.float32
        assert np.isfinite(radiance).all()
        assert radiance.min() >= 0
        np.testing.assert_allclose(mean_luminance(radiance), 1.0, rtol=1e-4)
        np.testing.assert_array_equal(radiance, family(np.random.default_rng(seed), height=64))
    assert not np.array_equal(radiance, family(np.random.default_rng(99), height=64))


@pytest.mark.ci
@pytest.mark.parametrize("family", [sky, room, studio])
def test_a_map_is_the_same_at_every_height(family):
    """The seed decides the scene, the height only how finely it is drawn."""
    for seed in range(4):
        coarse, fine = (family(np.random.default_rng(seed), height=h).astype(np.float64) for h in (64, 128))
        up = np.maximum(pixel_directions(64)[..., 1], 0.0) * pixel_solid_angles(64)
        fine = fine.reshape(64, 2, 128, 2, 3).mean(axis=(1, 3))
        a, b = (np.einsum("hwc,hw->c", m, up) for m in (coarse, fine))
        np.testing.assert_allclose(a, b, rtol=0.12)


# Sky


@pytest.mark.parametrize(
    ("turbidity", "elevation_deg", "by_hand"),
    # chi = (4/9 - T/120) (pi - 2 theta_s), then (4.0453 T - 4.9710) tan(chi) - 0.2155 T + 2.4192
    [(2.0, 90.0, 15.5007), (3.0, 45.0, 7.3204), (6.0, 30.0, 9.5853), (4.0, 0.0, 1.5572)],
)
def test_zenith_luminance_is_the_papers(turbidity, elevation_deg, by_hand):
    np.testing.assert_allclose(zenith_luminance(np.radians(elevation_deg), turbidity), by_hand, rtol=1e-4)


@pytest.mark.parametrize(
    ("turbidity", "theta_s", "theta", "azimuth", "x", "y", "kcd"),
    [
        (2.0, 0.5, 0.0, 0.0, 0.252494, 0.257243, 6.05229),
        (3.0, np.pi / 4, np.pi / 3, np.pi / 2, 0.250270, 0.262025, 7.31875),  # beside the sun
        (3.0, np.pi / 4, np.pi / 3, 0.0, 0.281140, 0.290597, 21.7224),  # 15 degrees under it
    ],
)
def test_sky_is_the_papers_elsewhere(turbidity, theta_s, theta, azimuth, x, y, kcd):
    """Numbers worked out apart from the package: Eq. 3 and 4 with the coefficients of A2."""
    sun, d = direction_at(0.4, np.pi / 2 - theta_s), direction_at(0.4 + azimuth, np.pi / 2 - theta)
    xyz = np.linalg.inv(REC709_FROM_XYZ) @ sky_radiance(d, sun, turbidity)
    np.testing.assert_allclose(xyz[:2] / xyz.sum(), [x, y], atol=1e-5)
    np.testing.assert_allclose(xyz[1], kcd, rtol=1e-4)


def test_matching_functions_are_of_1931():
    """Equal energy is white: all three integrate to 106.9 nm; y peaks at 555 nm with 1."""
    nm = np.arange(360.0, 831.0)
    values = matching_functions(nm)
    np.testing.assert_allclose(values.sum(axis=0), 106.9, rtol=0.01)
    assert abs(nm[np.argmax(values[:, 1])] - 555) <= 4
    np.testing.assert_allclose(values[:, 1].max(), 1.0, atol=0.02)


def test_sun_and_sky_share_the_light_as_in_the_real_world():
    """Clear, sun at 45 degrees: the sun gives the ground 3 to 10 times what the sky gives, 10 to 20 klx."""
    sun = direction_at(1.0, np.radians(45))
    for turbidity in (2.0, 2.5):
        d = pixel_directions(64).astype(np.float64)
        above = np.where(d[..., 1:2] > 0, clear_sky(d, sun, turbidity), 0.0)
        from_sky = luminance(horizontal_irradiance(above))
        from_sun = luminance(sun_irradiance(np.radians(45), turbidity)) * sun[1]
        assert 10 < from_sky < 20
        assert 3 < from_sun / from_sky < 10
        np.testing.assert_allclose(from_sky, scattered_irradiance(np.radians(45), turbidity), rtol=0.02)


def test_ground_sends_back_its_albedo():
    """Lambert: pi L = albedo E, with E of the upper half as drawn, sun and all."""
    radiance = daylight(128, direction_at(0.3, 0.9), 2.5, ground=0.3)
    np.testing.assert_allclose(radiance[100, 17], 0.3 * horizontal_irradiance(radiance) / np.pi, rtol=0.02)


# Room


def test_form_factors_of_a_box_close():
    factors, areas = rooms.form_factors(HALF), rooms.patch_areas(HALF)
    assert factors.min() >= 0
    np.testing.assert_allclose(factors.sum(axis=1), 1.0, atol=1e-9)
    exchange = areas[:, None] * factors
    np.testing.assert_allclose(exchange, exchange.T, atol=1e-12)
    np.testing.assert_allclose(areas.sum(), 8 * (2.0 * 1.2 + 2.0 * 3.1 + 1.2 * 3.1))


def test_form_factors_of_a_cube_are_known():
    """0.199825 to the wall across (every heat transfer book), the rest to the four beside."""
    factors = rooms.form_factors(np.ones(3), patches=3).reshape(6, 9, 6, 9).sum(axis=3).mean(axis=1)
    across = factors[np.arange(6), np.arange(6) ^ 1]
    np.testing.assert_allclose(across, 0.199825, atol=1e-6)
    np.testing.assert_allclose(np.diag(factors), 0.0)
    np.testing.assert_allclose(factors[0, 2:], (1 - 0.199825) / 4, atol=1e-6)


@pytest.mark.parametrize("albedo", [0.0, 0.3, 0.8])
def test_even_walls_add_a_power_of_albedo_a_bounce(albedo):
    """A closed box that shines with e everywhere: e (1 + rho + rho^2) after two bounces."""
    factors = rooms.form_factors(HALF)
    source = np.tile([1.0, 2.0, 0.5], (len(factors), 1))
    after = source + rooms.reflected(factors, np.full_like(source, albedo), source, bounces=2)
    np.testing.assert_allclose(after, source * (1 + albedo + albedo**2), rtol=1e-9)


def test_white_walls_lose_nothing():
    """Albedo 1 in a closed box: each bounce sends out the power that came, whoever shone."""
    factors, areas = rooms.form_factors(HALF), rooms.patch_areas(HALF)
    source = np.random.default_rng(5).exponential(size=(len(factors), 3)) ** 3
    back = rooms.reflected(factors, np.ones_like(source), source, bounces=3)
    np.testing.assert_allclose(areas @ back, 3 * (areas @ source), rtol=1e-9)


def test_sun_through_a_window_keeps_its_power():
    """What falls on floor and walls is what came in: the window's area times its cosine."""
    window = rooms.Rectangle(wall=5, centre=np.array([-0.4, 0.3]), extent=np.array([0.8, 0.6]))
    points, areas = rooms.patch_points(HALF, 60), rooms.patch_areas(HALF, 60)
    for sun in (direction_at(np.pi - 0.3, 0.5), direction_at(np.pi + 0.6, 0.9)):
        lit = rooms.sunlit(points, HALF, window, sun)[:, 0]
        np.testing.assert_allclose(lit @ areas, 4 * 0.8 * 0.6 * sun[2], rtol=0.03)
        assert lit[points.wall == 5].max() == 0
    assert rooms.sunlit(points, HALF, window, direction_at(0.3, 0.5)).max() == 0  # from the other side


# Studio


def test_lamps_of_a_studio_have_their_size():
    d = pixel_directions(256).astype(np.float64)
    weights = pixel_solid_angles(256)
    centre = direction_at(0.7, 0.4)
    cap = soft_cap(d, centre, 0.4)[..., 0]
    np.testing.assert_allclose((cap * weights).sum(), 2 * np.pi * (1 - np.cos(0.4)), rtol=0.02)
    box = soft_box(d, centre, np.array([0.6, 0.2]))[..., 0]
    # of a rectangle a unit away: 4 asin(ab / sqrt((1 + a^2)(1 + b^2)))
    truth = 4 * np.arcsin(0.6 * 0.2 / np.sqrt((1 + 0.36) * (1 + 0.04)))
    np.testing.assert_allclose((box * weights).sum(), truth, rtol=0.02)
    np.testing.assert_allclose(direction_to_uv(direction_at(0.6, 0.3)), [0.5 + 0.3 / np.pi, 0.5 - 0.3 / np.pi])

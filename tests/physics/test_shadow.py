"""What a mesh leaves of the ground's light: closed forms for a sphere, emitters and places."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest

from anyprobe.core.frames import rotation_x
from anyprobe.core.latlong import pixel_directions
from anyprobe.relight.shadow import GroundShadow, sample_sky, sky_irradiance
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.voxels import sharp_shares

RADIUS = 0.5
FEW = 32
"""Number of directions where one lamp is all the light."""

UP = np.array([0.0, 1.0, 0.0])
FOOT = np.array([0.3, -2.0, -4.0])


def unit_sphere(up: np.ndarray = UP) -> Mesh:
    """A sphere of RADIUS that touches the ground at FOOT."""
    mesh = sphere(24)
    return Mesh(positions=mesh.positions * RADIUS + FOOT + RADIUS * up, faces=mesh.faces, normals=mesh.normals)


def emitter_map(direction, color=(60.0, 60.0, 60.0), radius_deg: float = 4.0) -> np.ndarray:
    toward = np.asarray(direction, float) / np.linalg.norm(direction)
    inside = pixel_directions(64) @ toward > np.cos(np.radians(radius_deg))
    return (inside[..., None] * np.asarray(color)).astype(np.float32)


def surroundings(shadow: GroundShadow, distance: float, count: int = 64) -> np.ndarray:
    """Points of the ground on a circle around FOOT."""
    angle = np.arange(count) * 2 * np.pi / count
    circle = np.cos(angle)[:, None] * shadow.side + np.sin(angle)[:, None] * shadow.across
    return FOOT + distance * circle


@pytest.mark.ci
@pytest.mark.parametrize(("distance", "tilt"), [(0.6, 0.4), (1.0, 0.0), (2.0, 0.4)])
def test_sphere_under_an_even_sky_hides_its_form_factor(distance, tilt):
    """A sphere of radius r, all above the horizon, seen from D away at height h, hides (h / D) (r / D)^2."""
    up = rotation_x(tilt) @ UP
    even = np.ones((32, 64, 3), np.float32)
    shadow = GroundShadow(unit_sphere(up), FOOT, RADIUS, up, even, count=256, grid=64)
    squared = (distance * RADIUS) ** 2 + RADIUS**2
    hidden = 1 - shadow.at(surroundings(shadow, distance * RADIUS)).mean()
    assert hidden == pytest.approx(RADIUS**3 / squared**1.5, rel=0.02)


def test_point_of_contact_is_black():
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, np.ones((32, 64, 3), np.float32), count=64)
    assert shadow.at(FOOT[None]).max() < 0.1


@pytest.mark.parametrize("direction", [(1, 1, 0), (-1, 2, 1), (0.2, 1, -1.0)])
def test_small_light_throws_the_shadow_where_its_rays_land(direction):
    toward = np.asarray(direction) / np.linalg.norm(direction)
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, emitter_map(toward), count=FEW)
    centre = FOOT + RADIUS * UP - RADIUS / toward[1] * toward  # of the sphere, along the ray to the ground
    across = np.cross(toward, UP) / np.linalg.norm(np.cross(toward, UP))
    assert shadow.at(centre[None]).max() < 0.02
    assert shadow.at((centre + 0.8 * RADIUS * across)[None]).max() < 0.05
    assert shadow.at((centre + 1.2 * RADIUS * across)[None]).min() > 0.95
    opposite = FOOT - 2 * (centre - FOOT)
    assert shadow.at(opposite[None]).min() == 1


def test_wider_light_throws_a_softer_shadow():
    """The width of the edge of a far shadow grows with the emitter."""
    toward = np.array([1.0, 0.7, 0.0]) / np.linalg.norm([1.0, 0.7, 0.0])
    partly = []
    for radius_deg in (3.0, 12.0):
        light = emitter_map(toward, radius_deg=radius_deg)
        shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, light, count=FEW)
        partly.append(((shadow.ratio > 0.1) & (shadow.ratio < 0.9)).sum())
    assert partly[1] > 2 * partly[0]


def test_shadow_has_the_other_lights_color():
    """A red emitter and a blue one: where the red one is hidden, blue is left."""
    red, blue = np.array([1.0, 1, 0]), np.array([-1.0, 1, 0])
    light = emitter_map(red, (60, 0, 0)) + emitter_map(blue, (0, 0, 60))
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, light, count=2 * FEW)
    left = shadow.at((FOOT + RADIUS * UP - RADIUS * red)[None])[0]
    assert left[0] < 0.05
    assert left[2] > 0.95


@pytest.mark.ci
def test_light_that_does_not_reach_the_ground_is_not_lost_again():
    """Of two lamps a wall keeps one off: its shadow is gone, and the other's is all the light that there is."""
    kept, other = np.array([1.0, 1, 0]), np.array([-1.0, 1, 0])
    light = emitter_map(kept) + emitter_map(other)
    x, z = 2 * RADIUS, np.array([-3.0, 3.0, 3.0, -3.0])
    corners = FOOT + np.stack([np.full(4, x), np.array([0.0, 0.0, 3.0, 3.0]), z], axis=-1)
    wall = Mesh(positions=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]), normals=np.zeros((2, 3, 3)))
    shadows = [GroundShadow(unit_sphere(), FOOT, RADIUS, UP, light, 2 * FEW, beside=one) for one in (None, wall)]
    centres = FOOT + np.array([[-RADIUS, 0, 0], [RADIUS, 0, 0]])
    free, beside_wall = (shadow.at(centres).mean(axis=-1) for shadow in shadows)
    np.testing.assert_allclose(free, 0.5, atol=0.1)
    np.testing.assert_allclose(beside_wall, [1.0, 0.0], atol=0.02)
    behind_wall = shadows[1].at((FOOT + np.array([3 * RADIUS, 0, 0]))[None])
    assert np.isfinite(behind_wall).all()


@pytest.mark.parametrize(("likely", "off_share"), [(0.0, 0.3), (0.8, 0.9)])
def test_a_shadow_that_is_seen_tells_the_dominant_lights_share(likely, off_share):
    """Of a lamp that was taken for a stronger one, by the shadow of a wall; of a likely one no less than that."""
    lamp, guess = 100.0, 600.0
    toward, sky = np.array([1.0, 1, 0]) / np.sqrt(2), np.ones((64, 128, 3), np.float32)
    x, z = -2 * RADIUS, np.array([-3.0, 3.0, 3.0, -3.0])
    corners = FOOT + np.stack([np.full(4, x), np.array([0.0, 0.0, 0.6, 0.6]), z], axis=-1)
    wall = Mesh(positions=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]), normals=np.zeros((2, 3, 3)))
    lights = [sky + emitter_map(toward, np.full(3, power)) for power in (lamp, guess)]
    true, guessed = (GroundShadow(unit_sphere(), FOOT, RADIUS, UP, one, 512, 64, beside=wall) for one in lights)
    found = guessed.as_seen(likely, true.reached.reshape(-1, 3))
    at = FOOT + RADIUS * np.array([[-1.0, 0, 0], [0.0, 0, 0.5], [0.5, 0, 0], [1.0, 0, 0]])
    off = [np.abs(one.at(at) - true.at(at)).max() for one in (found, guessed)]
    assert off[0] < off_share * off[1]


def test_a_softened_shadow_is_of_the_light_that_is_left():
    """Without the lamp, that of the even sky, which hides the form factor."""
    light = np.ones((64, 128, 3), np.float32) + emitter_map(np.array([1.0, 1, 0]) / np.sqrt(2), np.full(3, 100.0))
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, light, 1024, 64)
    np.testing.assert_allclose(shadow.as_seen(1.0).ratio, shadow.ratio, atol=1e-6)
    at = surroundings(shadow, RADIUS)
    assert 1 - shadow.as_seen(0.0).at(at).mean() == pytest.approx(2**-1.5, rel=0.1)


def test_directions_share_the_irradiance(rng):
    """A sum over the sky's samples is the integral: of 1, and of the direction's x."""
    light = rng.gamma(0.5, 1.0, (32, 64, 3)).astype(np.float32)
    directions, weights = sample_sky(light, UP, 4096)
    np.testing.assert_allclose(weights.sum(axis=0), 1, rtol=1e-9)
    d = pixel_directions(32)
    power = light * (np.maximum(d[..., 1], 0) * np.sqrt(1 - d[..., 1] ** 2))[..., None]
    expected = np.einsum("hwc,hwk->ck", power, d) / power.sum(axis=(0, 1))[:, None]
    np.testing.assert_allclose(weights.T @ directions, expected, atol=0.03)
    assert (directions @ UP > 0).all()


def test_black_map_throws_no_shadow():
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, np.zeros((16, 32, 3), np.float32))
    assert shadow.ratio.min() == 1


def test_even_sky_lights_the_ground_with_pi():
    np.testing.assert_allclose(sky_irradiance(np.ones((32, 64, 3), np.float32), UP), np.pi, rtol=1e-3)


def test_ground_is_lit_by_what_stands_on_it():
    """In even light, by a sphere that is as bright as it is lit: as much as the ground that it faces."""
    even = np.ones((32, 64, 3), np.float32)
    shadow = GroundShadow(unit_sphere(), FOOT, RADIUS, UP, even, count=256, grid=64)
    for distance in (0.6, 1.0, 2.0):
        at = surroundings(shadow, distance * RADIUS)
        hidden, sent = 1 - shadow.at(at).mean(), shadow.with_light(np.full(3, 0.5)).at(at).mean() - shadow.at(at).mean()
        assert sent == pytest.approx(0.5 * hidden * (1 - hidden), rel=0.15)


def test_a_sharp_shadow_of_a_sphere_is_a_cylinder_behind_it():
    """A point is dark when the ray from it to the light passes the middle by less than the radius, ahead of it."""
    directions = np.array([[0.0, 1.0, 0.0], [0.6, 0.64, 0.48]])
    points = FOOT + np.random.default_rng(3).uniform(-2, 2, (4000, 3))
    to_middle = FOOT + RADIUS * UP - points
    for direction, share in zip(directions, sharp_shares(unit_sphere(), points, directions), strict=True):
        ahead = to_middle @ direction
        apart = np.linalg.norm(to_middle - ahead[:, None] * direction, axis=1) / RADIUS
        dark, beside, before = (apart < 0.95) & (ahead > RADIUS), apart > 1.05, ahead < -RADIUS
        assert min(dark.sum(), beside.sum(), (before & (apart < 1)).sum()) > 50
        assert share[dark].max() == 0.0
        assert share[beside | before].min() == 1.0


def test_a_blurred_shadow_is_the_mean_over_where_the_mesh_may_be():
    """Far from its middle, a large sphere's edge is a straight one: a normal distribution of the distance to it."""
    up, blur = np.array([0.0, 1.0, 0.0]), 0.02
    distance = RADIUS * np.linspace(0.8, 1.2, 41)
    points = FOOT + distance[:, None] * [1.0, 0.0, 0.0] - up
    share = sharp_shares(unit_sphere(), points, up[None], blur)[0]
    sigma = blur * 2 * RADIUS
    expected = [NormalDist().cdf((one - RADIUS) / sigma) for one in distance]
    np.testing.assert_allclose(share, expected, atol=0.08)
    assert np.abs(np.diff(share)).max() < 0.3 * np.ptp(share)  # no step

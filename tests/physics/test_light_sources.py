"""Light sources of a map: how many, where, how large and how strong."""

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_of, rotation_y
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.dominant_light import find_dominant_light
from anyprobe.light.environment import rotate
from anyprobe.light.light_sources import find_light_sources, split_light_sources


def disc(direction, radius_deg, height=128):
    toward = np.float32(direction) / np.float32(np.linalg.norm(direction))
    return (pixel_directions(height) @ toward > np.cos(np.radians(radius_deg))).astype(np.float32)[..., None]


@pytest.mark.parametrize("radius", [3.0, 6.0, 11.0])
def test_disc_is_of_another_size_or_power(radius):
    """E of an even disc that faces the plane = pi L sin^2 of its radius."""
    toward = np.array([0.5, 0.6, -0.7]) / np.linalg.norm([0.5, 0.6, -0.7])
    color = np.float32([40.0, 30.0, 20.0])
    (source,) = find_light_sources(0.05 + disc(toward, radius) * color)
    assert source.direction @ toward > np.cos(np.radians(1.5))
    np.testing.assert_allclose(source.irradiance, np.pi * color * np.sin(np.radians(radius)) ** 2, rtol=0.15)
    assert abs(source.radius_deg - radius) <= 0.2
    power = 2 * np.pi * (1 - np.cos(np.radians(radius))) * luminance(color)
    assert source.share == pytest.approx(power / (power + 0.05 * 4 * np.pi), rel=0.15)


def seen(direction, radius_deg, height=64, finer=8):
    """disc as pixels average it."""
    parts = disc(direction, radius_deg, height * finer)
    weights = np.broadcast_to(pixel_solid_angles(height * finer)[..., None], parts.shape)
    blocks = (height, finer, 2 * height, finer)
    total, whole = (one.reshape(blocks).sum(axis=(1, 3)) for one in (parts * weights, weights))
    return (total / whole)[..., None] * np.ones(3, np.float32)


PLACES = ([0.5, 0.6, -0.7], [1, 0.02, 0.01], [0.06, 1, 0.02], [-0.3, -0.9, 0.2], [0.03, 0.1, -1], [-0.8, 0.35, 0.5])


@pytest.mark.parametrize("radius", [3.0, 4.0, 5.0, 7.0, 9.5, 12.0])
def test_radius_depends_on_the_place(radius):
    """Of a disc a few pixels wide, 2.8 degrees each, wherever it lies, however strong it is."""
    found = [find_light_sources(0.05 + k * seen(toward, radius))[0] for toward in PLACES for k in (20, 200)]
    np.testing.assert_allclose([one.radius_deg for one in found], radius, atol=0.5 if radius < 4 else 0.3)


@pytest.mark.parametrize("turn", [(0.3, 0.4, 0.9), (2.0, -1.1, 0.2), (-1.3, 0.8, -0.7)])
def test_radius_turns_with_the_map(turn):
    """But for what resampling blurs."""
    toward, matrix = np.array([0.8, 0.5, -0.3]), rotation_of(np.degrees(turn))
    toward /= np.linalg.norm(toward)
    for radius in (5.0, 8.0, 12.0):
        (one,) = find_light_sources(np.maximum(rotate(0.05 + 30 * seen(toward, radius), matrix), 0.0))
        assert one.direction @ matrix @ toward > np.cos(np.radians(0.5))
        assert radius - 0.2 < one.radius_deg < radius + 0.6


def test_even_sky_has_a_source():
    d = pixel_directions(64)
    assert find_light_sources(np.ones((64, 128, 3), np.float32)) == ()
    assert find_light_sources((1.2 + d[..., 1:2]) * np.ones(3, np.float32)) == ()
    assert find_light_sources(np.zeros((64, 128, 3), np.float32)) == ()


def test_second_source_is_lost_or_invented():
    one, other = [0.8, 0.5, -0.3], [-0.6, 0.7, 0.2]
    radiance = 0.05 + 30 * disc(one, 5.0) + 12 * disc(other, 5.0)
    first, second = find_light_sources(radiance * np.ones(3, np.float32))
    assert first.direction @ (np.array(one) / np.linalg.norm(one)) > 0.999
    assert second.direction @ (np.array(other) / np.linalg.norm(other)) > 0.999
    np.testing.assert_allclose(first.irradiance / second.irradiance, 2.5, rtol=0.1)


def test_sources_do_not_turn_with_the_map():
    radiance = (0.05 + 30 * disc([0.8, 0.5, -0.3], 6.0)) * np.ones(3, np.float32)
    turn = rotation_y(1.0)
    (before,), (after,) = find_light_sources(radiance), find_light_sources(np.maximum(rotate(radiance, turn), 0.0))
    np.testing.assert_allclose(after.direction, turn @ before.direction, atol=0.02)


def test_only_source_is_not_the_dominant_light():
    radiance = (0.05 + 30 * disc([0.8, 0.5, -0.3], 6.0)) * np.float32([1.0, 0.9, 0.7])
    (source,) = find_light_sources(radiance)
    light = find_dominant_light(radiance)
    np.testing.assert_allclose(source.direction, light.direction, atol=0.02)
    np.testing.assert_allclose(source.irradiance, light.irradiance, rtol=0.1)


def test_split_loses_light_or_counts_it_twice():
    """Two discs so close that their surroundings overlap: E of the map = E of the rest + each source's."""
    one, other = np.array([0.8, 0.5, -0.3]), np.array([0.5, 0.75, -0.45])
    radiance = (0.2 + 30 * disc(one, 3.0) + 12 * disc(other, 4.0)) * np.float32([1.0, 0.9, 0.7])
    sources, rest = split_light_sources(radiance)
    assert len(sources) == 2
    assert rest.min() >= 0
    assert rest.max() < 0.25
    d, angles = pixel_directions(128).astype(np.float64), pixel_solid_angles(128)[..., None]
    for n in (one / np.linalg.norm(one), np.array([0.0, 1.0, 0.0])):
        e = [(field * np.maximum(d @ n, 0)[..., None] * angles).sum(axis=(0, 1)) for field in (radiance, rest)]
        by_sources = sum(source.irradiance * (source.direction @ n) for source in sources)
        np.testing.assert_allclose(e[0], e[1] + by_sources, rtol=0.01)


def test_split_of_an_even_sky_changes_it():
    even = np.ones((32, 64, 3), np.float32)
    sources, rest = split_light_sources(even)
    assert sources == ()
    np.testing.assert_array_equal(rest, even)

"""The dominant light: a disc of known direction and power on a known background."""

import numpy as np
import pytest

from anyprobe.core.frames import normalize
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.dominant_light import ERROR, connected, dilate, find_dominant_light, split_dominant_light
from anyprobe.light.environment import shrink

FINE = pixel_directions(256)
CENTRES = {
    "ahead": (0.1, 0.2, -1.0),
    "seam": (0.01, 0.1, 1.0),
    "left": (-1.0, 0.3, 0.2),
    "near the pole": (0.05, 1.0, 0.08),
    "below": (0.6, -0.7, -0.3),
}


def disc(centre, radius_deg, color=(1.0, 1.0, 1.0)):
    """Antialiased disc on a black 64 x 128 map, and its perpendicular irradiance [3]."""
    centre = normalize(np.asarray(centre, np.float64))
    cosine = FINE @ centre.astype(np.float32)
    inside = (cosine >= np.cos(np.radians(radius_deg)))[..., None] * np.asarray(color, np.float32)
    truth = np.einsum("hwc,hw,h->c", inside, np.maximum(cosine, 0), pixel_solid_angles(256)[:, 0])
    return shrink(inside, 64), truth


@pytest.mark.parametrize("radius_deg", [1.5, 5.0, 7.0, 15.0, 30.0])
@pytest.mark.parametrize("place", CENTRES)
def test_emitter_has_another_direction_or_power(place, radius_deg):
    """Any size, anywhere: within 0.6 degrees and 6 % of the power, whatever the background."""
    emitter, truth = disc(CENTRES[place], radius_deg)
    found = find_dominant_light(10 * emitter + 0.3)
    angle = np.degrees(np.arccos(min(1.0, float(found.direction @ normalize(np.asarray(CENTRES[place]))))))
    assert angle < 0.6
    np.testing.assert_allclose(np.linalg.norm(found.direction), 1, atol=1e-6)
    np.testing.assert_allclose(found.irradiance, 10 * truth, rtol=0.06)


def test_background_counts_as_emitter():
    """E is of the excess over the surroundings: a brighter room changes nothing."""
    emitter, _ = disc(CENTRES["ahead"], 6.0)
    dark, bright = find_dominant_light(50 * emitter), find_dominant_light(50 * emitter + 4)
    np.testing.assert_allclose(bright.irradiance, dark.irradiance, rtol=0.03)
    assert bright.directionality < dark.directionality


def test_color_is_of_the_room():
    emitter, truth = disc(CENTRES["left"], 6.0, color=(8.0, 4.0, 2.0))
    found = find_dominant_light(emitter + np.array([0.1, 0.2, 0.6], np.float32))
    np.testing.assert_allclose(found.color, [1.0, 0.5, 0.25], atol=0.02)
    np.testing.assert_allclose(found.irradiance, truth, rtol=0.03)


def test_second_emitter_is_added():
    """Two emitters apart: the stronger one alone, in place and power."""
    key, truth = disc(CENTRES["left"], 6.0)
    fill, _ = disc(CENTRES["ahead"], 6.0)
    found = find_dominant_light(10 * key + 9 * fill)
    assert found.direction @ normalize(np.asarray(CENTRES["left"])) > np.cos(np.radians(0.6))
    np.testing.assert_allclose(found.irradiance, 10 * truth, rtol=0.03)


def test_single_hot_pixel_beats_a_window():
    """The peak is of the blurred map: a pixel three times brighter, far smaller, does not win."""
    window, _ = disc(CENTRES["left"], 12.0)
    radiance = 5 * window
    radiance[40, 64] = 15.0
    found = find_dominant_light(radiance)
    assert found.direction @ normalize(np.asarray(CENTRES["left"])) > 0.999


def test_seam_cuts_the_lobe():
    """The same map rolled by any number of columns gives the same light, turned."""
    emitter, _ = disc(CENTRES["ahead"], 10.0)
    here = find_dominant_light(emitter + 0.1)
    there = find_dominant_light(np.roll(emitter, 64, axis=1) + np.float32(0.1))
    np.testing.assert_allclose(there.irradiance, here.irradiance, rtol=1e-4)
    np.testing.assert_allclose(there.solid_angle, here.solid_angle, rtol=1e-4)
    np.testing.assert_allclose(there.direction, here.direction * [-1, 1, -1], atol=1e-4)


def test_solid_angle_counts_pixels():
    emitter, _ = disc(CENTRES["below"], 20.0)
    np.testing.assert_allclose(
        find_dominant_light(emitter).solid_angle, 2 * np.pi * (1 - np.cos(np.radians(20))), rtol=0.05
    )


def test_confidence_leaves_its_range():
    """A point is certain, even light is not, half a sphere of light is 1 / 2."""
    sun, _ = disc(CENTRES["ahead"], 1.5)
    assert find_dominant_light(sun).directionality > 0.995
    upper = np.zeros((64, 128, 3), np.float32)
    upper[:32] = 1
    np.testing.assert_allclose(find_dominant_light(upper).directionality, 0.5, atol=0.01)


@pytest.mark.parametrize("level", [0.0, 0.7])
def test_no_light_gives_nan(level):
    """Black, or the same everywhere: WebXR's fallback, straight up and dark."""
    found = find_dominant_light(np.full((64, 128, 3), level, np.float32))
    np.testing.assert_array_equal(found.direction, [0, 1, 0])
    np.testing.assert_array_equal(found.irradiance, 0)
    np.testing.assert_array_equal(found.color, 1)
    assert found.directionality < 1e-6


def test_flood_leaks_or_stops_at_the_seam():
    """Only what touches, around the seam and over the pole, not across a gap."""
    mask = np.zeros((8, 16), bool)
    mask[4, 14:] = mask[4, :3] = True
    mask[6, 14:] = True
    region = connected(mask, 4, 0)
    assert region.sum() == 5
    assert not region[6].any()
    mask[:] = False
    mask[0, 3] = mask[0, 11] = mask[1, 11] = True
    assert connected(mask, 0, 3).sum() == 3


def test_dilation_stops_at_the_seam_or_pole():
    mask = np.zeros((8, 16), bool)
    mask[4, 0] = True
    assert sorted(map(tuple, np.argwhere(dilate(mask)))) == [(3, 0), (4, 0), (4, 1), (4, 15), (5, 0)]
    mask[:] = False
    mask[7, 5] = True
    grown = dilate(mask)
    assert grown[7].all()
    assert grown.sum() == 17


@pytest.mark.parametrize("height", [200, 512])
def test_a_large_map_has_another_dominant_light(height):
    """Maps of thousands of rows are searched at a hundred, and summed as they are."""
    radiance = np.full((height, 2 * height, 3), 0.3, np.float32)
    cosine = pixel_directions(height) @ normalize(np.asarray(CENTRES["left"], np.float64)).astype(np.float32)
    radiance[cosine >= np.cos(np.radians(6.0))] += (80.0, 40.0, 20.0)
    _, truth = disc(CENTRES["left"], 6.0, (8.0, 4.0, 2.0))
    found, rest = split_dominant_light(radiance)
    np.testing.assert_allclose(found.irradiance, 10 * truth, rtol=0.06)
    np.testing.assert_allclose(found.direction, normalize(np.asarray(CENTRES["left"])), atol=0.01)
    assert np.abs(rest - 0.3).mean() < 0.01


def test_a_light_that_the_rest_of_the_map_contradicts_is_less_sure():
    """The error grows with the spread of the map's light about the direction, and has a limit."""
    key, _ = disc(CENTRES["left"], 6.0)
    fill, _ = disc(CENTRES["ahead"], 40.0)
    alone, with_fill = (find_dominant_light(20 * key + level * fill).error_deg for level in (0.0, 0.2))
    even = 4.0  # degrees: the mean distance from the middle of a disc of 6
    expected = ERROR["factor"] * (even + ERROR["offset_deg"]) ** ERROR["exponent"]
    np.testing.assert_allclose(alone, expected, rtol=0.05)
    assert alone + 3 < with_fill < ERROR["most_deg"]
    assert find_dominant_light(np.ones((64, 128, 3), np.float32)).error_deg == ERROR["most_deg"]

"""Light sources of a map: discs of known direction, size and power on a known background."""

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import normalize, rotation_of
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import integral, reduced, rotate
from anyprobe.light.harmonics import directionality, project
from anyprobe.light.light_sources import (
    ERROR,
    LIKELY,
    LightSource,
    connected,
    dilate,
    draw_sources,
    find_dominant_light,
    find_sources,
    softened_light,
    split_dominant_light,
    split_sources,
)

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
    return reduced(inside, 64), truth


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
    np.testing.assert_allclose(there.radius_deg, here.radius_deg, rtol=1e-4)
    np.testing.assert_allclose(there.direction, here.direction * [-1, 1, -1], atol=1e-4)


def test_directionality_leaves_its_range():
    """A point is certain, even light is not, half a sphere of light is 1 / 2."""
    sun, _ = disc(CENTRES["ahead"], 1.5)
    assert 1 >= directionality(project(sun)) > 0.995
    upper = np.zeros((64, 128, 3), np.float32)
    upper[:32] = 1
    np.testing.assert_allclose(directionality(project(upper)), 0.5, atol=0.01)
    assert directionality(project(np.zeros_like(upper))) == 0
    assert directionality(project(np.ones_like(upper))) < 1e-6


@pytest.mark.parametrize("level", [0.0, 0.7])
def test_no_light_gives_nan(level):
    """Black, or the same everywhere: WebXR's fallback, straight up and dark."""
    found = find_dominant_light(np.full((64, 128, 3), level, np.float32))
    np.testing.assert_array_equal(found.direction, [0, 1, 0])
    np.testing.assert_array_equal(found.irradiance, 0)
    np.testing.assert_array_equal(found.color, 1)
    assert find_sources(np.full((64, 128, 3), level, np.float32)) == ()


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


@pytest.mark.parametrize("radius_deg", [2.0, 4.0, 5.0, 7.0, 12.0, 25.0])
@pytest.mark.parametrize("place", CENTRES)
def test_radius_depends_on_the_place(place, radius_deg):
    """Of a disc that pixels of 2.8 degrees average, however strong it is."""
    emitter, _ = disc(CENTRES[place], radius_deg)
    found = [find_dominant_light(0.05 + k * emitter).radius_deg for k in (20, 200)]
    np.testing.assert_allclose(found, radius_deg, atol=0.6 if radius_deg < 5 else 0.3)


def test_second_source_is_lost_or_invented():
    """Powers, and how likely each is there: all of two discs, and of a third that is too weak to be listed."""
    powers = np.array([30.0, 12.0, 0.2])
    discs = [disc(CENTRES[place], 5.0)[0] for place in ("left", "ahead", "below")]
    first, second = find_sources(0.05 + np.einsum("k,khwc->hwc", powers, discs).astype(np.float32))
    assert first.direction @ normalize(np.asarray(CENTRES["left"])) > 0.999
    assert second.direction @ normalize(np.asarray(CENTRES["ahead"])) > 0.999
    np.testing.assert_allclose(first.irradiance / second.irradiance, 2.5, rtol=0.1)
    assert min(first.exists, second.exists) > 0.9


def test_bright_half_of_a_sky_is_likely_a_source():
    """There is a dominant light, which may well be none: wide, and hardly brighter than what is beside it."""
    d = pixel_directions(64)
    (sky,) = find_sources((1.2 + d[..., 1:2]) * np.ones(3, np.float32))
    assert sky.direction[1] > 0.99
    assert sky.exists < 0.1
    sources, rest = split_sources((1.2 + d[..., 1:2]) * np.ones(3, np.float32))
    assert sources == ()
    np.testing.assert_array_equal(rest, (1.2 + d[..., 1:2]) * np.ones(3, np.float32))


def test_word_of_a_network_is_lost():
    """On whether a source exists, where it means the same one."""
    emitter, _ = disc(CENTRES["left"], 5.0)
    toward, elsewhere = (normalize(np.asarray(CENTRES[name])) for name in ("left", "ahead"))
    said = np.array([[0.2, *toward], [0.9, *elsewhere]])
    (source,) = find_sources(0.05 + 30 * emitter, said)
    assert source.exists == 0.2 < LIKELY
    assert split_sources(0.05 + 30 * emitter, said)[0] == ()
    (source,) = find_sources(0.05 + 30 * emitter, said[1:])
    assert source.exists > 0.9


def test_what_a_network_said_of_a_source_holds_for_nothing_beside_it():
    up = np.radians(65.0)  # where columns are narrow, so that a lobe's ring ends early
    turns = np.radians([0.0, 30.0])
    toward, beside = (np.array([np.cos(up) * np.sin(one), np.sin(up), -np.cos(up) * np.cos(one)]) for one in turns)
    power = np.ones(3, np.float32)
    bright, faint = (
        LightSource(direction=d, radius_deg=3.0, power=p) for d, p in ((toward, power), (beside, 0.02 * power))
    )
    radiance = 0.05 + draw_sources(64, (bright, faint))
    (found,) = find_sources(radiance, np.array([[0.9, *toward]]))
    assert found.direction @ toward > 0.999
    assert found.exists == 0.9


@pytest.mark.parametrize("turn_deg", [(20, 20, 50), (115, -60, 10)])
def test_sources_do_not_turn_with_the_map(turn_deg):
    """But for what resampling blurs."""
    emitter, _ = disc(CENTRES["left"], 6.0)
    matrix = rotation_of(turn_deg)
    before, after = (find_dominant_light(one) for one in (0.05 + 30 * emitter, rotate(0.05 + 30 * emitter, matrix)))
    assert after.direction @ matrix @ before.direction > np.cos(np.radians(0.5))
    assert before.radius_deg - 0.2 < after.radius_deg < before.radius_deg + 0.6


@pytest.mark.parametrize("rows", [64, 160])
def test_split_loses_light_or_counts_it_twice(rows):
    """On planes that face or graze, E of the map = E of the rest + each source's; all of its power is taken."""
    d, angles = pixel_directions(rows), pixel_solid_angles(rows)[..., None]
    one, other = (normalize(np.array(at)) for at in ((0.8, 0.5, -0.3), (0.2, 0.9, -0.4)))
    parts = 30 * (d @ one > np.cos(0.06))[..., None] + 12 * (d @ other > np.cos(0.08))[..., None]
    radiance = (0.2 + parts * np.array([1.0, 0.9, 0.7])).astype(np.float32)
    sources, rest = split_sources(radiance)
    assert len(sources) == 2
    assert rest.min() >= 0
    assert rest.max() < 0.25
    np.testing.assert_allclose(integral(radiance), integral(rest) + sum(s.power for s in sources), rtol=1e-5)
    for n in (one, other, np.array([0.0, 1.0, 0.0])):
        e = [(field * np.maximum(d @ n, 0)[..., None] * angles).sum(axis=(0, 1)) for field in (radiance, rest)]
        by_sources = sum(source.irradiance * max(source.direction @ n, 0) for source in sources)
        np.testing.assert_allclose(e[0], e[1] + by_sources, rtol=0.01)


def lamp(direction, power, radius_deg=4.0) -> LightSource:
    return LightSource(direction=normalize(np.asarray(direction, float)), power=np.array(power), radius_deg=radius_deg)


@pytest.mark.parametrize(("radius_deg", "lost"), [(4.0, 0.01), (12.0, 0.15)])
def test_sources_drawn_are_not_the_sources_found(radius_deg, lost):
    """But for the dim rim of a wide one, which stays in the rest."""
    room = np.float32([0.2, 0.3, 0.4])
    lamps = [lamp([0.3, 0.6, 0.7], [3.0, 2.5, 2.0]), lamp([-0.9, 0.2, -0.3], [1.0, 1.2, 1.5], radius_deg)]
    found, soft = split_sources(room + draw_sources(64, lamps))
    assert (np.abs(soft - room).max(axis=-1) > 0.05).mean() < lost
    assert len(found) == len(lamps)
    for one, drawn in zip(found, lamps, strict=True):
        assert one.direction @ drawn.direction > np.cos(np.radians(0.2))
        np.testing.assert_allclose(one.power, drawn.power, rtol=lost)
        assert one.radius_deg == pytest.approx(drawn.radius_deg, rel=0.1)


def test_a_source_smaller_than_a_pixel_is_drawn_without_its_power():
    for at in CENTRES.values():
        drawn = integral(draw_sources(64, [lamp(at, [3.0, 2.0, 1.0], 0.3)]))
        np.testing.assert_allclose(drawn, [3.0, 2.0, 1.0], rtol=1e-5)


def test_a_lamp_in_its_halo_does_not_stay_as_bright():
    toward = [0.3, 0.6, 0.7]
    halo = draw_sources(64, [lamp(toward, [2.0, 2.0, 2.0], 10.0)])
    radiance = 0.3 + draw_sources(64, [lamp(toward, [3.0, 3.0, 3.0], 4.0)]) + halo
    found, soft = split_sources(radiance)
    shown = soft + draw_sources(64, found)
    assert luminance(integral(shown)) == pytest.approx(luminance(integral(radiance)), rel=1e-4)
    assert shown.max() == pytest.approx(radiance.max(), rel=0.3)


@pytest.mark.parametrize("likely", [0.25, 0.6, 0.95])
def test_a_softened_light_keeps_all_power_and_lies_where_it_may_be(likely):
    direction = np.array([0.6, 0.64, 0.48])
    source = LightSource(direction=direction, radius_deg=4.0, power=np.array([3.0, 2.0, 1.0]))
    radiance = 0.1 + draw_sources(64, [source])
    soft = softened_light(radiance, likely)
    np.testing.assert_allclose(integral(soft), integral(radiance), rtol=1e-3)
    near = pixel_directions(64) @ direction > np.cos(np.radians(30.0))
    np.testing.assert_allclose(integral((soft - 0.1) * near[..., None]) / source.power, likely, atol=0.03)
    brightest = pixel_directions(64).reshape(-1, 3)[luminance(soft).argmax()]
    assert brightest @ direction > np.cos(np.radians(3.0))

"""A map's compact sources are found with their power and place; what is wide stays in the soft part."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import integral, rotate
from anyprobe.light.source_split import Source, draw_sources, split_sources

HEIGHT = 64


def source(direction, power, radius_deg=4.0) -> Source:
    d = np.asarray(direction, float)
    return Source(direction=d / np.linalg.norm(d), power=np.array(power, float), radius=np.radians(radius_deg))


LAMPS = [source([0.3, 0.6, 0.7], [3.0, 2.5, 2.0]), source([-0.9, 0.2, -0.3], [1.0, 1.2, 1.5], 6.0)]
WIDE_LAMPS = [LAMPS[0], source([-0.9, 0.2, -0.3], [4.0, 4.2, 4.5], 14.0)]
ROOM = np.float32([0.2, 0.3, 0.4])


@pytest.mark.parametrize("lamps", [LAMPS, WIDE_LAMPS], ids=["compact", "wide"])
def test_sources_drawn_are_the_sources_found(lamps):
    soft, found = split_sources(ROOM + draw_sources(HEIGHT, lamps))
    np.testing.assert_allclose(soft, np.broadcast_to(ROOM, soft.shape), atol=1e-4)
    assert len(found) == len(lamps)
    for one, lamp in zip(found, lamps, strict=True):
        assert one.direction @ lamp.direction > np.cos(np.radians(0.2))
        np.testing.assert_allclose(one.power, lamp.power, rtol=1e-3)
        assert np.degrees(one.radius) == pytest.approx(np.degrees(lamp.radius), abs=0.5)


def test_parts_hold_the_power_of_the_whole(rng):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    noisy = (ROOM + draw_sources(HEIGHT, LAMPS)) * np.exp(rng.normal(0, 0.1, (HEIGHT, 2 * HEIGHT, 3)))
    radiance = np.maximum(rotate(noisy.astype(np.float32), turn), 0.0)
    soft, found = split_sources(radiance)
    assert len(found) == 2
    np.testing.assert_allclose(integral(soft) + sum(one.power for one in found), integral(radiance), rtol=1e-4)


@pytest.mark.parametrize("radius_deg", [16, 25, 40])
def test_what_is_wider_is_left_in_the_soft_part(radius_deg):
    d = pixel_directions(HEIGHT)
    wide = (ROOM + 20.0 * (d[..., 1:2] > np.cos(np.radians(radius_deg)))).astype(np.float32)
    soft, found = split_sources(wide)
    assert found == ()
    np.testing.assert_array_equal(soft, wide)


def test_an_even_or_black_map_has_no_source():
    for level in (0.0, 1.0):
        assert split_sources(np.full((HEIGHT, 2 * HEIGHT, 3), level, np.float32))[1] == ()


def test_a_lamp_in_its_halo_stays_as_bright():
    toward = [0.3, 0.6, 0.7]
    halo = draw_sources(HEIGHT, [source(toward, [2.0, 2.0, 2.0], 12.0)])
    radiance = ROOM + draw_sources(HEIGHT, [source(toward, [3.0, 3.0, 3.0], 5.0)]) + halo
    soft, found = split_sources(radiance)
    shown = soft + draw_sources(HEIGHT, found)
    level = 0.5 * radiance.max()
    assert 0.7 < (shown > level).sum() / (radiance > level).sum() < 1.4
    assert shown.max() == pytest.approx(radiance.max(), rel=0.3)

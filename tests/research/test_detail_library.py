"""Rooms, places outdoors and studios drawn for the library of detail."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from anyprobe.core.latlong import pixel_directions
from anyprobe.match.library import codes_of, encode, richness_of
from research.detail_library.boxes import Builder, cast, lines, turbulence, visible
from research.detail_library.outdoors import KINDS, detailed_outdoor
from research.detail_library.rooms import detailed_room, detailed_studio


@pytest.mark.ci
@pytest.mark.parametrize(
    "draw", [detailed_room, *(partial(detailed_outdoor, kind=kind) for kind in KINDS), detailed_studio]
)
def test_a_scene_is_finite_detailed_and_the_same_again(draw):
    radiance = draw(np.random.default_rng((1, 2)), 64)
    assert radiance.shape == (64, 128, 3)
    assert np.isfinite(radiance).all()
    assert radiance.min() >= 0
    assert richness_of(codes_of(encode(radiance)) / np.float32(255)) > 0.02
    np.testing.assert_array_equal(radiance, draw(np.random.default_rng((1, 2)), 64))


def test_what_fades_draws_as_much_so_that_bands_fit():
    x = pixel_directions(8).reshape(-1, 3)
    rngs = [np.random.default_rng(0) for _ in range(2)]
    for rng, footprint in zip(rngs, (0.0, 10.0), strict=True):
        turbulence(rng, x, 4, footprint)
    assert rngs[0].random() == rngs[1].random()


def test_rays_hit_the_nearest_box_and_shadows_fall_behind_it():
    scene = Builder()
    scene.add([0, 0, -3], [1, 1, 1], 0.5)
    scene.add([0, 0, -6], [4, 4, 1], 0.2)
    boxes = scene.boxes()
    d = np.array([[0, 0, -1], [0.28, 0, -0.96], [0, 1, 0]], float)
    hits = cast(boxes, np.zeros(3), d)
    assert hits.index.tolist() == [0, 1, -1]
    np.testing.assert_allclose(hits.distance[0], 2.5)
    np.testing.assert_allclose(hits.normal[0], [0, 0, 1])
    lit = visible(boxes, np.array([[0, 0, -5.4], [1.9, 0, -5.4]]), np.zeros(3))
    assert lit.tolist() == [False, True]


def test_lines_cover_their_share_of_a_wide_pixel():
    x = np.linspace(0, 7, 50)
    np.testing.assert_allclose(lines(x, 0.1, 0.02, 1.0), 0.2, atol=0.02)
    assert set(np.round(lines(np.array([0.01, 0.05]), 0.1, 0.02, 1e-4), 3)) == {0.0, 1.0}


def test_noise_finer_than_a_pixel_fades():
    x = pixel_directions(32).reshape(-1, 3) * 50.0
    whole, faded = (turbulence(np.random.default_rng(0), x, 4, footprint) for footprint in (0.0, 10.0))
    assert whole.std() > 0.2
    assert not faded.any()

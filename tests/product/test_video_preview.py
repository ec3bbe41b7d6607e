"""A light as a frame of light.mp4: the same spheres as render.spheres draws, in a tenth of the time."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.light.source_split import Source, draw_sources
from anyprobe.render.spheres import diffuse, mirror, silver
from anyprobe.video.preview import light_picture, preview_ev


def test_its_spheres_are_those_that_are_sampled():
    lamp = Source(direction=np.array([0.6, 0.64, 0.48]), power=np.array([2.0, 1.6, 1.2]), radius=0.15)
    radiance = draw_sources(64, [lamp]) + np.linspace(0.6, 0.1, 64, dtype=np.float32)[:, None, None]
    drawn = light_picture(radiance).astype(np.float32) / 255
    for at, sphere in enumerate((diffuse, silver, mirror), start=2):
        expected = response(sphere(radiance, 128))
        assert np.abs(drawn[:, 128 * at : 128 * (at + 1)] - expected).mean() < 0.01


def test_spheres_are_darkened_until_the_matte_one_does_not_clip_and_the_map_is_not():
    lamp = Source(direction=np.array([0.6, 0.64, 0.48]), power=np.array([9.0, 8.0, 7.0]), radius=0.3)
    bright = draw_sources(64, [lamp]) + np.float32(0.2)
    ev = preview_ev(bright)
    assert ev <= -1
    assert (2 * ev).is_integer()
    matte = diffuse(bright, 128).max()
    assert 0.7 < matte * 2**ev <= 1.01
    assert preview_ev(bright / 100) == 0
    plain, darker = light_picture(bright), light_picture(bright, ev)
    np.testing.assert_array_equal(darker[:, :256], plain[:, :256])
    assert (plain[:, 256:384] == 255).mean() > 0.1
    np.testing.assert_allclose(darker[:, 256:384] / 255, response(diffuse(bright, 128) * 2**ev), atol=0.02)

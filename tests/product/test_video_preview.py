"""A light as a frame of light.mp4: the same spheres as render.spheres draws, in a tenth of the time."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.light.source_split import Source, draw_sources
from anyprobe.render.spheres import diffuse, mirror, silver
from anyprobe.video.preview import light_picture


def test_its_spheres_are_those_that_are_sampled():
    lamp = Source(direction=np.array([0.6, 0.64, 0.48]), power=np.array([2.0, 1.6, 1.2]), radius=0.15)
    radiance = draw_sources(64, [lamp]) + np.linspace(0.6, 0.1, 64, dtype=np.float32)[:, None, None]
    drawn = light_picture(radiance).astype(np.float32) / 255
    for at, sphere in enumerate((diffuse, silver, mirror), start=2):
        expected = response(sphere(radiance, 128))
        assert np.abs(drawn[:, 128 * at : 128 * (at + 1)] - expected).mean() < 0.01

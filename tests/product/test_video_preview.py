"""A frame of light.mp4: the clip's, and beside it spheres as render.spheres draws them."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.light.light_sources import LightSource, draw_sources
from anyprobe.render.spheres import diffuse, mirror
from anyprobe.video.preview import HEIGHT, MAP_ROWS, SIDE, WIDTH, beside_frame, light_picture, preview_ev


def spheres_of(picture: np.ndarray) -> list[np.ndarray]:
    """Pictures of the spheres, [SIDE, SIDE, 3] display."""
    return [picture[MAP_ROWS:, SIDE * k : SIDE * (k + 1)].astype(np.float32) / 255 for k in range(2)]


def test_its_spheres_are_those_that_are_sampled():
    lamp = LightSource(direction=np.array([0.6, 0.64, 0.48]), power=np.array([2.0, 1.6, 1.2]), radius_deg=7.0)
    radiance = draw_sources(64, [lamp]) + np.linspace(0.6, 0.1, 64, dtype=np.float32)[:, None, None]
    for drawn, sphere in zip(spheres_of(light_picture(radiance)), (diffuse, mirror), strict=True):
        assert np.abs(drawn - response(sphere(radiance, SIDE))).mean() < 0.01


def test_spheres_are_darkened_until_the_matte_one_does_not_clip_and_the_map_is_not():
    lamp = LightSource(direction=np.array([0.6, 0.64, 0.48]), power=np.array([9.0, 8.0, 7.0]), radius_deg=14.0)
    bright = draw_sources(64, [lamp]) + np.float32(0.2)
    ev = preview_ev(bright)
    assert ev <= -1
    assert (2 * ev).is_integer()
    matte = diffuse(bright, SIDE).max()
    assert 0.7 < matte * 2**ev <= 1.01
    assert preview_ev(bright / 100) == 0
    plain, darker = light_picture(bright), light_picture(bright, ev)
    np.testing.assert_array_equal(darker[:MAP_ROWS], plain[:MAP_ROWS])
    assert (spheres_of(plain)[0] == 1).mean() > 0.1
    np.testing.assert_allclose(spheres_of(darker)[0], response(diffuse(bright, SIDE) * 2**ev), atol=0.02)


def test_a_frame_of_any_shape_stands_whole_beside_its_light():
    light = np.full((HEIGHT, WIDTH, 3), 9, np.uint8)
    for height, width in ((1080, 1920), (640, 360), (96, 128)):
        shown = beside_frame(np.full((height, width, 3), 200, np.uint8), light)
        assert shown.shape == (HEIGHT, 2 * WIDTH, 3)
        own = (shown[:, :WIDTH] == 200).all(axis=-1)
        rows, columns = own.any(axis=1).sum(), own.any(axis=0).sum()
        assert rows == HEIGHT or columns == WIDTH
        assert abs(rows / columns - height / width) < 0.01
        assert (shown[:, WIDTH:] == 9).all()

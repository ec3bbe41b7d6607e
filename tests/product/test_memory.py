"""Large maps and photos go by strips: what that takes, and that it changes no bit."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest

from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.photo import Photo
from anyprobe.export.cube_textures import cube_faces
from anyprobe.relight.ground_view import View
from anyprobe.relight.insert import cast_shadow
from anyprobe.relight.shadow import GroundShadow
from anyprobe.render.shapes import sphere


@pytest.fixture
def noise(rng) -> Callable[..., np.ndarray]:
    """Values over six decades, of a shape."""
    return lambda *shape: (10 ** rng.uniform(-3, 3, shape)).astype(np.float32)


def most_bytes(work: Callable[[], object]) -> int:
    """What a call has at once beyond what was there."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("size", [1, 2, 48])
def test_faces_by_strips_are_the_faces(noise, monkeypatch, size):
    radiance = noise(33, 66, 3)
    found = []
    for reads in (1, 16 * size * 7, 1 << 30):  # a row of texels at once, seven, a whole face
        monkeypatch.setattr("anyprobe.export.cube_textures.SAMPLES_AT_ONCE", reads)
        found.append(cube_faces(radiance, size))
    np.testing.assert_array_equal(found[0], found[2])
    np.testing.assert_array_equal(found[1], found[2])


@pytest.fixture
def scene(rng):
    """A photo [500, 700] without an object, its camera, and a shadow that is a stripe of the ground."""
    height, width = 500, 700
    rgb, mask = rng.random((height, width, 3), dtype=np.float32), np.zeros((height, width), np.float32)
    photo = Photo(rgb=rgb, mask=mask, long_fov_deg=60.0, fov_source="given", name="noise", warnings=())
    photo.mask[400:450, 100:200] = 0.7
    view = View(width=width, height=height, focal=600.0, up=np.array([0.0, np.cos(0.3), np.sin(0.3)]))
    shadow = GroundShadow(sphere(8), view.on_ground(350.0, 400.0), 1.8, view.up, np.ones((16, 32, 3), np.float32))
    stripe = np.minimum(np.abs(np.arange(shadow.grid) + 0.5 - shadow.grid / 2) / 30, 1.0)
    shadow.ratio = 1.0 - (1.0 - stripe[None, :, None] ** [1, 2, 3]) * shadow._inward()
    return photo, view, shadow


def test_shadow_by_strips_is_the_shadow(scene, monkeypatch):
    photo, view, shadow = scene
    monkeypatch.setattr("anyprobe.relight.ground_view.VIEW_STRIP_PIXELS", 9_000)
    found = cast_shadow(photo, view, shadow)
    rows, columns = np.mgrid[0 : view.height, 0 : view.width] + 0.5
    ratio = shadow.at(view.on_ground(columns.ravel(), rows.ravel())).reshape(photo.rgb.shape)
    ratio = 1 - (1 - ratio) * (1 - photo.mask[..., None])
    dark = (ratio < 1 - 1 / 1024).any(axis=-1)
    expected = photo.rgb.copy()
    expected[dark] = response(inverse_response(photo.rgb[dark]) * ratio[dark])
    assert np.abs(found - expected).mean() < 1e-4
    assert np.abs(found - expected)[5:-5, 5:-5].max() < 0.02
    assert 0.1 < dark.mean() < 0.9


def test_shadow_takes_little_more_than_the_photo(scene, monkeypatch):
    photo, view, shadow = scene
    monkeypatch.setattr("anyprobe.relight.ground_view.VIEW_STRIP_PIXELS", 9_000)
    assert most_bytes(lambda: cast_shadow(photo, view, shadow)) < photo.rgb.nbytes + 400 * 9_000

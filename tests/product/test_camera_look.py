"""Blur and grain of a photo, which an inserted object gets; and the ground on which its shadow cannot be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from anyprobe.estimate.photo import Photo, load_photo
from anyprobe.relight.camera_look import DRAWN_BLUR, CameraLook, blurred, look_of
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.render.shapes import sphere


def photo_of(level: float, blur: float = 0.0, grain: float = 0.0) -> Photo:
    """A box in the middle of grey tiles: pixels are means of 8 x 8 points of a blurred picture."""
    y, x = np.mgrid[:1600, :1600] / 8.0
    tiles = np.where(((x // 25 + y // 25) % 2) > 0, level, 0.6 * level)
    tiles[(np.abs(x - 100) < 30) & (np.abs(y - 90) < 40)] = 0.9
    if blur:
        waves = np.exp(-2 * (np.pi * blur * 8) ** 2 * (np.fft.fftfreq(1600)[:, None] ** 2 + np.fft.rfftfreq(1600) ** 2))
        tiles = np.fft.irfft2(np.fft.rfft2(tiles) * waves, s=tiles.shape)
    tiles = tiles.reshape(200, 8, 200, 8).mean(axis=(1, 3))
    tiles = tiles + np.random.default_rng(0).normal(0, 1, tiles.shape) * grain
    mask = np.zeros((200, 200), np.float32)
    mask[50:130, 70:130] = 1.0
    rgb = np.repeat(tiles[..., None], 3, axis=-1).clip(0, 1).astype(np.float32)
    return load_photo(rgb, mask=mask)


@pytest.mark.parametrize("blur", [1.0, 2.0])
def test_blur_is_measured_at_edges(blur):
    assert look_of(photo_of(0.6, blur)).blur == pytest.approx(np.hypot(blur, 0.29), rel=0.15)


def test_a_sharp_photo_without_grain_leaves_the_object_as_it_is():
    look = look_of(photo_of(0.6))
    assert look.blur == pytest.approx(DRAWN_BLUR, abs=0.05)
    assert look.grain < 1e-4
    drawn = np.random.default_rng(1).uniform(0, 1, (20, 20, 4)).astype(np.float32)
    assert blurred(drawn, look) is drawn


@pytest.mark.ci
@pytest.mark.parametrize("grain", [0.005, 0.03])
def test_grain_is_measured_where_nothing_else_is(grain):
    assert look_of(photo_of(0.6, 1.0, grain)).grain == pytest.approx(grain, rel=0.3)


def test_a_texture_of_a_cut_out_is_no_grain():
    photo = photo_of(0.6, 1.0, 0.02)
    cut_out = load_photo(np.dstack([photo.rgb, photo.mask]))
    assert look_of(cut_out).grain == 0.0


def test_a_blurred_object_keeps_its_light_and_coverage():
    drawn = np.zeros((40, 40, 4), np.float32)
    drawn[10:30, 10:30] = [2.0, 1.0, 0.5, 1.0]
    soft = blurred(drawn, CameraLook(blur=1.5, grain=0.0))
    assert soft[..., 3].sum() == pytest.approx(400, rel=1e-3)
    np.testing.assert_allclose(
        soft[soft[..., 3] > 0.01][:, :3], [[2.0, 1.0, 0.5]] * int((soft[..., 3] > 0.01).sum()), rtol=1e-3
    )
    assert 0.3 < soft[20, 10, 3] < 0.7


@pytest.mark.ci
def test_an_inserted_object_has_the_grain_of_its_photo():
    photo = photo_of(0.6, 1.0, 0.02)
    light = np.full((32, 64, 3), 0.4, np.float32)
    stage = Stage(photo, sphere(24), Arrangement(at=(40.0, 150.0)))
    pictures = []
    for grain in (stage.look.grain, 0.0):
        stage.look = replace(stage.look, grain=grain)
        pictures.append(stage.relit(light, "matte"))
    added = (pictures[0] - pictures[1])[..., 0]
    on = added != 0
    assert on.sum() > 200
    assert added[on].std() == pytest.approx(0.02, rel=0.4)
    np.testing.assert_array_equal(np.ptp(pictures[0] - pictures[1], axis=-1).round(5), 0)  # grey grain


@pytest.mark.ci
@pytest.mark.parametrize(("level", "hidden"), [(0.15, True), (0.6, False)])
def test_a_dark_ground_is_said_as_shadows_do_not_show_there(level, hidden):
    stage = Stage(photo_of(level, 1.0, 0.005), sphere(24), Arrangement(at=(40.0, 150.0)))
    assert any("so dark" in line for line in stage.warnings) == hidden

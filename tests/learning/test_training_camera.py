"""The camera: exposure, lens, curve, noise and JPEG, each held against what it claims to do."""

from dataclasses import replace

import numpy as np
import pytest

from anyprobe.core.color import to_bytes
from anyprobe.core.response import CameraCurve, inverse_response, response
from anyprobe_train.dataset.camera import OBJECT_RANGE, SUBSAMPLINGS, Shot, blur, draw_shot, meter, one_photo

SIZE = 64
CLEAN = Shot(metering=0.5, object_key=0.3, scene_key=0.25, white_balance=np.ones(3, np.float32), curve=CameraCurve())


def disc() -> np.ndarray:
    row, column = np.mgrid[:SIZE, :SIZE]
    return np.hypot(row - 31.5, column - 31.5) < 22


def texture(rng, contrast: float = 0.5) -> np.ndarray:
    """Radiance [S, S, 3], smooth at a few pixels, mean 0.3."""
    noise = blur(rng.standard_normal((3, SIZE, SIZE), np.float32), 2.0)
    return np.moveaxis(0.3 * np.exp(contrast * noise / noise.std()), 0, -1).astype(np.float32)


def test_metering_sets_the_object_or_the_scene_to_its_key():
    by_object = replace(CLEAN, metering=1.0, object_key=0.4)
    by_scene = replace(CLEAN, metering=0.0, scene_key=0.2)

    def gain(shot: Shot, mean: float, scene: float) -> float:
        return meter(shot, np.full((8, 16, 3), scene), mean, False, np.random.default_rng(0))[1]

    assert gain(by_object, 5.0, 80.0) * 5.0 == pytest.approx(0.4)
    assert gain(by_scene, 5.0, 8.0) * 8.0 == pytest.approx(0.2)
    assert gain(by_scene, 100.0, 1.0) * 100.0 == pytest.approx(OBJECT_RANGE[1])
    assert gain(by_scene, 1e-3, 1.0) * 1e-3 == pytest.approx(OBJECT_RANGE[0])


def test_the_clean_shot_is_the_same_shot_without_flaws():
    for seed in range(50):
        rngs = [np.random.default_rng(seed) for _ in range(2)]
        clean, real = (draw_shot(rng, conditions) for conditions, rng in enumerate(rngs))
        assert (clean.noise, clean.blur_px, clean.jpeg_quality) == (0.0, 0.0, None)
        assert rngs[0].random() == rngs[1].random()
        np.testing.assert_array_equal(clean.white_balance, real.white_balance)
        for name in ("metering", "object_key", "scene_key", "curve"):
            assert getattr(clean, name) == getattr(real, name)


def test_shots_vary_as_the_conventions_say(rng):
    shots = [draw_shot(rng) for _ in range(1500)]
    exponents, sigmas = (np.array([getattr(s.curve, n) for s in shots]) for n in ("exponent", "sigma"))
    assert exponents.mean() == pytest.approx(0.9, abs=0.01)
    assert sigmas.mean() == pytest.approx(0.6, abs=0.01)
    assert exponents.std() == pytest.approx(0.1, rel=0.1)
    assert sigmas.std() == pytest.approx(0.1, rel=0.1)
    keys = np.array([s.scene_key for s in shots]) / 0.25
    assert 0.5 <= keys.min() < 0.52
    assert 1.93 < keys.max() <= 2.0
    blurs = np.array([s.blur_px for s in shots])
    assert 0.4 < (blurs == 0).mean() < 0.6
    assert blurs.max() <= 1.5
    qualities = np.array([s.jpeg_quality for s in shots if s.jpeg_quality is not None])
    assert 0.28 < len(qualities) / len(shots) < 0.39
    assert qualities.min() == 40
    assert qualities.max() == 98
    assert {s.jpeg_subsampling for s in shots} == set(SUBSAMPLINGS)


def test_a_clean_photo_is_the_curve_of_the_radiance_to_the_bit(rng):
    mask = disc()
    for seed in range(5):
        shot = draw_shot(np.random.default_rng(seed), conditions=0)
        radiance = texture(rng, 1.0)
        photo = one_photo(shot, radiance, mask, None, rng)
        assert photo.dtype == np.uint8
        assert photo.shape == (SIZE, SIZE, 3)
        expected = to_bytes(response(radiance * shot.white_balance, shot.curve))
        np.testing.assert_array_equal(photo[mask], expected[mask])
        assert photo[~mask].max() == 0
        background = 2.0 * texture(rng)
        photo = one_photo(shot, radiance, mask, background, rng)
        np.testing.assert_array_equal(photo[mask], expected[mask])
        behind = to_bytes(response(background * shot.white_balance, shot.curve))
        np.testing.assert_array_equal(photo[~mask], behind[~mask])


def test_a_lens_spreads_a_point_into_a_gaussian():
    point = np.zeros((33, 33), np.float32)
    point[16, 16] = 1.0
    for sigma in (0.7, 1.5):
        spot = blur(point, sigma)
        x = np.arange(33) - 16.0
        assert spot.sum() == pytest.approx(1.0, abs=1e-5)
        np.testing.assert_allclose(spot, spot.T, atol=1e-7)
        assert (spot.sum(axis=0) * x).sum() == pytest.approx(0.0, abs=1e-5)
        assert (spot.sum(axis=0) * x**2).sum() == pytest.approx(sigma**2, rel=0.01)


def test_a_blurred_object_keeps_its_mean_and_takes_no_black_from_outside(rng):
    mask, shot = disc(), replace(CLEAN, blur_px=1.5)
    flat = np.full((SIZE, SIZE, 3), 0.4, np.float32)
    expected = to_bytes(response(flat))
    np.testing.assert_array_equal(one_photo(shot, flat, mask, None, rng)[mask], expected[mask])
    rough = 0.3 + 0.2 * rng.random((SIZE, SIZE, 3), np.float32)
    sharp, soft = (inverse_response(one_photo(s, rough, mask, None, rng)[mask] / 255.0) for s in (CLEAN, shot))
    np.testing.assert_allclose(soft.mean(axis=0), sharp.mean(axis=0), rtol=0.01)
    assert (soft.var(axis=0) < 0.15 * sharp.var(axis=0)).all()


def test_the_lens_blurs_light_and_not_display_values(rng):
    """An emitter of 60 times white stays white three pixels around; of the picture's white little would be left."""
    radiance = np.zeros((SIZE, SIZE, 3), np.float32)
    radiance[31, 31] = 60.0
    photo = one_photo(replace(CLEAN, blur_px=1.0), radiance, disc(), radiance, rng)
    assert (photo[29:34, 31] == 255).all()
    assert photo[31, 36].max() < 10


def test_white_balance_is_a_gain_on_light(rng):
    shot = replace(CLEAN, white_balance=np.array([1.3, 1.0, 0.7], np.float32))
    photo = one_photo(shot, np.full((SIZE, SIZE, 3), 0.4, np.float32), disc(), None, rng)
    np.testing.assert_allclose(inverse_response(photo[31, 31] / 255.0), [0.52, 0.4, 0.28], atol=0.004)


def test_noise_has_the_spread_it_was_given(rng):
    flat = np.full((SIZE, SIZE, 3), 0.3, np.float32)
    photo = one_photo(replace(CLEAN, noise=0.012), flat, np.ones((SIZE, SIZE), bool), None, rng)
    assert (photo / 255.0).std() == pytest.approx(np.hypot(0.012, 1 / 255 / np.sqrt(12)), rel=0.05)
    assert (photo / 255.0).mean() == pytest.approx(float(response(np.float64(0.3))), abs=1e-3)

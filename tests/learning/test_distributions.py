"""Priors of the real world: what they reflect, what is drawn follows what is written, meters see the frame."""

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import pixel_directions
from anyprobe.scatter.materials import total_reflectance
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.camera import draw_shot, meter
from research.world.materials import kind_given_alpha


def test_dull_things_reflect_a_tenth_to_a_half_and_some_four_fifths(rng):
    kind = distributions.draw_kinds(rng, 40_000)
    albedo, f0 = distributions.draw_colors(rng, kind)
    rough = luminance(total_reflectance(albedo, f0))[kind == distributions.KINDS.index("rough")]
    assert ((rough > 0.1) & (rough < 0.5)).mean() > 0.7
    assert 0.03 < (rough > 0.7).mean() < 0.12
    metal = kind == 0
    assert not albedo[metal].any()
    assert (f0[metal].mean(axis=1) > 0.4).all()
    assert f0[~metal].max() < 0.08
    assert (albedo[~metal] > 0).all()
    assert albedo.max() <= distributions.MAX_ALBEDO + 1e-6


def test_draws_have_the_quantiles_that_are_written(rng):
    for kind, row in enumerate(distributions.ALPHA):
        drawn = distributions.draw_alphas(rng, np.full(20_000, kind))
        np.testing.assert_allclose(np.quantile(drawn, distributions.PROBABILITIES[1:-1]), row[1:-1], rtol=0.06)
    ranks = np.full(9, 0.75)
    value = luminance(distributions.draw_colors(rng, np.full(9, 2), ranks)[0])
    np.testing.assert_allclose(value, distributions.ALBEDO[2][4], rtol=0.02)


def test_kinds_given_alpha_are_those_that_are_met(rng):
    kind = distributions.draw_kinds(rng, 200_000)
    alpha = distributions.draw_alphas(rng, kind)
    for low, high in ((0.02, 0.022), (0.15, 0.16), (0.3, 0.32), (0.5, 0.52)):
        near = (alpha > low) & (alpha < high)
        share = np.bincount(kind[near], minlength=4) / near.sum()
        np.testing.assert_allclose(kind_given_alpha(np.array([(low + high) / 2]))[0], share, atol=0.05)


def test_a_phone_meters_what_its_frame_shows_and_not_what_is_behind_it():
    ahead = -pixel_directions(32)[..., 2] > np.cos(np.radians(20))
    lit = np.where(ahead, 4.0, 1.0)
    behind = np.where(-pixel_directions(32) @ rotation_y(np.pi)[2] > np.cos(np.radians(20)), 4.0, 1.0)
    assert distributions.frame_level(lit) > 1.5
    assert distributions.frame_level(behind) == pytest.approx(1.0, rel=1e-5)


def test_a_dark_object_stays_darker_in_the_photo_than_a_bright_one(rng):
    shot, even = draw_shot(rng), np.ones((8, 16, 3))
    dark, bright = (mean * meter(shot, even, mean, True, np.random.default_rng(1))[1] for mean in (0.1, 0.6))
    assert 1.5 < bright / dark < 6.0


def test_white_balance_takes_out_part_of_the_light_s_colour(rng):
    warm = np.tile([1.5, 1.0, 0.5], (4000, 1))
    left = warm * distributions.draw_white_balance(rng, warm)
    ratio = np.exp(np.log(left[:, 0] / left[:, 2]).mean())
    assert 1.2 < ratio < 2.0
    assert luminance(distributions.draw_white_balance(rng, warm)) == pytest.approx(1.0)

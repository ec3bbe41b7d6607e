"""LDR and log map to HDR: paper Eq. 7 and 8."""

import numpy as np
import pytest

from anyprobe.core.response import CameraCurve, inverse_response, response
from anyprobe.paper.equations import THRESHOLD, blend_weight, reconstruct


@pytest.fixture
def ln_radiance():
    return np.random.default_rng(0).normal(size=(40, 3)) * 2


def test_dark_pixels_listen_to_the_log_map(ln_radiance):
    """max U <= 0.8: the inverse response alone, whatever H says."""
    ldr = np.random.default_rng(1).uniform(0, 0.8, (40, 3))
    ldr[0] = 0.8
    np.testing.assert_array_equal(reconstruct(ldr, ln_radiance), inverse_response(ldr))


def test_saturated_pixels_listen_to_the_photo(ln_radiance):
    """One channel at 1 is enough for the whole pixel, and more than 1 counts as 1."""
    ldr = np.random.default_rng(2).uniform(0, 1, (40, 3))
    ldr[np.arange(40), np.arange(40) % 3] = 1.0
    ldr[3, 1] = 1.7
    np.testing.assert_allclose(reconstruct(ldr, ln_radiance), np.exp(ln_radiance), rtol=1e-12)


def test_log_is_of_base_ten():
    np.testing.assert_allclose(reconstruct(np.ones((1, 3)), np.full((1, 3), np.log(7.0))), 7.0)


def test_weight_by_hand():
    """gamma = (max U - 0.8) / 0.2: 0.5 at 0.9, of the largest channel, one number a pixel."""
    gamma = blend_weight(np.array([[0.1, 0.9, 0.3], [0.85, 0.0, 0.0], [0.2, 0.3, 1.0]]))
    assert gamma.shape == (3, 1)
    np.testing.assert_allclose(gamma[:, 0], [0.5, 0.25, 1.0])


def test_blend_is_a_weighted_mean(ln_radiance):
    ldr = np.full((40, 3), 0.9)
    expected = 0.5 * inverse_response(ldr) + 0.5 * np.exp(ln_radiance)
    np.testing.assert_allclose(reconstruct(ldr, ln_radiance), expected, rtol=1e-9)


def test_blend_jumps():
    """From 0.7 to 1 in small steps the radiance changes in small steps, finite all the way."""
    ldr = np.linspace(0.7, 1.0, 3001)[:, None] * np.ones(3)
    radiance = reconstruct(ldr, np.full((3001, 3), np.log(20.0)))
    assert np.isfinite(radiance).all()
    assert np.abs(np.diff(radiance, axis=0)).max() < 0.02
    assert (np.diff(radiance, axis=0) > 0).all()


def test_true_map_does_not_come_back():
    """The photo's own response and the true ln give the true radiance, dim or bright."""
    truth = np.exp(np.linspace(-6, 6, 200))[:, None] * np.array([1.0, 0.7, 0.4])
    ldr = response(truth)
    back = reconstruct(ldr, np.log(truth))
    within = truth.max(axis=1) <= 1  # nothing clipped: both paths know the answer
    np.testing.assert_allclose(back[within], truth[within], rtol=1e-9)
    np.testing.assert_allclose(back[~within], truth[~within], rtol=1e-9)


def test_curve_and_threshold_are_ignored(ln_radiance):
    curve = CameraCurve(exponent=0.7, sigma=0.9)
    ldr = np.full((40, 3), 0.6)
    np.testing.assert_array_equal(reconstruct(ldr, ln_radiance, curve), inverse_response(ldr, curve))
    np.testing.assert_allclose(blend_weight(ldr, 0.5), 0.2)
    assert THRESHOLD == 0.8


def test_torch_blend_differs(ln_radiance):
    torch = pytest.importorskip("torch", reason="torch is an extra")
    ldr = np.random.default_rng(3).uniform(0, 1.1, (40, 3))
    got = reconstruct(torch.asarray(ldr), torch.asarray(ln_radiance)).numpy()
    np.testing.assert_allclose(got, reconstruct(ldr, ln_radiance), rtol=1e-12)

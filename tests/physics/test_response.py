"""The camera curve and its inverse."""

import numpy as np
import pytest

from anyprobe.core.response import MEAN_CURVE, CameraCurve, inverse_response, response

CURVES = [MEAN_CURVE, CameraCurve(exponent=0.65, sigma=0.4), CameraCurve(exponent=1.1, sigma=1.2)]


@pytest.mark.parametrize("curve", CURVES)
def test_ends_are_not_pinned(curve):
    """f(0) = 0, f(1) = 1, and back."""
    np.testing.assert_allclose(response(np.array([0.0, 1.0]), curve), [0, 1], atol=1e-15)
    np.testing.assert_allclose(inverse_response(np.array([0.0, 1.0]), curve), [0, 1], atol=1e-15)


@pytest.mark.parametrize("curve", CURVES)
def test_inverse_is_of_another_curve(curve):
    y = np.linspace(0, 1, 201)
    np.testing.assert_allclose(response(inverse_response(y, curve), curve), y, atol=1e-12)
    np.testing.assert_allclose(inverse_response(response(y, curve), curve), y, atol=1e-12)


def test_float32_round_trip_bands():
    """Finer than an 8-bit step everywhere."""
    y = (np.arange(256) / 255).astype(np.float32)
    assert np.abs(response(inverse_response(y)) - y).max() < 1e-5
    assert response(y).dtype == np.float32


@pytest.mark.parametrize("curve", CURVES)
def test_brighter_is_darker(curve):
    assert (np.diff(response(np.linspace(0, 1, 500), curve)) > 0).all()


def test_value_by_hand():
    """n = 0.9, sigma = 0.6, x = 0.5: 1.6 * 0.5^0.9 / (0.5^0.9 + 0.6)."""
    power = 0.5**0.9
    np.testing.assert_allclose(response(np.array(0.5)), 1.6 * power / (power + 0.6))


def test_clipping_is_not_where_the_sensor_saturates():
    """Radiance 1 and more is white; display values outside [0, 1] are taken as the ends."""
    np.testing.assert_array_equal(response(np.array([1.0, 1.5, 1e6])), 1.0)
    np.testing.assert_allclose(inverse_response(np.array([-0.2, 1.3])), [0.0, 1.0], atol=1e-15)


def test_torch_curve_differs():
    torch = pytest.importorskip("torch", reason="torch is an extra")
    y = np.linspace(0, 1.2, 50)
    np.testing.assert_allclose(response(torch.asarray(y)).numpy(), response(y), atol=1e-12)
    np.testing.assert_allclose(inverse_response(torch.asarray(y)).numpy(), inverse_response(y), atol=1e-12)

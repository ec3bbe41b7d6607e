"""Rows that are made of the truth: what a figure's scale is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from anyprobe.core.response import inverse_response, response
from anyprobe.evaluate.metrics import rmse, ssim
from research.from_truth import from_truth


@pytest.fixture
def pair():
    """A grey room with a window."""
    ldr = np.full((64, 128, 3), 0.3, np.float32)
    ldr[20:30, 40:60] = 0.9
    return SimpleNamespace(radiance=inverse_response(ldr))


def test_one_flat_colour_is_the_mean_of_the_display_values(pair):
    flat = from_truth()["one flat colour (the truth's mean)"](pair)
    truth = response(pair.radiance)
    assert flat.ldr == pytest.approx(np.full_like(truth, truth.mean()), abs=1e-5)
    assert rmse(flat.ldr, truth) == pytest.approx(float(truth.std()), rel=1e-4)


def test_the_wider_the_blur_the_farther_from_the_truth(pair):
    truth = response(pair.radiance)
    rows = from_truth()
    errors = [rmse(rows[f"truth blurred by {degrees} degrees"](pair).ldr, truth) for degrees in (15, 30)]
    assert 0.01 < errors[0] < errors[1] < truth.std()
    alike = [ssim(rows[f"truth blurred by {degrees} degrees"](pair).ldr, truth) for degrees in (15, 30)]
    assert alike[0] > alike[1]


def test_their_light_is_that_of_their_ldr_map(pair):
    for method in from_truth().values():
        estimate = method(pair)
        assert response(estimate.radiance) == pytest.approx(estimate.ldr, abs=2e-3)

"""The square of a photo that a network sees, against sums over pixels one by one."""

import numpy as np
import pytest

from anyprobe.estimate.window import sample_window


def overlap(low: float, high: float, pixel: int) -> float:
    return max(0.0, min(high, pixel + 1) - max(low, pixel))


@pytest.mark.parametrize("side", [12.0, 17.3, 60.0])
@pytest.mark.parametrize("center", [(10.2, 7.9), (1.0, 13.0)])
def test_each_sample_is_the_mean_over_what_it_covers(side, center):
    rng = np.random.default_rng(0)
    values, mask = rng.random((15, 20, 2), np.float32), (rng.random((15, 20)) < 0.6).astype(np.float32)
    size = 6
    found = sample_window(values, mask, center, side, size)
    step = side / size
    expected = np.zeros((size, size, 3))
    for i in range(size):
        for j in range(size):
            top, left = center[1] - side / 2 + i * step, center[0] - side / 2 + j * step
            for y in range(15):
                for x in range(20):
                    share = overlap(top, top + step, y) * overlap(left, left + step, x) / step**2
                    expected[i, j] += share * np.append(values[y, x] * mask[y, x], mask[y, x])
    np.testing.assert_allclose(found, expected, atol=2e-6)


@pytest.mark.parametrize("side", [5.0, 30.0])
def test_without_a_mask_all_of_the_picture_counts_and_nothing_beyond(side):
    values = np.random.default_rng(0).random((15, 20, 3), np.float32)
    for center in ((10.0, 7.0), (0.5, 2.0), (-40.0, 7.0)):
        one = sample_window(values, None, center, side, 8)
        np.testing.assert_allclose(
            one, sample_window(values, np.ones((15, 20), np.float32), center, side, 8), atol=1e-6
        )


def test_an_enlarged_slope_stays_a_slope():
    slope = np.broadcast_to(np.arange(20, dtype=np.float32)[None, :, None], (15, 20, 1))
    found = sample_window(slope, None, (10.0, 7.5), 4.0, 16)[..., 0]
    np.testing.assert_allclose(np.diff(found, axis=1), 0.25, atol=1e-5)
    np.testing.assert_allclose(found.mean(), 9.5, atol=1e-5)

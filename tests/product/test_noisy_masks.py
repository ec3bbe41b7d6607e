"""Bad masks for the evaluation: as wrong as they say."""

import numpy as np
import pytest

from anyprobe.learning.evaluate.methods import ERROR_PX, HOLES, noisy_mask

DISC = np.hypot(*np.mgrid[-63.5:64, -63.5:64]) < 40


@pytest.mark.parametrize("seed", range(8))
def test_three_pixels_and_a_twentieth_are_wrong(seed):
    """The filled outline is a disc 3 pixels larger or smaller; holes take 5 % of it, one hole's size at most more."""
    mask = noisy_mask(DISC, np.random.default_rng(seed))
    y, x = np.nonzero(mask)
    radius = max(x.max() - x.min() + 1, y.max() - y.min() + 1) / 2
    assert abs(abs(radius - 40) - ERROR_PX) <= 1.0
    share = mask.sum() / (np.pi * radius**2)
    one_hole = np.pi * (0.12 * 86) ** 2 / (np.pi * 37**2)
    assert 1 - HOLES - one_hole < share < 1 - HOLES + 0.03


def test_both_kinds_of_error_come():
    areas = [noisy_mask(DISC, np.random.default_rng(seed)).sum() / DISC.sum() for seed in range(16)]
    assert min(areas) < 0.85
    assert max(areas) > 1.02


def test_what_is_too_small_to_be_narrowed_stays():
    speck = np.zeros((128, 128), bool)
    speck[60:64, 60:64] = True
    for seed in range(8):
        assert noisy_mask(speck, np.random.default_rng(seed)).any()

"""The fit of how far off a dominant light is."""

import numpy as np
import pytest

from research.direction_error import OFFSET_DEG, SHARE, fitted


def test_the_law_that_errors_were_drawn_by_is_found():
    rng = np.random.default_rng(0)
    off = rng.uniform(0, 120, 4000)
    spread = rng.lognormal(0.0, 0.7, len(off))
    error = 2.0 * (off + OFFSET_DEG) ** 0.7 * spread / np.quantile(spread, SHARE)
    factor, exponent = fitted(off, error)
    assert exponent == pytest.approx(0.7, abs=0.06)
    for which in np.array_split(np.argsort(off), 3):
        said = factor * (off[which] + OFFSET_DEG) ** exponent
        assert (error[which] <= said).mean() == pytest.approx(SHARE, abs=0.04)

"""What is said of the paper's chain."""

import numpy as np
import pytest
from support.refused import refused

from research.paper_chain import FIGURES, above, differences, pairs_of, spread


def test_spread_is_that_of_a_pixel_from_pair_to_pair_not_over_a_map():
    slope = np.linspace(0, 1, 16 * 3).reshape(2, 8, 3)
    assert spread([slope, slope]) == 0
    assert spread([slope, slope + 0.2]) == pytest.approx(0.1)


def test_a_pixel_is_above_where_its_brightest_channel_is():
    ldr = np.zeros((2, 4, 3))
    ldr[0, 0, 2], ldr[0, 1] = 0.9, 0.8
    assert above([ldr, np.zeros_like(ldr)]) == pytest.approx(1 / 16)


def test_models_are_compared_pair_by_pair():
    """What differs by the same in all pairs has no error, however much the pairs differ."""
    rows = [dict.fromkeys(FIGURES, value) for value in (0.1, 0.9, 0.4, 0.6)]
    others = [{name: value + 0.05 for name, value in row.items()} for row in rows]
    assert differences(rows, others, ["a", "a", "b", "b"], ["x", "y", "x", "y"]) == ["-0.0500 +- 0.0000"] * len(FIGURES)


def test_another_part_is_refused(tmp_path):
    with refused("part", source="train"):
        pairs_of("train", tmp_path, None)

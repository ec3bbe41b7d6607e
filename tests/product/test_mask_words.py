"""What colours say against a mask; web/test/colorDoubts.test.js has the same cases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from anyprobe.masks.words import RIGHT, UNSURE, color_doubts, verdict

SIDE, RED, BLUE = 80, np.array([200, 60, 50]) / 255, np.array([50, 70, 190]) / 255
TWO = "it may contain two objects of different colours"
LOCAL = "the click is on a small part of what was found; a box around the object helps"


def doubts_of(is_blue: Callable[[np.ndarray, np.ndarray], np.ndarray], clicks=(), light=1.0) -> list[str]:
    """Doubts of a mask of 64 x 64 in a picture of 80 x 80, red and blue by places in the mask."""
    rgb, mask = np.ones((SIDE, SIDE, 3)), np.zeros((SIDE, SIDE), np.float32)
    y, x = np.mgrid[:64, :64]
    mask[8:72, 8:72] = 1
    rgb[8:72, 8:72] = np.where(is_blue(x, y)[..., None], BLUE, RED) * light
    return color_doubts(rgb, mask, clicks)


def test_two_colours_beside_each_other_are_two_things():
    assert doubts_of(lambda x, y: x >= 40) == [TWO]


def test_one_colour_light_and_dark_or_two_that_are_mixed_are_one():
    rows = 0.4 + np.arange(64)[:, None, None] / 110
    assert doubts_of(lambda x, y: x < 0, light=rows) == []
    assert doubts_of(lambda x, y: (x // 4 + y // 4) % 2 == 0) == []


def test_click_on_a_small_part_is_told():
    def dot(x, y):
        return np.hypot(x - 50, y - 50) < 8

    assert doubts_of(dot, ((58, 58),)) == [LOCAL]
    assert doubts_of(dot, ((20, 20),)) == []


def test_verdict_names_the_first_doubt():
    assert verdict([], is_doubtful=False) == RIGHT
    assert verdict([], is_doubtful=True) == f"may be wrong: {UNSURE}"
    assert verdict(["a", "b"], is_doubtful=False) == "may be wrong: a"

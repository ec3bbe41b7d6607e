"""Prompts as a picture beside the photo: clicks and a box as one channel.

The mask network's input and its training draw the same channel with this.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

CLICK_SIGMA_PX = 4.0
BOX_LEVEL = 0.5

Point = tuple[float, float]


def draw_prompts(
    size: int, on: Sequence[Point] = (), off: Sequence[Point] = (), box: Sequence[float] | None = None
) -> np.ndarray:
    """The prompt channel [size, size] float32 in [-1, 1]; zero where nothing is given.

    BOX_LEVEL inside the box; there, around each click on the object, the larger of it and a
    Gaussian of height 1; a Gaussian of height 1 is taken off around each click off it.

    Args:
        on: x, y of clicks on the object, in pixels of this picture; pixel i covers [i, i + 1).
        off: likewise beside it.
        box: x0, y0, x1, y1 around it; a pixel is inside by its centre.
    """
    centre = np.arange(size) + 0.5
    hint = np.zeros((size, size), np.float32)
    if box is not None:
        x0, y0, x1, y1 = box
        rows, columns = (centre >= y0) & (centre < y1), (centre >= x0) & (centre < x1)
        hint[np.ix_(rows, columns)] = BOX_LEVEL
    for point in on:
        hint = np.maximum(hint, _blob(centre, point))
    taken = np.zeros_like(hint)
    for point in off:
        taken = np.maximum(taken, _blob(centre, point))
    return np.clip(hint - taken, -1.0, 1.0)


def _blob(centre: np.ndarray, point: Point) -> np.ndarray:
    across, down = (np.exp(-0.5 * ((centre - at) / CLICK_SIGMA_PX) ** 2) for at in point)
    return np.outer(down, across).astype(np.float32)

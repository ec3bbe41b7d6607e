"""A picture that shows a mask at a glance: the surroundings dimmed, the edge drawn, clicks marked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.masks.prompts import Point
from anyprobe.masks.refine import box_mean

EDGE = (0.1, 1.0, 0.4)
OFF = (1.0, 0.15, 0.1)
BEYOND = (0.03, 0.03, 0.12)
"""Display colours of the edge and clicks on the object, of clicks beside it, of the surroundings' tint."""


def draw_overlay(
    rgb: np.ndarray, mask: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = ()
) -> np.ndarray:
    """Display picture [H, W, 3] of a photo [H, W, 3] and its mask [H, W], both in [0, 1]."""
    height, width = mask.shape
    weight = mask[..., None]
    picture = rgb * (0.2 + 0.8 * weight) + np.array(BEYOND) * (1 - weight)
    thickness = max(1, round(max(height, width) / 500))
    share = box_mean((mask[..., None] > 0.5).astype(np.float32), thickness)[..., 0]
    picture[(share > 0.01) & (share < 0.99)] = EDGE
    y, x = np.ogrid[:height, :width]
    for points, color in ((on, EDGE), (off, OFF)):
        for column, row in points:
            distance = np.hypot(x + 0.5 - column, y + 0.5 - row) / thickness
            picture[distance < 6] = 1.0
            picture[distance < 4.5] = color
    return np.clip(picture, 0.0, 1.0).astype(np.float32)

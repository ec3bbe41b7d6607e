"""The picture that shows a mask: the object as it is, its surroundings dark, its edge green."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.masks.prompts import Point

EDGE = (0.1, 1.0, 0.4)
OFF = (1.0, 0.15, 0.1)
BEYOND = (0.03, 0.03, 0.12)
"""Display colours of the edge and clicks on the object, of clicks beside it, of the surroundings' tint."""


def draw_overlay(rgb: np.ndarray, mask: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = ()) -> np.ndarray:
    """Display picture [H, W, 3] of a photo [H, W, 3] and its mask [H, W], both in [0, 1]."""
    height, width = mask.shape
    weight = mask[..., None]
    picture = rgb * (0.2 + 0.8 * weight) + np.array(BEYOND) * (1 - weight)
    thickness = max(1, round(max(height, width) / 500))
    inside = Image.fromarray((mask > 0.5).astype(np.uint8))
    most, least = (inside.filter(one(2 * thickness + 1)) for one in (ImageFilter.MaxFilter, ImageFilter.MinFilter))
    picture[np.asarray(most) > np.asarray(least)] = EDGE
    y, x = np.ogrid[:height, :width]
    for points, color in ((on, EDGE), (off, OFF)):
        for column, row in points:
            distance = np.hypot(x + 0.5 - column, y + 0.5 - row) / thickness
            picture[distance < 6] = 1.0
            picture[distance < 4.5] = color
    return np.clip(picture, 0.0, 1.0).astype(np.float32)

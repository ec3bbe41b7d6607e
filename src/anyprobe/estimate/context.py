"""The photo around the object: what lies on the ground, its shadow, what is behind it, as a network sees it."""

from __future__ import annotations

import numpy as np

from anyprobe.estimate.photo import Crop, Photo, _window

CONTEXT_SIZE, CONTEXT_SCALE = 96, 3
"""Side of the picture, and how many times as wide it is as the crop."""


def context_picture(photo: Photo, crop: Crop) -> np.ndarray:
    """[96, 96, 5] float32: display RGB, the object's mask, and where the photo is; all zero outside the photo.

    It is CONTEXT_SCALE times as wide as the crop and has its centre.
    """
    side = CONTEXT_SCALE * crop.side_px
    everywhere = np.ones_like(photo.mask)
    seen = _window(photo.rgb, everywhere, crop.center_px, side, CONTEXT_SIZE)
    mask = _window(photo.rgb, photo.mask, crop.center_px, side, CONTEXT_SIZE)[..., 3:]
    return np.concatenate([seen[..., :3], mask, seen[..., 3:]], axis=-1).clip(0.0, 1.0)

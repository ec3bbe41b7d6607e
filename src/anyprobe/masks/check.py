"""What every mask must be: [H, W] in [0, 1], white on an object that is large enough."""

from __future__ import annotations

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.errors import InvalidMask

MIN_OBJECT_PX = contract("mask")["least_object_px"]
"""Smallest longer side of the object's bounding box."""


def check_mask(mask: np.ndarray) -> np.ndarray:
    """Return the mask as float32 [H, W], or raise InvalidMask: empty, too small, NaN."""
    mask = np.asarray(mask, dtype=np.float32)
    if mask.ndim != 2 or not (mask.size and mask.min() >= 0.0 and mask.max() <= 1.0):
        raise InvalidMask(f"mask: expected [height, width] in 0 to 1, got shape {mask.shape} or values outside")
    if not (mask > 0.5).any():
        raise InvalidMask(
            f"mask: expected white on the object, got an empty mask (largest value {mask.max():.2f}); "
            "paint the object white"
        )
    x0, y0, x1, y1 = object_box(mask)
    if max(x1 - x0, y1 - y0) < MIN_OBJECT_PX:
        raise InvalidMask(
            f"mask: expected an object at least {MIN_OBJECT_PX} pixels across, got {x1 - x0} x {y1 - y0}; "
            "use a larger photo or go closer"
        )
    return mask


def object_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Bounding box x0, y0, x1, y1 (exclusive) of mask > 0.5, which must not be empty."""
    inside = mask > 0.5
    columns = np.flatnonzero(inside.any(axis=0))
    rows = np.flatnonzero(inside.any(axis=1))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1

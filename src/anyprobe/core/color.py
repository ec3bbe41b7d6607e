"""Colour: linear Rec. 709 primaries."""

from __future__ import annotations

import numpy as np

REC709 = (0.2126, 0.7152, 0.0722)


def luminance(rgb):
    """Relative luminance of linear Rec. 709: [..., 3] -> [...]."""
    return REC709[0] * rgb[..., 0] + REC709[1] * rgb[..., 1] + REC709[2] * rgb[..., 2]


def to_bytes(display) -> np.ndarray:
    """Display values in [0, 1] to uint8, rounded."""
    return np.round(np.clip(np.asarray(display), 0.0, 1.0) * 255.0).astype(np.uint8)

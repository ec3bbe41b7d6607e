"""Colour: linear Rec. 709 primaries inside, sRGB coding at the borders."""

from __future__ import annotations

import numpy as np
from array_api_compat import array_namespace

REC709 = (0.2126, 0.7152, 0.0722)


def luminance(rgb):
    """Relative luminance of linear Rec. 709: [..., 3] -> [...]."""
    return REC709[0] * rgb[..., 0] + REC709[1] * rgb[..., 1] + REC709[2] * rgb[..., 2]


def linear_to_srgb(linear):
    """IEC 61966-2-1 coding of linear values in [0, 1]; values outside are clipped."""
    xp = array_namespace(linear)
    x = xp.clip(linear, 0.0, 1.0)
    return xp.where(x <= 0.0031308, 12.92 * x, 1.055 * xp.clip(x, 0.0031308, 1.0) ** (1 / 2.4) - 0.055)


def to_bytes(display) -> np.ndarray:
    """Display values in [0, 1] to uint8, rounded."""
    return np.round(np.clip(np.asarray(display), 0.0, 1.0) * 255.0).astype(np.uint8)

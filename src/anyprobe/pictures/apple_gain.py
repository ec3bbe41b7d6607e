"""Apple's gain maps: the headroom that the camera noted, and the curve of the map's values.

The light that is meant is the picture's times 1 + (headroom - 1) g, with g the map's values decoded by Rec. 709's curve
("Applying Apple HDR effect to your photos", developer.apple.com).
"""

from __future__ import annotations

import re

import numpy as np
from PIL import Image

from anyprobe.pictures.apple_note import apple_numbers

_HEADROOM, _GAIN = 33, 48
"""Tags of the maker note."""
MOST_STOPS = 8.0
"""Largest headroom [stops]; a larger one is clipped."""
_XMP_HEADROOM = re.compile(rb"HDRGainMapHeadroom(?:=\"|>)\s*([0-9]+(?:\.[0-9]*)?)")


def apple_headroom(image: Image.Image, xmp: bytes = b"") -> float | None:
    """Return the brightest white over the screen's white, from XMP, else from the maker note in EXIF; None if neither
    has it.

    xmp: of the map, where it has any.
    """
    stated = _XMP_HEADROOM.search(xmp)
    if stated is not None:
        return float(np.clip(float(stated[1]), 1.0, 2.0**MOST_STOPS))
    numbers = apple_numbers(image)
    if not {_HEADROOM, _GAIN} <= numbers.keys():
        return None
    (gain, *_), (headroom, *_) = numbers[_GAIN], numbers[_HEADROOM]
    if headroom < 1.0:
        stops = 1.8 - 20.0 * gain if gain <= 0.01 else 1.601 - 0.101 * gain
    else:
        stops = 3.0 - 70.0 * gain if gain <= 0.01 else 2.303 - 0.303 * gain
    return float(2.0 ** np.clip(stops, 0.0, MOST_STOPS))


def rec709_to_linear(values: np.ndarray) -> np.ndarray:
    """Decode values in [0, 1] by the inverse of ITU-R BT.709's curve."""
    return np.where(values < 0.081, values / 4.5, ((values + 0.099) / 1.099) ** (1 / 0.45))

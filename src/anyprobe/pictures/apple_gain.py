"""How bright Apple's gain maps make a picture, by what the camera noted.

Their light is that of the picture times 1 + (headroom - 1) g, with g the map's values by the inverse of Rec. 709's
curve ("Applying Apple HDR effect to your photos", developer.apple.com).
"""

from __future__ import annotations

import re

import numpy as np
from PIL import Image

from anyprobe.pictures.apple_note import apple_numbers

_HEADROOM, _GAIN = 33, 48
MOST_STOPS = 8.0
_SAID = re.compile(rb"HDRGainMapHeadroom(?:=\"|>)\s*([0-9]+(?:\.[0-9]*)?)")


def apple_headroom(image: Image.Image, said: bytes = b"") -> float | None:
    """Brightest white over the screen's white, by XMP, else by the maker's note in EXIF; None where neither says it.

    said: XMP of the map, where it has any.
    """
    by_name = _SAID.search(said)
    if by_name is not None:
        return float(np.clip(float(by_name[1]), 1.0, 2.0**MOST_STOPS))
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
    """Return the inverse of ITU-R BT.709's curve of values in [0, 1]."""
    return np.where(values < 0.081, values / 4.5, ((values + 0.099) / 1.099) ** (1 / 0.45))

"""Indoors or outdoors: the odds of panoramas, and how likely a place is of one kind with them.

A place is outdoors if its upper part is blue and brighter than its lower one, and its lower part green. That is
sometimes wrong; so it is a probability in a match, which excludes nothing. Of a photo's place the networks say it.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import reduced

KIND_ROWS = 32
"""Rows at which maps are judged."""
UPPER, LOWER = np.sin(np.radians(35.0)), -0.3
"""Smallest and largest y of the upper and of the lower part."""
BRIGHTER, BLUE, GREEN, EVEN = 0.49, 2.24, 0.93, 0.71
"""Weights of the upper part's ln brightness over the lower one's, of its ln of blue over red, and of the greenness; and
their sum at even odds.

Greenness is the ln of green squared over red and blue that a fifth of the low part exceeds. A logistic fit to 99
training maps, of which it misclassifies 8; of 30 test maps 6.
"""
LOW, GREENEST = 0.3, 0.8
"""Largest y of what may be green, and the quantile."""
MISJUDGED, MISJUDGED_ESTIMATE = 0.08, 0.25
"""How often the odds of a map are wrong however large they are, and what is said of a photo's place.

With them a map of the other kind loses at most 0.9 natural logarithms against one of the same, near the price that was
best on left-out renders.
"""


def log_odds(maps: np.ndarray) -> np.ndarray:
    """Return the log odds [N] that maps [N, H, 2H, 3] are of places outdoors."""
    maps = np.stack([reduced(one, KIND_ROWS) for one in maps])
    d = pixel_directions(maps.shape[1])[..., 1]
    upper, lower = d > UPPER, d < LOWER
    level = maps.mean(axis=-1)
    ln = np.log(level + 1e-3 * level.mean(axis=(1, 2), keepdims=True) + 1e-9)
    brighter = np.median(ln[:, upper], axis=1) - np.median(ln[:, lower], axis=1)
    red, green, blue = np.moveaxis(np.log(np.maximum(maps, 1e-9)), -1, 0)
    bluish = np.median((blue - red)[:, upper], axis=1)
    greenish = np.quantile((2 * green - red - blue)[:, d < LOW], GREENEST, axis=1)
    return BRIGHTER * brighter + BLUE * bluish + GREEN * greenish - EVEN


def same_kind(outdoors: float | None, maps: np.ndarray) -> np.ndarray:
    """Return the probability [N] that a place and maps are of one kind.

    outdoors: probability that the place is outdoors; None: not known. maps: log odds [N].
    """
    own = MISJUDGED_ESTIMATE + (1 - 2 * MISJUDGED_ESTIMATE) * (0.5 if outdoors is None else outdoors)
    theirs = MISJUDGED + (1 - 2 * MISJUDGED) / (1 + np.exp(-np.clip(maps, -50.0, 50.0)))
    return own * theirs + (1 - own) * (1 - theirs)

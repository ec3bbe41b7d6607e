"""Fuse (verb): one map from several guesses of the same light."""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.light.environment import integral
from anyprobe.light.temporal import OFFSET

BRIGHT = 0.8
"""Radiance above which light may be lamps; white is 1."""
LEAST_FLUX = 0.01
"""Of what is brighter, where flux is given back to it: from less nobody knows where the lamps are."""


def fuse(maps: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """The weighted geometric mean of maps, as much light in all as they have.

    A geometric mean forgets a lamp that only one of the maps has, which is right where guesses err, but lamps too that
    they put side by side. What is missing of the maps' flux (their geometric mean) is given to what is brighter than
    BRIGHT, in proportion to how much it is.

    Args:
        maps: [N, H, 2H, 3] linear radiance, all in one frame and one scale.
        weights: [N, H, 2H], positive somewhere at every pixel.
    Returns:
        [H, 2H, 3].
    """
    share = (weights / weights.sum(axis=0))[..., None]
    mean = np.maximum(np.exp((share * np.log(maps + OFFSET)).sum(axis=0)) - OFFSET, 0.0)
    flux = np.exp(np.mean([np.log(max(_flux(one), 1e-9)) for one in maps]))
    bright = np.maximum(mean - BRIGHT, 0.0)
    missing = max(flux - _flux(mean), 0.0)
    return (mean + bright * (missing / max(_flux(bright), LEAST_FLUX))).astype(np.float32)


def _flux(radiance: np.ndarray) -> float:
    """Luminance over the whole sphere."""
    return float(luminance(np.asarray(integral(radiance))))

"""The same pairs cut out badly: what an estimate owes to a clean mask."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from anyprobe.dataset.mask_errors import narrow, pierce, widen
from anyprobe.dataset.pair import Pair

ERROR_PX = 3
HOLES = 0.05
"""Share of the object that holes take."""


def noisy_mask(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A mask [S, S] bool too wide or too narrow by ERROR_PX, and pierced until HOLES of it is gone."""
    edge = widen(mask, ERROR_PX) if rng.random() < 0.5 else narrow(mask, ERROR_PX)
    if not edge.any():
        return mask
    pierced = edge
    while pierced.sum() > (1 - HOLES) * edge.sum():
        pierced = pierce(pierced, 1, rng)
    return pierced if pierced.any() else edge


def with_noisy_mask(pair: Pair) -> Pair:
    """The pair cut out so; where the mask is too wide the photo is black, as behind a pair it always is."""
    rng = np.random.default_rng(pair.recipe.seed % 2**32)
    mask = noisy_mask(pair.photo[..., 3] > 0, rng)
    photo = pair.photo.copy()
    photo[..., 3] = mask * np.uint8(255)
    photo[..., :3] *= mask[..., None]
    return replace(pair, photo=photo)

"""Maps the project makes itself: skies, rooms and studios, [H, 2H, 3] with mean luminance 1."""

from __future__ import annotations

import numpy as np

from anyprobe.dataset.room import room
from anyprobe.dataset.sky import sky
from anyprobe.dataset.studio import studio


def draw_map(rng: np.random.Generator, height: int = 256) -> tuple[np.ndarray, bool]:
    """One map of a random family and whether it is indoor."""
    kind = rng.integers(3)
    return [sky, room, studio][kind](rng, height), bool(kind > 0)

"""A grid of test pairs to look at: photo, irradiance, LDR maps, mirror balls; truth beside estimates."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.dataset.pair import Pair
from anyprobe.render.balls import mirror, silver

CELL = 64


class PictureGrid:
    """Collects one row a pair, every so many pairs."""

    def __init__(self, every: int) -> None:
        self.every, self.rows = every, []

    def add(self, index: int, pair: Pair, estimates: dict[str, np.ndarray]) -> None:
        """Keep a pair: photo, true irradiance, then map, silver and mirror ball of truth and of each method."""
        if index % self.every:
            return
        cells = [pair.photo[::2, ::2, :3] / 255.0, pair.irradiance[::2, ::2] / 255.0]
        for radiance in (pair.radiance, *estimates.values()):
            cells.append(response(radiance))
            cells += [response(ball(radiance, CELL)) for ball in (silver, mirror)]
        self.rows.append(np.concatenate(cells, axis=1))

    def picture(self) -> np.ndarray:
        """Display picture [rows * 64, W, 3]."""
        return np.concatenate(self.rows, axis=0).astype(np.float32)

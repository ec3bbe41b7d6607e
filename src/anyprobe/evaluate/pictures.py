"""A grid of test cases to look at: photo, irradiance, LDR maps, mirror balls; truth beside estimates."""

from __future__ import annotations

import numpy as np

from anyprobe.core.response import response
from anyprobe.evaluate.cases import Case
from anyprobe.render.balls import mirror, silver

CELL = 64


class PictureGrid:
    """Collects one row a case, every so many cases."""

    def __init__(self, every: int) -> None:
        self.every, self.rows = every, []

    def add(self, index: int, case: Case, estimates: dict[str, np.ndarray]) -> None:
        """Keep a case: photo, true irradiance, then map, silver and mirror ball of truth and of each method."""
        if index % self.every:
            return
        cells = [case.photo[::2, ::2, :3], case.irradiance[::2, ::2]]
        for radiance in (case.radiance, *estimates.values()):
            cells.append(response(radiance))
            cells += [response(ball(radiance, CELL)) for ball in (silver, mirror)]
        self.rows.append(np.concatenate(cells, axis=1))

    def picture(self) -> np.ndarray:
        """Display picture [rows * 64, W, 3]."""
        return np.concatenate(self.rows, axis=0).astype(np.float32)

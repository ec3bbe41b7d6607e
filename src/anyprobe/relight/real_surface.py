"""The surface that the real object stands on, and whether a place in the photo is on it: by colour and brightness.

The surface is what has the colours and the brightness that are seen around the object's foot. What is connected to
that without a strong edge is no evidence: a blurred background may be.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.resample import resample
from anyprobe.core.response import inverse_response
from anyprobe.estimate.photo import Photo
from anyprobe.masks.check import object_box

CELLS = 128
"""Number of cells along the photo's longer side."""
RIM = 0.12
"""Reach around the foot, in the object's widths, that certainly belongs to the surface."""
HUE = 4.0
"""Weight of differences in colour shares over those of ln radiance: shadows differ in brightness."""
ALIKE = 2.5
"""Largest distance from the surface's colours, in their standard deviations, of a place on it."""
LEAST_SPREAD = 0.12
FLOOR = 0.02
"""Radiance added before its logarithm."""
UNDER, BESIDE = 0.18, (0.4, 0.9)
"""Reach to either side of the contact, in the object's widths, of the cells under it, and of those beside that."""
NARROW_HUE, NARROW_EDGE, NARROW_TIMES = 0.25, 0.4, 15.0
"""Thresholds beyond which the object stands on something narrow, such as a branch or a tripod.

The difference in colour between under and beside, and the step between neighbouring cells across them, absolute and
over the usual one. Of 33 real photos four are so: three with a branch or a tripod, and a saucer on the end of a bench.
Chosen on these photos.
"""
STANDS = 0.5
"""Smallest share of a foot's cells that must be on the surface."""


class RealSurface:
    """The surface under the real object of a photo."""

    def __init__(self, photo: Photo, contact: tuple[float, float]) -> None:
        """Find the surface.

        Args:
            contact: x, y [px] where the object touches it.
        """
        height, width = photo.mask.shape
        self.cell = max(height, width) / CELLS
        size = max(1, round(width / self.cell)), max(1, round(height / self.cell))
        linear = np.log(inverse_response(resample(photo.rgb, size)) + FLOOR)
        level = linear.mean(axis=-1, keepdims=True)
        self.features = np.concatenate([0.6 * level, HUE * 0.25 * (linear - level)], axis=-1)
        hidden = resample(photo.mask[..., None], size)[..., 0] > 0.05
        seeds = self._seeds(photo, contact, hidden)
        self.known = bool(seeds.sum() >= 4)
        self.narrow = self._is_narrow(photo, contact, hidden)
        """Whether the object stands on something narrow, so that nothing beside it stands on the same."""
        self.on = np.zeros_like(hidden)
        if self.known:
            self.on = self._alike(seeds, hidden)

    def _seeds(self, photo: Photo, contact: tuple[float, float], hidden: np.ndarray) -> np.ndarray:
        """Return the cells beside and before the foot."""
        x0, _, x1, _ = (edge / self.cell for edge in object_box(photo.mask))
        reach = max(2.0, RIM * (x1 - x0))
        row, column = np.mgrid[: hidden.shape[0], : hidden.shape[1]] + 0.5
        foot = contact[1] / self.cell
        around = (column > x0 - reach) & (column < x1 + reach) & (row > foot - 0.8 * reach) & (row < foot + 1.5 * reach)
        return around & ~hidden

    def _is_narrow(self, photo: Photo, contact: tuple[float, float], hidden: np.ndarray) -> bool:
        """Compare the cells below the contact with those beside them: another colour behind hard edges."""
        x0, _, x1, _ = (edge / self.cell for edge in object_box(photo.mask))
        wide, reach = x1 - x0, max(2.0, RIM * (x1 - x0))
        row, column = np.mgrid[: hidden.shape[0], : hidden.shape[1]] + 0.5
        foot, away = contact[1] / self.cell, np.abs(column - contact[0] / self.cell)
        band = (row > foot) & (row < foot + 1.5 * reach) & ~hidden
        under, beside = band & (away < UNDER * wide), band & (away > BESIDE[0] * wide) & (away < BESIDE[1] * wide)
        if min(under.sum(), beside.sum()) < 4:
            return False
        both = band[:, 1:] & band[:, :-1]
        steps = np.where(both, np.abs(np.diff(self.features, axis=1)).max(axis=-1), 0.0)
        edge, usual = float(np.median(steps.max(axis=1)[both.any(axis=1)])), float(np.median(steps[both]))
        colors = [np.median(self.features[cells], axis=0) for cells in (under, beside)]
        hue = np.abs((colors[0] - colors[0].mean()) - (colors[1] - colors[1].mean())).max()
        return bool(hue >= NARROW_HUE and edge >= max(NARROW_EDGE, NARROW_TIMES * usual))

    def _alike(self, seeds: np.ndarray, hidden: np.ndarray) -> np.ndarray:
        """Return the cells beside the object that have the seeds' colours and brightness."""
        middle = np.median(self.features[seeds], axis=0)
        spread = np.maximum(1.5 * np.median(np.abs(self.features[seeds] - middle), axis=0), LEAST_SPREAD)
        return ((np.abs(self.features - middle) / spread).max(axis=-1) < ALIKE) & ~hidden

    def support(self, x: float, y: float, wide: float) -> float:
        """Return the share of a foot around pixel x, y, this wide, that stands on it; 1 where it is unknown."""
        if not self.known:
            return 1.0
        reach = max(0.5 * wide / self.cell, 1.0)
        row, column = np.mgrid[: self.on.shape[0], : self.on.shape[1]] + 0.5
        across, down = (column - x / self.cell) / reach, (row - y / self.cell) / (0.5 * reach)
        foot = across**2 + down**2 <= 1
        return float(self.on[foot].mean()) if foot.any() else 0.0

"""Expected quality of a found mask, from the network's own probabilities and from a second look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.masks.prompts import Point
from anyprobe.masks.search import GRID, Box, Finding, Prompts, Window

QUALITY = contract("mask")["quality"]
"""Offset and weights of the log-odds of the IoU for each network, fitted by `python -m research.masks.calibrate`."""

DOUBTFUL = QUALITY["doubtful"]
"""Expected IoU below which a mask gets a warning."""

FITS = QUALITY["fits"]
"""Smallest IoU of a given box with the object's at which it fits fully; distance of clicks from the object's middle, in
standard deviations of its cells, at which they fit no more; and the fit where nothing is given."""

REFUSED = QUALITY["refused"]
"""Expected IoU below which a mask is refused."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evidence:
    """Evidence about a mask: the first five numbers are in [0, 1], 1 is good; the others are 0 where all is well.

    Attributes:
        expected: IoU by the network's own probabilities.
        agreed: IoU with the result of a second, mirrored look at the object alone.
        whole: share of all that stood out.
        single: see Finding.single.
        meant: how well it fits clicks and box.
        border: share of the box's sides that lie on the photo's border.
        small: ln of 5 % of the photo over the mask's share, at least 0.
        large: the mask's share above 60 % of the photo, over the remaining 40 %.
    """

    expected: float
    agreed: float
    whole: float
    single: float
    meant: float
    border: float
    small: float
    large: float

    def expected_iou(self, network: str) -> float:
        """Return the expected IoU of a mask found by the network of this name, in [0, 1]."""
        odds = QUALITY[network]["offset"]
        odds += sum(weight * getattr(self, name) for name, weight in QUALITY[network]["weights"].items())
        return float(1.0 / (1.0 + np.exp(-odds)))

    def doubts(self, prompts: Prompts) -> list[str]:
        """Return what looks wrong, a few words each, the most serious first."""
        asked = [name for name, given in (("click", prompts.on), ("box", prompts.box)) if given]
        found = [
            (self.agreed - 0.8, "a second look finds something else"),
            (self.expected - 0.85, "its outline is blurred"),
            (self.whole - 0.7, "other things stand out as well"),
            (self.single - 0.95, "it may contain two objects"),
            (self.meant - 0.6, f"it does not fit the {' or the '.join(asked)}"),
            (0.15 - self.border, "it is cut by the photo's border"),
            (0.9 - self.small, "it is very small"),
            (0.1 - self.large, "it covers nearly the whole photo"),
        ]
        return [words for margin, words in sorted(found) if margin < 0]


def examine(found: Finding, width: int, height: int, prompts: Prompts) -> Evidence:
    """Collect the evidence about a mask found with prompts in a photo of this size."""
    photo = Window(x0=0, y0=0, x1=width, y1=height)
    window = found.window
    share = float(found.part.mean()) * (window.size[0] * window.size[1]) / (width * height)
    return Evidence(
        expected=found.expected(),
        agreed=found.agreed,
        whole=found.whole,
        single=found.single(),
        meant=_fits(found, prompts),
        border=found.border_share(photo, True),
        small=float(np.log(max(0.05 / max(share, 1e-5), 1.0))),
        large=max(share - 0.6, 0.0) / 0.4,
    )


def _fits(found: Finding, prompts: Prompts) -> float:
    fits = [] if prompts.box is None else [_fits_box(found, prompts.box)]
    fits += [_fits_clicks(found, prompts.on)] if prompts.on else []
    return min(fits, default=FITS["unasked"])


def _fits_box(found: Finding, given: Box) -> float:
    own = found.window.box_of(found.part)
    both = _area(max(own[0], given[0]), max(own[1], given[1]), min(own[2], given[2]), min(own[3], given[3]))
    return min(1.0, both / (_area(*own) + _area(*given) - both) / FITS["box_iou"])


def _area(x0: float, y0: float, x1: float, y1: float) -> float:
    return max(x1 - x0, 0.0) * max(y1 - y0, 0.0)


def _fits_clicks(found: Finding, clicks: Sequence[Point]) -> float:
    """Return how central the clicks are, in [0, 1]; a click is rarely in the middle of two merged objects."""
    rows, columns = np.nonzero(found.part)
    x, y = np.mean(clicks, axis=0)
    across = ((x - found.window.x0) * GRID / found.window.size[0] - 0.5 - columns.mean()) / max(columns.std(), 1.0)
    down = ((y - found.window.y0) * GRID / found.window.size[1] - 0.5 - rows.mean()) / max(rows.std(), 1.0)
    return max(0.0, 1.0 - float(np.hypot(across, down)) / FITS["click_reach"])

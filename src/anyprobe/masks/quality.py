"""Expected quality of a found mask, from the network's own probabilities and from a second look."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.masks.prompts import Point
from anyprobe.masks.search import GRID, Box, Finding, Prompts

QUALITY = contract("mask")["quality"]
"""Offset and weights of the log-odds of the IoU for each network, fitted by `python -m research.masks.calibrate`, and
the usual evidence about a good mask."""

DOUBTFUL = QUALITY["doubtful"]
"""Expected IoU below which a mask gets a warning."""

FITS = QUALITY["fits"]
"""Smallest IoU of a given box with the object's at which it fits fully; distance of clicks from the object's middle, in
standard deviations of its cells, at which they fit no more; and the fit where nothing is given."""

REFUSED = QUALITY["refused"]
"""Expected IoU below which a mask is refused."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evidence:
    """Evidence about a mask, each in [0, 1]; 1 is good, but of cut 0.

    Attributes:
        expected: IoU by the network's own probabilities.
        agreed: IoU with the result of a second, mirrored look at the object alone.
        whole: share of all that stood out.
        meant: how well it fits clicks and box.
        cut: see Finding.cut.
    """

    expected: float
    agreed: float
    whole: float
    meant: float
    cut: float

    def expected_iou(self, network: str) -> float:
        """Return the expected IoU of a mask found by the network of this name, in [0, 1]."""
        odds = QUALITY[network]["offset"]
        odds += sum(weight * getattr(self, name) for name, weight in QUALITY[network]["weights"].items())
        return float(1.0 / (1.0 + np.exp(-odds)))

    def doubt(self, network: str, prompts: Prompts) -> str:
        """Return in a few words what lowers the expected IoU most, beside a good mask's evidence."""
        asked = [name for name, given in (("click", prompts.on), ("box", prompts.box)) if given]
        words = {
            "expected": "its outline is blurred",
            "agreed": "a second look finds something else",
            "whole": "other things stand out as well",
            "meant": f"it does not fit the {' or the '.join(asked)}" if asked else "it may not be what is meant",
            "cut": "the box cuts it off, and should be around all of it",
        }
        weights, usual = QUALITY[network]["weights"], QUALITY["usual"]
        return words[max(weights, key=lambda name: weights[name] * (usual[name] - getattr(self, name)))]


def examine(found: Finding, prompts: Prompts) -> Evidence:
    """Collect the evidence about a mask found with prompts."""
    return Evidence(
        expected=found.expected(), agreed=found.agreed, whole=found.whole, meant=_fits(found, prompts), cut=found.cut
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

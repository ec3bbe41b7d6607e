"""Expected quality of a found mask, from the network's own probabilities and from a second look.

The same in web/src/photo/quality.js.
"""

from __future__ import annotations

import math

from anyprobe.core.contract import contract
from anyprobe.masks.search import Finding

QUALITY = contract("mask")["quality"]

DOUBTFUL = QUALITY["doubtful"]
"""Expected IoU below which a mask gets a warning, chosen by `python -m research.masks.calibrate`."""

CUT = QUALITY["cut"]
"""How much Finding.cut lowers the expected IoU, chosen by the same."""

REFUSED = QUALITY["refused"]
"""Expected IoU below which a mask is refused."""


def reasons(found: Finding) -> dict[str, float]:
    """Return the factors of a finding's expected IoU, each in [0, 1], by what a low one means in a few words."""
    return {
        "its outline is blurred": found.expected(),
        "a second look finds something else": (1 + found.agreed) / 2,
        "the box cuts it off, and should be around all of it": 1 / (1 + CUT * found.cut),
    }


def expected_iou(found: Finding) -> float:
    """Return the expected IoU of a finding, in [0, 1]."""
    return math.prod(reasons(found).values())


def doubt(found: Finding) -> str:
    """Return in a few words what lowers the expected IoU most."""
    factors = reasons(found)
    return min(factors, key=lambda reason: factors[reason])

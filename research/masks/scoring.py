"""One photo's mask by one prompt, scored; and what many of them come to."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from anyprobe.errors import InvalidMask
from anyprobe.masks.find import find_mask
from anyprobe.masks.networks import Network
from anyprobe.pictures.images import read_image
from research.masks.cases import Case, iou

PROMPTS = ("auto", "click", "box")

BAD, GOOD = 0.5, 0.85
"""IoU below which a mask must come with a warning, and above which it should not."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """IoU of one mask; expected: the IoU that it comes with; warning: its own, or why there is no mask."""

    name: str
    group: str
    segmenter: str
    prompt: str
    iou: float
    expected: float | None
    warning: str
    mask: np.ndarray | None

    def as_dict(self) -> dict[str, Any]:
        """Without the mask."""
        return {name: value for name, value in asdict(self).items() if name != "mask"}


def score(case: Case, prompt: str, name: str, segmenter: Network | None) -> Row:
    """Find the object of a case by one of PROMPTS; a box that is the whole photo counts as no prompt."""
    given = {"auto": {}, "click": {"click": case.click}, "box": {} if case.box_is_whole else {"box": case.box}}[prompt]
    common = {"name": case.name, "group": case.group, "segmenter": name, "prompt": prompt}
    try:
        found = find_mask(read_image(case.rgb), segmenter=segmenter, **given)
    except InvalidMask as error:
        return Row(**common, iou=0.0, expected=None, warning=str(error), mask=None)
    warning = found.warnings[0] if found.warnings else ""
    return Row(**common, iou=iou(found.mask, case.mask), expected=found.confidence, warning=warning, mask=found.mask)


def figures(rows: list[Row]) -> str:
    """Mean and median IoU, over objects: the photos of one are averaged first."""
    groups: dict[str, list[float]] = {}
    for row in rows:
        groups.setdefault(row.group, []).append(row.iou)
    values = np.array([np.mean(one) for one in groups.values()])
    bad = f"under {BAD} {int((values < BAD).sum())} of {len(values)}"
    return f"mean {values.mean():.3f}, median {np.median(values):.3f}, {bad}"


def warned(rows: list[Row]) -> str:
    """How many bad and how many good masks come with a warning."""
    bad = [bool(row.warning) for row in rows if row.iou < BAD]
    good = [bool(row.warning) for row in rows if row.iou > GOOD]
    return f"warned of {sum(bad)} of {len(bad)} bad, {sum(good)} of {len(good)} good"

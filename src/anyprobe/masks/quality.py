"""How good a found mask is: what the network expects of it, whether other ways to ask give the same object, and whether
what lies beside it looks like it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.masks.cut import Cut, color_odds
from anyprobe.masks.prompts import Point
from anyprobe.masks.propose import MaskNetwork, Proposal, object_window
from anyprobe.masks.refine import box_mean, resize
from anyprobe.masks.regions import grow

DOUBTFUL = 0.81
"""Expected IoU below which a mask comes with a warning."""

REFUSED = 0.05
"""Expected IoU below which there is no mask."""

OFFSET = -10.61
WEIGHTS = {
    "expected": 3.54,
    "mirrored": 2.57,
    "darker": 0.63,
    "kept": 2.35,
    "told_apart": 2.53,
    "apart": 1.87,
    "edge": 0.73,
}
"""Of the log-odds of the IoU, by `python -m research.masks.calibrate --scenes 160`; the rest of Evidence explains."""

DARKER = 1.8
"""Power of the display values of the photo that is asked about again, exposed less."""

BESIDE, FAR_PX = (2, 6), 7
"""What counts as just outside a mask, from and to, and as surroundings, in pixels of WORK_PX."""
LOOK_PX = 2048
"""Longer side of the photo that is asked about again: several copies of a larger one would take too much memory."""

WORK_PX = 160
"""Longer side at which edges and what lies on their sides are compared."""

LEAST_PX = 20
"""Of WORK_PX that colours are compared on."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evidence:
    """What speaks for a mask, each from 0 to 1 where 1 is good, and what makes masks doubtful.

    expected: IoU by the network's own probabilities; mirrored, darker: IoU with what it finds in the mirrored photo,
    and in the photo exposed less; kept: IoU of the rough mask and the one cut out of it; one_part: share of what was
    found that is in one part; told_apart: by colour; apart: how likely by its colours what lies just outside is
    surroundings and not object; edge: share of the outline where the photo has an edge; border: share of the outline
    on the photo's border; small: ln of how many times less than 5 % of the photo the mask covers; large: how much more
    than 60 % of it.
    """

    expected: float
    mirrored: float
    darker: float
    kept: float
    one_part: float
    told_apart: float
    apart: float
    edge: float
    border: float
    small: float
    large: float

    def expected_iou(self) -> float:
        """The IoU to expect, in [0, 1], by WEIGHTS."""
        odds = OFFSET + sum(weight * getattr(self, name) for name, weight in WEIGHTS.items())
        return float(1.0 / (1.0 + np.exp(-odds)))

    def doubts(self) -> list[str]:
        """What looks wrong, in a few words each, the gravest first."""
        found = [
            (min(self.mirrored, self.darker) - 0.6, "asked in another way, the network finds something else"),
            (self.apart - 0.75, "what lies beside it has the same colours"),
            (self.edge - 0.45, "its outline does not follow the photo's edges"),
            (self.one_part - 0.8, "it falls into several parts"),
            (0.15 - self.border, "it is cut by the photo's border"),
            (0.9 - self.small, "it is very small"),
            (0.1 - self.large, "it covers nearly the whole photo"),
            (self.kept - 0.7, "the photo's colours contradict the network"),
        ]
        return [words for margin, words in sorted(found) if margin < 0]


def examine(
    network: MaskNetwork,
    rgb: np.ndarray,
    proposal: Proposal,
    cut: Cut,
    on: Sequence[Point] = (),
    off: Sequence[Point] = (),
    box: Sequence[float] | None = None,
) -> Evidence:
    """Ask again in other ways, and look at the mask itself.

    Args:
        rgb: [H, W, 3] display values in [0, 1]. proposal: the rough mask; cut: what was cut out there.
        on, off, box: the prompts that gave it, in pixels.
    """
    scale = min(1.0, LOOK_PX / max(rgb.shape[:2]))
    if scale < 1.0:
        size = [round(length * scale) for length in rgb.shape[1::-1]]
        rgb, cut = resize(rgb, *size), replace(cut, mask=resize(cut.mask, *size))
        on, off = ([(x * scale, y * scale) for x, y in points] for points in (on, off))
        box = None if box is None else [side * scale for side in box]
    height, width = rgb.shape[:2]
    inside = cut.mask > 0.5
    rough = resize(proposal.cover, width, height) > 0.5
    flipped = network.propose(
        np.ascontiguousarray(rgb[:, ::-1]),
        [(width - x, y) for x, y in on],
        [(width - x, y) for x, y in off],
        None if box is None else (width - box[2], box[1], width - box[0], box[3]),
    )
    darker = network.propose(rgb**DARKER, on, off, box)
    share = float(inside.mean())
    edge, border = _outline(rgb, cut.mask)
    return Evidence(
        expected=proposal.confidence,
        mirrored=_iou(resize(flipped.cover[:, ::-1], width, height) > 0.5, inside),
        darker=_iou(resize(darker.cover, width, height) > 0.5, inside),
        kept=_iou(rough, inside),
        one_part=1.0 - cut.loose,
        told_apart=cut.told_apart,
        apart=_apart(rgb, cut.mask),
        edge=edge,
        border=border,
        small=float(np.log(max(0.05 / max(share, 1e-5), 1.0))),
        large=max(share - 0.6, 0.0) / 0.4,
    )


def _iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))


def _around(rgb: np.ndarray, mask: np.ndarray, more: float) -> tuple[np.ndarray, np.ndarray]:
    """Photo [h, w, 3] and mask [h, w] bool around the object, with more of its longer side, at most WORK_PX across."""
    height, width = mask.shape
    x, y, w, h = object_window(mask, width, height)
    more *= max(w, h)
    rows = slice(max(0, int(y - more)), min(height, int(y + h + more) + 1))
    columns = slice(max(0, int(x - more)), min(width, int(x + w + more) + 1))
    scale = min(1.0, WORK_PX / max(rows.stop - rows.start, columns.stop - columns.start))
    size = (max(4, round((columns.stop - columns.start) * scale)), max(4, round((rows.stop - rows.start) * scale)))
    return resize(rgb[rows, columns], *size), resize(mask[rows, columns], *size) > 0.5


def _apart(rgb: np.ndarray, mask: np.ndarray) -> float:
    """Mean probability, by colour alone, that what lies just outside a mask is surroundings and not object.

    A part of an object, and a mask that ran over into its surroundings, have their own colours beside them.
    """
    picture, inside = _around(rgb, mask, 0.35)
    grown = [inside]
    for _ in range(FAR_PX):
        grown.append(grow(grown[-1]))
    beside, far = grown[BESIDE[1]] & ~grown[BESIDE[0]], ~grown[FAR_PX]
    core = ~grow(grow(~inside))
    far = far if far.sum() >= LEAST_PX else ~grown[BESIDE[0]]
    if min(core.sum(), far.sum(), beside.sum()) < LEAST_PX:
        return 0.5
    odds = color_odds(picture.reshape(-1, 3).astype(np.float64), core.ravel() * 1.0, far.ravel() * 1.0)
    return float((1 / (1 + np.exp(np.clip(odds, -30, 30))))[beside.ravel()].mean())


def _outline(rgb: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Share of the outline where the photo changes more than it mostly does nearby, and share on the border."""
    picture, inside = _around(rgb, mask, 0.25)
    steps = [np.gradient(picture, axis=axis) for axis in (0, 1)]
    change = np.sqrt(sum((step**2).sum(axis=-1) for step in steps))
    share = box_mean(inside[..., None].astype(np.float32), 1)[..., 0]
    outline = (share > 0.01) & (share < 0.99)
    band = box_mean(outline[..., None].astype(np.float32), 5)[..., 0] > 0
    usual = np.median(change[band]) if band.any() else 0.0
    sharpest = box_mean(change[..., None], 1)[..., 0]
    edge = float((sharpest[outline] > 1.3 * usual).mean()) if outline.any() else 0.0
    _, _, w, h = object_window(mask, *mask.shape[::-1])
    at_border = mask[0].sum() + mask[-1].sum() + mask[:, 0].sum() + mask[:, -1].sum()
    return edge, float(min(1.0, at_border / max(2.0 * (w + h), 1.0)))

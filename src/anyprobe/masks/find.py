"""Search for the object of a photo, using any hints about it, and the expected quality of what is found.

That follows from the network's own probabilities and from the outline; the same in web/src/photo/quality.js.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.errors import InvalidMask
from anyprobe.masks.check import alpha_doubts, check_mask, look_at_given
from anyprobe.masks.depth import DepthSource, mask_from_depth
from anyprobe.masks.networks import Network, NetworkSource, load_network, shared_network
from anyprobe.masks.prompts import Clicks, check_box, check_clicks
from anyprobe.masks.search import Finding, Looks, Prompts, find_object
from anyprobe.masks.sources import MaskSource, mask_from_alpha, mask_from_file, mask_from_function
from anyprobe.notices import Notice, as_notice, give
from anyprobe.pictures.images import Pixels

RIGHT = "looks right"

DOUBTFUL, REFUSED, CUT = (contract("mask")["quality"][name] for name in ("doubtful", "refused", "cut"))
"""Expected IoU below which a mask gets a warning, and is refused; and how much Finding.cut lowers it: `mask`, `quality`
of contract.json. The first and last are chosen by `python -m research.masks.calibrate`."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FoundMask:
    """An object's mask.

    Attributes:
        mask: [H, W] float32 in [0, 1], 1 on the object.
        source: "mask", "function", "depth", "click", "box", "alpha" or "network".
        confidence: expected IoU, see expected_iou; None where the mask was given.
        verdict: whether the mask looks right, in words; empty where it was given.
        warnings: one line for each reason to check the mask.
        prompts: clicks and box, as checked.
    """

    mask: np.ndarray
    source: str
    confidence: float | None = None
    verdict: str = ""
    warnings: tuple[str, ...] = ()
    prompts: Prompts = Prompts()


def find_mask(
    pixels: Pixels,
    *,
    mask: MaskSource | None = None,
    depth: DepthSource | None = None,
    near: float | None = None,
    far: float | None = None,
    click: Clicks | None = None,
    exclude: Clicks | None = None,
    box: Sequence[float] | None = None,
    segmenter: NetworkSource | None = None,
) -> FoundMask:
    """Return the object's mask from the first given of mask, depth range, prompts, alpha; else what stands out.

    Args:
        mask, click, exclude, box, depth, near, far: see hints.Hints.
        segmenter: a name of load_network, or a Network; None: U2-Net-p if its weights are installed (masks.weights),
            else the small network that ships.
    Raises:
        InvalidMask: hints are invalid, or nothing is found.
    """
    shape = pixels.rgb.shape[:2]
    if callable(mask):
        return _given(mask_from_function(mask, pixels.rgb), "function", pixels.name)
    if mask is not None:
        return _given(mask_from_file(mask, shape), "mask", pixels.name)
    if depth is not None:
        return _given(mask_from_depth(depth, shape, near, far), "depth", pixels.name)
    height, width = shape
    prompts = Prompts(
        on=check_clicks(() if click is None else click, width, height),
        off=check_clicks(() if exclude is None else exclude, width, height, "exclude"),
        box=None if box is None else check_box(box, width, height),
    )
    source = source_of(prompts)
    if source == "network":
        if (alpha := mask_from_alpha(pixels.alpha, pixels.name)) is not None:
            cut_out, doubts = _given(alpha, "alpha", pixels.name), alpha_doubts(alpha)
            return replace(cut_out, warnings=(*cut_out.warnings, *(as_notice(doubt, pixels.name) for doubt in doubts)))
    loaded = load_network(segmenter) if isinstance(segmenter, str) else segmenter
    network = shared_network() if loaded is None else loaded
    if (found := find_object(Looks(network, pixels.rgb), prompts)) is None:
        raise _not_found(pixels, prompts)
    return _judged(pixels, prompts, found, network, source)


def source_of(prompts: Prompts) -> str:
    """Return FoundMask.source of these prompts."""
    clicked = prompts.on or (prompts.off and prompts.box is None)
    return "click" if clicked else "network" if prompts.box is None else "box"


def _given(mask: np.ndarray, source: str, name: str) -> FoundMask:
    mask, warnings = look_at_given(mask)
    return FoundMask(mask=mask, source=source, warnings=tuple(as_notice(line, name) for line in warnings))


def _judged(pixels: Pixels, prompts: Prompts, found: Finding, network: Network, source: str) -> FoundMask:
    """Judge a found mask and return it with its expected IoU; InvalidMask where that is below REFUSED."""
    confidence, mask = expected_iou(found), found.mask(*pixels.rgb.shape[1::-1])
    if confidence < REFUSED or not (mask > 0.5).any():
        raise _not_found(pixels, prompts)
    judgement = RIGHT if confidence >= DOUBTFUL else f"may be wrong: {doubt(found)}"
    warnings = []
    if judgement != RIGHT:
        remedy = give("box", "click", "exclude", "mask")
        text = f"the mask {judgement}; check it"
        warnings.append(Notice(text, code="mask-doubtful", source=pixels.name, remedy=remedy))
    for x, y in prompts.on:
        if mask[int(y), int(x)] <= 0.5:
            text = f"the mask does not hold the click at {x:.0f},{y:.0f}; remove it, or mark the object with a box"
            warnings.append(Notice(text, code="mask-doubtful", source=pixels.name))
    if network.warning:
        warnings.append(as_notice(network.warning, pixels.name))
    return FoundMask(
        mask=check_mask(mask, pixels.name),
        source=source,
        confidence=confidence,
        verdict=judgement,
        warnings=tuple(warnings),
        prompts=prompts,
    )


def _not_found(pixels: Pixels, prompts: Prompts) -> InvalidMask:
    name, source = pixels.name, source_of(prompts)
    height, width = pixels.rgb.shape[:2]
    if source == "network":
        text = "expected an object distinct from its surroundings, or an alpha channel, but nothing stands out"
        return InvalidMask(text, code="no-object", source=name, remedy=give("click", "box", "mask"))
    place = f"at the {source}" if prompts.on or prompts.box is not None else "away from the excluded points"
    return InvalidMask(
        f"expected an object {place} in {width} x {height} pixels, found none that stands out; click elsewhere on it",
        code="no-object",
        source=name,
        remedy=give("box", "mask"),
    )


def reasons(found: Finding) -> dict[str, float]:
    """Return the factors of a finding's expected IoU, each in [0, 1], by what a low one means in a few words.

    expected, cut and flat are those of search.Finding.
    """
    return {
        "its outline is blurred": found.expected() ** 2,
        "the box cuts it off, and should be around all of it": 1 / (1 + CUT * found.cut),
        "the picture hardly changes across its outline": 1 / (1 + found.flat),
    }


def expected_iou(found: Finding) -> float:
    """Return the expected IoU of a finding, in [0, 1]."""
    return math.prod(reasons(found).values())


def doubt(found: Finding) -> str:
    """Return in a few words what lowers the expected IoU most."""
    factors = reasons(found)
    return min(factors, key=lambda reason: factors[reason])

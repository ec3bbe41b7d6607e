"""Where the object of a photo is, from whatever was told about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from anyprobe.masks.prompts import Point
from anyprobe.errors import InvalidMask, MissingExtra
from anyprobe.files.images import Pixels
from anyprobe.masks.check import check_mask
from anyprobe.masks.depth import DepthSource, mask_from_depth
from anyprobe.masks.grabcut import cut_seeded, mask_from_box
from anyprobe.masks.pointing import Clicks, check_box, check_clicks
from anyprobe.masks.propose import shared_network
from anyprobe.masks.refine import refine
from anyprobe.masks.sources import MaskSource, mask_from_alpha, mask_from_file, mask_from_function

UNSURE = 0.55
"""Expected IoU below which a proposal that nobody asked for is refused."""


class Where(TypedDict, total=False):
    """What can be told about the object, all of it optional.

    mask: picture of the photo's size, white on the object (path, bytes, Pillow image, array);
        or a function that gets the upright photo [H, W, 3] uint8 and returns its mask [H, W].
    depth: depth image of the same view; near, far: the cut, in its unit (see mask_from_depth).
    click: x, y on the object, or several; click_off: likewise beside it.
    box: x0, y0, x1, y1 around it. Pixels of the upright photo, from the top left.
    """

    mask: MaskSource | None
    depth: DepthSource | None
    near: float | None
    far: float | None
    click: Clicks | None
    click_off: Clicks | None
    box: Sequence[float] | None


@dataclass(frozen=True, kw_only=True, slots=True)
class FoundMask:
    """mask [H, W] float32 in [0, 1], 1 on the object; source: "mask", "function", "depth", "click", "box",
    "alpha" or "network"; confidence: the IoU that the network expects, None where it was not asked."""

    mask: np.ndarray
    source: str
    confidence: float | None = None


def find_mask(
    pixels: Pixels,
    *,
    mask: MaskSource | None = None,
    depth: DepthSource | None = None,
    near: float | None = None,
    far: float | None = None,
    click: Clicks | None = None,
    click_off: Clicks | None = None,
    box: Sequence[float] | None = None,
) -> FoundMask:
    """The object's mask: by the first told of mask, depth, click or box, alpha that cuts; else the network's proposal.

    Args: see Where.

    Raises:
        InvalidMask: with one line that says what to do; also when nothing was told and the
            network finds nothing, or is unsure.
    """
    shape = pixels.rgb.shape[:2]
    if callable(mask):
        return FoundMask(mask=mask_from_function(mask, pixels.rgb), source="function")
    if mask is not None:
        return FoundMask(mask=mask_from_file(mask, shape), source="mask")
    if depth is not None:
        return FoundMask(mask=mask_from_depth(depth, shape, near, far), source="depth")
    if near is not None or far is not None:
        raise InvalidMask("near, far: expected a depth image to cut, got none; pass --depth FILE too")
    if click is not None or click_off is not None or box is not None:
        return _pointed_at(pixels, click, click_off, box)
    cut_out = mask_from_alpha(pixels.alpha)
    return _proposed(pixels) if cut_out is None else FoundMask(mask=cut_out, source="alpha")


def _pointed_at(pixels: Pixels, click, click_off, box) -> FoundMask:
    height, width = pixels.rgb.shape[:2]
    on = check_clicks(() if click is None else click, width, height)
    off = check_clicks(() if click_off is None else click_off, width, height, "click beside")
    corners = None if box is None else check_box(box, width, height)
    if corners is not None and not on and not off:
        return FoundMask(mask=mask_from_box(pixels.rgb, corners), source="box")
    source = "click" if on or box is None else "box"
    proposal = shared_network().propose(pixels.rgb, on, off, corners)
    found = _cut_out(pixels.rgb, proposal.cover, on, off)
    if found is None:
        shown = f"the {source}" if on or box is not None else "the clicks beside it"
        raise InvalidMask(
            f"{pixels.name}: expected an object at {shown}, found none that stands out; "
            "click elsewhere on it, draw --box X0,Y0,X1,Y1, or pass --mask FILE"
        )
    return FoundMask(mask=check_mask(found), source=source, confidence=proposal.confidence)


def _proposed(pixels: Pixels) -> FoundMask:
    proposal = shared_network().propose(pixels.rgb)
    found = _cut_out(pixels.rgb, proposal.cover)
    if found is None or proposal.confidence < UNSURE:
        seen = (
            "nothing stands out"
            if found is None
            else f"the network is unsure ({proposal.confidence:.2f}, {UNSURE} needed)"
        )
        raise InvalidMask(
            f"{pixels.name}: expected an object that can be told from its surroundings, but {seen}; "
            "pass --click X,Y, --box X0,Y0,X1,Y1 or --mask FILE, or a photo with an alpha channel"
        )
    return FoundMask(mask=check_mask(found), source="network", confidence=proposal.confidence)


def _cut_out(
    rgb: np.ndarray, cover: np.ndarray, on: Sequence[Point] = (), off: Sequence[Point] = ()
) -> np.ndarray | None:
    """The proposal cut out by GrabCut, or by the guided filter without OpenCV; None where nothing is."""
    if not on and not (cover > 0.5).any():
        return None
    try:
        found = cut_seeded(rgb, cover, on, off)
    except MissingExtra:
        found = refine(rgb, cover)
    return found if found is not None and (found > 0.5).any() else None

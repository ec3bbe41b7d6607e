"""Where the object of a photo is, from whatever is given about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.errors import InvalidMask
from anyprobe.files.images import Pixels
from anyprobe.masks.check import check_mask
from anyprobe.masks.cut import cut_out, tidy
from anyprobe.masks.depth import DepthSource, mask_from_depth
from anyprobe.masks.prompts import Clicks, Point, check_box, check_clicks
from anyprobe.masks.propose import MaskNetwork, Proposal, as_proposal, object_window, shared_network
from anyprobe.masks.quality import DOUBTFUL, REFUSED, examine
from anyprobe.masks.segmenters import Segmenter, load_segmenter
from anyprobe.masks.sources import MaskSource, mask_from_alpha, mask_from_file, mask_from_function


@dataclass(frozen=True, kw_only=True, slots=True)
class FoundMask:
    """mask [H, W] float32 in [0, 1], 1 on the object; source: "mask", "function", "depth", "click", "box",
    "alpha", "network" or "segmenter"; confidence: the IoU to expect, see quality; None where the mask was given;
    warnings: one line each, where the mask may well be wrong."""

    mask: np.ndarray
    source: str
    confidence: float | None = None
    warnings: tuple[str, ...] = ()


def require_plausible(found: FoundMask) -> FoundMask:
    """The mask as it came, or InvalidMask where it comes with a warning: for `--strict`."""
    if found.warnings:
        raise InvalidMask(found.warnings[0])
    return found


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
    segmenter: str | Segmenter | None = None,
) -> FoundMask:
    """The object's mask: by the first given of mask, depth, click or box, alpha that cuts; else by what stands out.

    Args:
        mask, click, exclude, box, depth, near, far: as hints.Hints has them.
        segmenter: what finds it in the place of our network: a name of load_segmenter, or a Segmenter.
    Raises:
        InvalidMask: with one line that says what to do; also when nothing is found.
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
    prompts = _Prompts.checked(click, exclude, box, *shape[::-1])
    if prompts.source == "network":
        alpha = mask_from_alpha(pixels.alpha)
        if alpha is not None:
            return FoundMask(mask=alpha, source="alpha")
    return _found(pixels, prompts, load_segmenter(segmenter) if isinstance(segmenter, str) else segmenter)


@dataclass(frozen=True, kw_only=True, slots=True)
class _Prompts:
    """Clicks on the object and beside it, and a box, checked; source: what FoundMask calls them."""

    on: list[Point]
    off: list[Point]
    box: tuple[float, float, float, float] | None
    source: str

    @classmethod
    def checked(cls, click, exclude, box, width: int, height: int) -> _Prompts:
        on = check_clicks(() if click is None else click, width, height)
        off = check_clicks(() if exclude is None else exclude, width, height, "click beside")
        corners = None if box is None else check_box(box, width, height)
        source = "click" if on or (off and box is None) else "network" if box is None else "box"
        return cls(on=on, off=off, box=corners, source=source)

    def clicks(self) -> tuple[list[Point], list[Point], tuple[float, float, float, float] | None]:
        return self.on, self.off, self.box


def _found(pixels: Pixels, prompts: _Prompts, segmenter: Segmenter | None) -> FoundMask:
    network = shared_network()
    if segmenter is None:
        candidates = [
            (proposal, cut_out(pixels.rgb, proposal.cover, *prompts.clicks()))
            for proposal in _proposals(network, pixels.rgb, prompts)
        ]
    else:
        proposal = _segmented(pixels.rgb, prompts, segmenter)
        candidates = [(proposal, tidy(pixels.rgb, proposal.cover))]
    judged = [
        (examine(network, pixels.rgb, proposal, cut, *prompts.clicks()), cut)
        for proposal, cut in candidates
        if cut is not None and (cut.mask > 0.5).any()
    ]
    if not judged:
        raise InvalidMask(_nothing(pixels.name, prompts))
    evidence, cut = max(judged, key=lambda one: one[0].expected_iou())
    mask, confidence = check_mask(cut.mask), evidence.expected_iou()
    if confidence < REFUSED:
        raise InvalidMask(_nothing(pixels.name, prompts))
    source = "segmenter" if segmenter is not None and prompts.source == "network" else prompts.source
    warnings = () if confidence >= DOUBTFUL else (_doubt(pixels.name, confidence, evidence.doubts()),)
    return FoundMask(mask=mask, source=source, confidence=confidence, warnings=warnings)


def _proposals(network: MaskNetwork, rgb: np.ndarray, prompts: _Prompts) -> list[Proposal]:
    """What the network finds by the prompts; and, as a click alone often gets a part, what it finds without them, where
    the clicks agree with that."""
    found = [network.propose(rgb, *prompts.clicks())]
    if prompts.on and prompts.box is None:
        plain = network.propose(rgb)
        down, across = (there / here for there, here in zip(plain.cover.shape, rgb.shape[:2], strict=True))

        def covered(point: Point) -> bool:
            return plain.cover[int(point[1] * down), int(point[0] * across)] > 0.5

        if all(map(covered, prompts.on)) and not any(map(covered, prompts.off)):
            found.append(plain)
    return found


def _segmented(rgb: np.ndarray, prompts: _Prompts, segmenter: Segmenter) -> Proposal:
    """What another segmenter finds, with our network's box where it needs a prompt and there is none."""
    on, off, box = prompts.clicks()
    if segmenter.needs_prompt and not on and box is None:
        window = object_window(shared_network().propose(rgb, on, off).cover, rgb.shape[1], rgb.shape[0])
        box = None if window is None else (window[0], window[1], window[0] + window[2], window[1] + window[3])
        if box is None:
            return Proposal(cover=np.zeros(rgb.shape[:2], np.float32), confidence=0.0)
    cover = np.asarray(segmenter.segment(to_bytes(rgb), on, off, box), np.float32)
    if cover.shape != rgb.shape[:2] or not np.isfinite(cover).all():
        raise InvalidMask(
            f"segmenter: expected a cover [{rgb.shape[0]}, {rgb.shape[1]}] in 0 to 1, got shape {cover.shape} "
            "or NaN; report it to the plug-in's author"
        )
    return as_proposal(np.clip(cover, 0.0, 1.0))


def _nothing(name: str, prompts: _Prompts) -> str:
    if prompts.source == "network":
        return (
            f"{name}: expected an object that can be told from its surroundings, but nothing stands out; "
            "pass --click X,Y, --box X0,Y0,X1,Y1 or --mask FILE, or a photo with an alpha channel"
        )
    shown = f"the {prompts.source}" if prompts.on or prompts.box is not None else "the clicks beside it"
    return (
        f"{name}: expected an object at {shown}, found none that stands out; "
        "click elsewhere on it, draw --box X0,Y0,X1,Y1, or pass --mask FILE"
    )


def _doubt(name: str, confidence: float, doubts: list[str]) -> str:
    because = f": {doubts[0]}" if doubts else ""
    return (
        f"{name}: the mask may be wrong (expected IoU {confidence:.2f}{because}); look at it, then pass "
        "--box X0,Y0,X1,Y1 around the object, --click X,Y on it, --exclude X,Y beside it, or --mask FILE"
    )

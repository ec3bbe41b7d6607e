"""Checks of masks: [H, W] in [0, 1], white on an object that is large enough."""

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.errors import InvalidMask
from anyprobe.masks.parts import keep_object
from anyprobe.notices import Notice, give

MIN_OBJECT_PX = contract("mask")["least_object_px"]
"""Smallest longer side of the object's bounding box [px]."""

IN_OBJECT: float = contract("mask")["inside"]
"""Largest value of a mask's pixel that is not the object's."""

MASK_BLACK, MASK_WHITE = contract("mask")["black"], contract("mask")["white"]
"""Largest brightness of a mask's pixel that counts as 0, and smallest that counts as 1."""


def check_mask(mask: np.ndarray, found_in: str = "") -> np.ndarray:
    """Convert a mask [H, W] to float32 and check it; InvalidMask if it is empty, too small, or not in [0, 1].

    found_in: name of the photo that it was found in; "": it was given.
    """
    mask = np.asarray(mask, dtype=np.float32)
    if mask.ndim != 2 or not mask.size:
        raise InvalidMask(f"expected an array [height, width], got shape {mask.shape}; convert it", subject="mask")
    if np.isnan(mask).any():
        raise InvalidMask("expected values from 0 to 1, got NaN; replace it by 0", subject="mask")
    if not (mask.min() >= 0.0 and mask.max() <= 1.0):
        text = f"expected values from 0 to 1, got {mask.min():g} to {mask.max():g}; scale them"
        raise InvalidMask(text, subject="mask")
    if not (mask > 0.5).any():
        text = (
            f"expected white on the object, got an empty mask (largest value {mask.max():.2f}); "
            "paint the object white; multiply a file's labels of 0 and 1 by 255"
        )
        if mask.max() > MASK_BLACK:
            text = f"expected values above one half on the object, got none above {mask.max():.2f}; scale them"
        raise InvalidMask(text, code="no-object", subject="mask")
    x0, y0, x1, y1 = object_box(mask)
    if max(x1 - x0, y1 - y0) < MIN_OBJECT_PX:
        text = f"expected an object at least {MIN_OBJECT_PX} pixels across"
        text += f", {'found one of' if found_in else 'got'} {x1 - x0} x {y1 - y0}; use a larger photo or go closer"
        raise InvalidMask(text, code="no-object", subject="" if found_in else "mask", source=found_in)
    return mask


def object_box(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Return the bounding box x0, y0, x1, y1 (exclusive) of mask > 0.5, which must not be empty."""
    inside = mask > 0.5
    columns = np.flatnonzero(inside.any(axis=0))
    rows = np.flatnonzero(inside.any(axis=1))
    return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


_GIVEN = contract("mask")["given"]
FULL: float = _GIVEN["full"]
"""Smallest maximum of a mask that is white somewhere."""

MOSTLY: float = _GIVEN["mostly"]
"""Share of the photo above which a mask covers nearly everything."""

GREY_SHARE: float = _GIVEN["grey_share"]
"""Largest ratio of the pixels that are neither black nor white to those above 0.5."""

FEW_PX: int = _GIVEN["few_px"]
"""Longer side [px] below which an object is small for an estimate: the networks' input has 128 pixels."""


def look_at_given(mask: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return the part of a given mask [H, W] that matters, see masks.parts, and a warning for each oddity.

    A segmenter's overlay, which is translucent on the object too, is scaled to 1 there. An outline is a mask of less
    than OUTLINE of itself with its largest hole filled, gaps closed (parts.keep_object).

    Raises:
        InvalidMask: the part is too small.
    """
    lines: list[str] = []
    brightest = float(mask.max())
    if brightest < FULL:
        text = (
            f"the mask is nowhere white (at most {brightest:.2f}), like a segmenter's overlay; its brightest value is "
            "taken for white: save the mask itself, white on black, to be sure"
        )
        lines.append(Notice(text, code="mask-grey"))
        mask = mask / brightest
    inside = mask > 0.5
    border = np.concatenate([inside[0], inside[-1], inside[:, 0], inside[:, -1]])
    if inside.mean() > MOSTLY and border.mean() > FULL:
        text = (
            f"the mask covers {inside.mean():.0%} of the photo and its borders, as an inverted one does; if so, invert "
            "it: white is the object"
        )
        lines.append(Notice(text, code="mask-inverted"))
    grey = (mask > MASK_BLACK) & (mask < MASK_WHITE)
    if grey.sum() > GREY_SHARE * inside.sum():
        text = "the mask is grey over wide areas; give one that is white on the object and black elsewhere"
        lines.append(Notice(text, code="mask-grey"))
    kept, large, is_outline = keep_object(mask)
    mask = check_mask(kept)
    if large > 1:
        text = (
            f"the mask has {large} large parts; the largest and those close to it are taken for one object: "
            "leave one object white"
        )
        lines.append(Notice(text, code="mask-parts"))
    if is_outline:
        lines.append(Notice("the mask is only an outline; fill it: the whole object is white", code="mask-outline"))
    x0, y0, x1, y1 = object_box(mask)
    if max(x1 - x0, y1 - y0) < FEW_PX:
        text = (
            f"the object is only {x1 - x0} x {y1 - y0} pixels in its mask, too few for a good estimate; use a larger "
            "photo or go closer"
        )
        lines.append(Notice(text, code="object-small"))
    return mask, lines


ALPHA_MOST: float = _GIVEN["alpha_most"]
"""Largest share of the photo that a cut-out usually covers; straightened photos with empty corners exceed it."""


def alpha_doubts(mask: np.ndarray) -> list[str]:
    """Return a warning if a photo's transparency [H, W] marks nearly all of it as the object."""
    share = float((mask > 0.5).mean())
    if share <= ALPHA_MOST:
        return []
    text = f"its transparency marks {share:.0%} of the photo as the object; if it is smaller, mark it"
    return [Notice(text, code="alpha-wide", remedy=give("click", "box", "mask"))]

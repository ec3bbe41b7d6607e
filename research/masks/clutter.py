"""Cluttered photos: the object of one photo pasted beside that of another, touching it or apart.

What is found without a prompt is often the other object, or both as one; what clicks are for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.resample import resample
from anyprobe.masks.check import object_box
from research.masks.cases import Case, deepest_point, make_case

LONG_PX, LEAST_PX = 640, 230
"""Longer side of what is made, and shortest side of the photos that it is made of."""

SIZES, GAPS = (0.6, 1.1), (-0.15, 0.02, 0.15, 0.3)
"""Size of the pasted object in that of the other, and the gap between them in its widths."""

ROOM = 0.9
"""Of the photo's object, by which the photo is widened to either side."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Clutter:
    """The photo with either of its two objects meant."""

    first: Case
    second: Case


def cluttered(photos: Sequence[Case], count: int, seed: int) -> Iterator[Clutter]:
    """Photos of two objects each."""
    rng = np.random.default_rng(seed)
    usable = [case for case in photos if min(case.mask.shape) >= LEAST_PX]
    made = 0
    while made < count:
        one, other = (usable[k] for k in rng.choice(len(usable), 2, replace=False))
        rgb, masks = _pasted(rng, one, other)
        if rgb is None or min((mask > 0.5).sum() for mask in masks[:2]) < 400:
            continue
        first, second = (
            make_case(f"clutter-{seed}-{made}-{k}", rgb, mask, deepest_point(mask), object_box(mask), case.group)
            for k, (mask, case) in enumerate(zip(masks, (one, other), strict=False))
        )
        yield Clutter(
            first=replace(first, others=tuple(masks[1:])), second=replace(second, others=(masks[0], *masks[2:]))
        )
        made += 1


def _pasted(rng: np.random.Generator, one: Case, other: Case):
    """The photo [H, W, 3] and masks [H, W] of both objects and of the first photo's others; None, () where the second
    does not fit."""
    x0, y0, x1, y1 = object_box(one.mask)
    height, width = y1 - y0, x1 - x0
    room = int(ROOM * max(height, width))
    sides = ((0, 0), (room, room))
    rgb = np.pad(one.rgb, (*sides, (0, 0)), mode="symmetric")
    masks = [np.pad(each, sides) for each in (one.mask, *one.others)]
    everything = np.max([one.mask, *one.others], axis=0)
    copies = np.pad(everything, sides, mode="symmetric") * (np.max(masks, axis=0) == 0) > 0.05  # by mirroring
    rgb[copies] = np.broadcast_to(np.median(one.rgb[:, [0, -1]], axis=1, keepdims=True), rgb.shape)[copies]
    left, top, right, bottom = object_box(other.mask)
    scale = rng.uniform(*SIZES) * max(height, width) / max(right - left, bottom - top)
    wide, high = max(8, int((right - left) * scale)), max(8, int((bottom - top) * scale))
    if high >= rgb.shape[0]:
        return None, ()
    gap = int(rng.choice(GAPS) * width)
    x = x1 + room + gap if rng.random() < 0.5 else x0 + room - gap - wide
    x = int(np.clip(x, 0, rgb.shape[1] - wide))
    y = int(np.clip(y1 - high + rng.uniform(-0.1, 0.1) * height, 0, rgb.shape[0] - high))
    cover, colors = np.zeros_like(masks[0]), np.zeros_like(rgb)
    cover[y : y + high, x : x + wide] = resample(other.mask[top:bottom, left:right], (wide, high), smooth=True)
    colors[y : y + high, x : x + wide] = resample(other.rgb[top:bottom, left:right], (wide, high), smooth=True)
    rgb = rgb * (1 - cover[..., None]) + colors * cover[..., None]
    start = max(0, min(x0 + room, x) - width // 2)
    stop = min(rgb.shape[1], max(x1 + room, x + wide) + width // 2)
    seen = [each * (1 - cover) for each in masks]
    rgb, masks = rgb[:, start:stop], [each[:, start:stop] for each in (seen[0], cover, *seen[1:])]
    shrink = min(1.0, LONG_PX / max(rgb.shape[:2]))
    size = [round(length * shrink) for length in rgb.shape[1::-1]]
    return np.clip(resample(rgb, size, smooth=True), 0, 1), [resample(one, size, smooth=True) for one in masks]

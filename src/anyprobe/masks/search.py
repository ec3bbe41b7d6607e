"""Search for the intended object of a photo: a network looks at windows of it, and prompts choose a part.

A look resamples a window to a grid of GRID x GRID cells. The first is at the whole photo, or at the box and a margin;
the second, mirrored, at the part that was found and a margin. Their mean is the mask.
A further search of the same photo looks again only where no look before shows the part. The same is in
web/src/photo/search.js.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.resample import resample
from anyprobe.masks.check import FEW_PX, IN_OBJECT, object_box
from anyprobe.masks.networks import U2NETP, Network
from anyprobe.masks.parts import fill_holes, grow, label_parts
from anyprobe.masks.prompts import Point

NUMBERS = contract("mask")["search"]

GRID: int = U2NETP["size"]

MARGIN = NUMBERS["margin"]
"""Margin of a window around an object, as a share of the longer side of its box."""

WINDOWS = NUMBERS["windows"]
"""Sides of windows around clicks where nothing was found, in longer sides of the photo: for most objects, and for
little ones."""

PART_SHARE = NUMBERS["part_share"]
"""Smallest weight of another part over that of a part with an excluded click: then this part is dropped whole; else
it is cut."""

EDGE_CELLS = NUMBERS["edge_cells"]
"""Width beside a part [cells] in which its soft edge may lie."""

SPLIT = NUMBERS["split"]
"""Settings for cutting a part on a grid half as fine; a step there costs a constant plus the difference in colour."""

BLANK = NUMBERS["blank"]
"""Smallest range of display values of a window that is searched."""

ALIKE = NUMBERS["alike"]
"""Difference of display values [Euclidean] below which the picture hardly changes across an outline."""

Box = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Prompts:
    """Clicks x, y on the object and beside it, and a box x0, y0, x1, y1 around it, in pixels of the photo."""

    on: Sequence[Point] = ()
    off: Sequence[Point] = ()
    box: Box | None = None


class Window(NamedTuple):
    """A window of a photo, in whole pixels."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def size(self) -> tuple[int, int]:
        return self.x1 - self.x0, self.y1 - self.y0

    def around(self, box: Box, margin: float) -> Window:
        """Return the window of a box and a margin, a share of its longer side, clipped to this window."""
        pad = margin * max(box[2] - box[0], box[3] - box[1])
        return Window(
            x0=max(self.x0, int(np.floor(box[0] - pad))),
            y0=max(self.y0, int(np.floor(box[1] - pad))),
            x1=min(self.x1, int(np.ceil(box[2] + pad))),
            y1=min(self.y1, int(np.ceil(box[3] + pad))),
        )

    def square(self, points: Sequence[Point], side: float) -> Window:
        """Return a square window of this side around the middle of points, moved into this window."""
        spans = []
        for axis, (low, high) in enumerate(((self.x0, self.x1), (self.y0, self.y1))):
            middle = sum(point[axis] for point in points) / len(points)
            extent = min(high - low, max(1, round(side)))
            start = int(np.clip(np.floor(middle - extent / 2), low, high - extent))
            spans.append((start, start + extent))
        (x0, x1), (y0, y1) = spans
        return Window(x0=x0, y0=y0, x1=x1, y1=y1)

    def holds(self, box: Box) -> bool:
        """Return whether a box lies in this window."""
        return self.x0 <= box[0] and self.y0 <= box[1] and box[2] <= self.x1 and box[3] <= self.y1

    def shows(self, box: Box) -> bool:
        """Return whether a look at this window shows a box, across as many cells as an estimate wants of pixels."""
        width, height = self.size
        return self.holds(box) and GRID * max((box[2] - box[0]) / width, (box[3] - box[1]) / height) >= FEW_PX

    def cells(self, points: Iterable[Point]) -> list[tuple[int, int]]:
        """Return column and row of the cells of those points that lie inside the window."""
        width, height = self.size
        places = (((x - self.x0) * GRID / width, (y - self.y0) * GRID / height) for x, y in points)
        return [(int(x), int(y)) for x, y in places if 0 <= x < GRID and 0 <= y < GRID]

    def box_of(self, part: np.ndarray) -> Box:
        """Return the box of a part [GRID, GRID], which must not be empty, in pixels of the photo."""
        x0, y0, x1, y1 = object_box(part)
        across, down = (length / GRID for length in self.size)
        return self.x0 + x0 * across, self.y0 + y0 * down, self.x0 + x1 * across, self.y0 + y1 * down

    def inside(self, box: Box) -> np.ndarray:
        """Return which cells [GRID, GRID] have their centres in a box."""
        width, height = self.size
        x = self.x0 + (np.arange(GRID) + 0.5) * width / GRID
        y = self.y0 + (np.arange(GRID) + 0.5) * height / GRID
        return np.outer((y >= box[1]) & (y < box[3]), (x >= box[0]) & (x < box[2]))


@dataclass(frozen=True, kw_only=True, slots=True)
class Finding:
    """An object in a window.

    Attributes:
        cover: [GRID, GRID] in [0, 1], zero on other parts.
        part: [GRID, GRID] bool, the object's cells.
        cut: length of its outline that a given box cuts off from more of it, over the perimeter of its box.
        flat: share of its outline across which the picture hardly changes.
    """

    window: Window
    cover: np.ndarray
    part: np.ndarray
    cut: float = 0.0
    flat: float = 0.0

    def expected(self) -> float:
        """Return the expected IoU of the part if the cover of its cells and of those near it are probabilities."""
        near = grow(self.part, 2 * EDGE_CELLS)
        inside = float(self.cover[self.part].sum())
        return inside / max(float(self.part.sum()) + float(self.cover[near & ~self.part].sum()), 1e-6)

    def is_cut(self, photo: Window) -> bool:
        """Return whether the part touches a side of the window that is not the photo's."""
        sides = zip(object_box(self.part), (0, 0, GRID, GRID), self.window, photo, strict=True)
        return any(cell == last and side != whole for cell, last, side, whole in sides)

    def mask(self, width: int, height: int) -> np.ndarray:
        """Return the mask [height, width] float32 of the whole photo, with the cover's soft edge."""
        soft = np.where(self.part, np.maximum(self.cover, 0.51), np.minimum(self.cover, 0.49))
        soft = np.where(grow(self.part, EDGE_CELLS), soft, 0.0).astype(np.float32)
        canvas, window = np.zeros((height, width), np.float32), self.window
        canvas[window.y0 : window.y1, window.x0 : window.x1] = resample(soft, window.size, smooth=True)
        return canvas


Look = tuple[Window, bool]
"""A window, and whether it is mirrored."""


class Looks:
    """Looks of a network at windows of one photo [H, W, 3] of display values, each taken once."""

    def __init__(self, network: Network, rgb: np.ndarray) -> None:
        self.network, self.rgb = network, rgb
        self.photo = Window(x0=0, y0=0, x1=rgb.shape[1], y1=rgb.shape[0])
        self._kept: dict[tuple[Window, bool, object], np.ndarray] = {}

    def at(self, window: Window, prompts: Prompts, mirrored: bool = False) -> np.ndarray:
        """Return the cover [GRID, GRID] of a window, zero outside the box."""
        cover = self.uncut(window, prompts, mirrored)
        return cover if prompts.box is None else cover * window.inside(prompts.box)

    def uncut(self, window: Window, prompts: Prompts, mirrored: bool = False) -> np.ndarray:
        """Return the cover [GRID, GRID] of a window, outside the box too."""
        asked = (tuple(prompts.on), tuple(prompts.off), prompts.box) if self.network.takes_prompts else ()
        key = (window, mirrored, asked)
        if key not in self._kept:
            self._kept[key] = _run(self.network, self.rgb, window, prompts, mirrored)
        return self._kept[key]

    def known(self) -> list[Look]:
        """Return the looks so far, the nearest first; none of a network that looks otherwise for other prompts."""
        taken = [] if self.network.takes_prompts else [(window, mirrored) for window, mirrored, _ in self._kept]
        return sorted(taken, key=lambda look: math.prod(look[0].size))


def find_object(looks: Looks, prompts: Prompts) -> Finding | None:
    """Find the object of a photo; None where nothing is found."""
    known = looks.known()
    start = looks.photo if prompts.box is None else looks.photo.around(prompts.box, MARGIN)
    cover = looks.at(start, prompts)
    found = choose(start, cover, prompts)
    if found is not None and prompts.box is not None:
        found = replace(found, cut=_cut_off(found, looks.uncut(start, prompts), prompts.box))
    if found is None and prompts.on:
        found = _around_clicks(looks, prompts, known)
    if found is None and prompts.off:
        found = _cut(looks.rgb, start, cover, prompts)
    return None if found is None else look_closer(looks, found, prompts, known)


def _cut_off(found: Finding, cover: np.ndarray, box: Box) -> float:
    """Return Finding.cut of a finding by its window's cover beyond the box too."""
    beyond = (cover > IN_OBJECT) & ~found.window.inside(box)
    x0, y0, x1, y1 = object_box(found.part)
    return float((grow(found.part) & beyond).sum()) / (2 * (x1 - x0 + y1 - y0))


def _run(network: Network, rgb: np.ndarray, window: Window, prompts: Prompts, mirrored: bool) -> np.ndarray:
    """Run the network on a window of a photo: cover [GRID, GRID]."""
    crop = rgb[window.y0 : window.y1, window.x0 : window.x1]
    width, _ = window.size
    mirror = (lambda x: width - x) if mirrored else (lambda x: x)

    def in_window(points: Iterable[Point]) -> list[Point]:
        return [(mirror(x - window.x0), y - window.y0) for x, y in points]

    corners = None
    if prompts.box is not None:
        (x0, y0), (x1, y1) = in_window((prompts.box[:2], prompts.box[2:]))
        corners = (min(x0, x1), y0, max(x0, x1), y1)
    if float(np.ptp(crop)) < BLANK:
        return np.zeros((GRID, GRID), np.float32)
    shown = np.ascontiguousarray(crop[:, ::-1]) if mirrored else crop
    cover = network.cover(shown, in_window(prompts.on), in_window(prompts.off), corners)
    return resample(cover[:, ::-1] if mirrored else cover, (GRID, GRID), smooth=True)


def choose(window: Window, cover: np.ndarray, prompts: Prompts) -> Finding | None:
    """Choose the parts under the clicks, or without clicks the heaviest one.

    None where there is none, or where it holds a click beside the object and no other part is heavy enough.
    """
    labels, sizes = label_parts(cover > IN_OBJECT)
    weights = np.bincount(labels.ravel(), weights=cover.ravel(), minlength=len(sizes))
    weights[0] = 0.0
    clicked = (window.cells(points) for points in (prompts.on, prompts.off))
    on, off = ({int(labels[row, column]) for column, row in cells} - {0} for cells in clicked)
    if prompts.on:
        chosen = on if not on & off else set()
    else:
        left = [0.0 if label in off else weight for label, weight in enumerate(weights)]
        heaviest = int(np.argmax(left))
        excluded = max((weights[label] for label in off), default=0.0)
        chosen = {heaviest} if left[heaviest] > PART_SHARE * excluded else set()
    if not chosen:
        return None
    part = fill_holes(np.isin(labels, sorted(chosen)))
    return Finding(window=window, cover=np.where((labels > 0) & ~part, 0.0, cover), part=part)


def look_closer(looks: Looks, found: Finding, prompts: Prompts, known: Sequence[Look]) -> Finding:
    """Average a finding with a mirrored look at its window alone, or with a known one that shows it well."""
    box = found.window.box_of(found.part)
    closer = prompts if prompts.box or prompts.on else replace(prompts, box=box)
    near = [look for look in known if found.window.holds(look[0]) and look[0].shows(box)]
    for window, mirrored in [*near, (found.window.around(box, MARGIN), True)]:
        again = looks.at(window, closer, mirrored)
        if choose(window, again, prompts) is not None:
            break
    cells = _cells_of(window, found.window)
    both = (values.astype(np.float32) for values in (found.cover, found.part))
    before, kept = (resample(values, (GRID, GRID), smooth=True, box=cells) for values in both)
    first = Finding(window=window, cover=before, part=kept > IN_OBJECT)
    last = choose(window, (before + again) / 2, prompts) or first
    return replace(last, cut=found.cut, flat=_flat_share(looks.rgb, window, last.part))


def _flat_share(rgb: np.ndarray, window: Window, part: np.ndarray) -> float:
    """Return Finding.flat of a part, by cells to either side of its outline."""
    colors, apart = _colors(rgb, window, GRID), 2 * EDGE_CELLS
    changes = [
        np.linalg.norm(values[apart:] - values[:-apart], axis=-1)[inside[apart:] != inside[:-apart]]
        for values, inside in ((colors, part), (colors.swapaxes(0, 1), part.T))
    ]
    return float((np.concatenate(changes) < ALIKE).sum() / max(sum(map(len, changes)), 1))


def _colors(rgb: np.ndarray, window: Window, grid: int) -> np.ndarray:
    """Return a window's display values [grid, grid, 3]."""
    return resample(rgb[window.y0 : window.y1, window.x0 : window.x1], (grid, grid), smooth=True)


def _around_clicks(looks: Looks, prompts: Prompts, known: Sequence[Look]) -> Finding | None:
    """Return the object in a known window that holds the clicks and does not cut it, else in one around them."""
    squares = [(looks.photo.square(prompts.on, share * max(looks.photo.size)), False) for share in WINDOWS]
    for look in [*(look for look in known if len(look[0].cells(prompts.on)) == len(prompts.on)), *squares]:
        found = choose(look[0], looks.at(look[0], prompts, look[1]), prompts)
        if found is not None and not (look in known and found.is_cut(looks.photo)):
            return found
    return None


def _cut(rgb: np.ndarray, window: Window, cover: np.ndarray, prompts: Prompts) -> Finding | None:
    """Cut the part that holds clicks beside the object: drop cells nearer to these than to the clicks on it.

    Distances grow with changes of the photo's colour. Without a click on the object, the cell farthest from those
    beside it counts as one.
    """
    if (uncut := choose(window, cover, replace(prompts, off=()))) is None:
        return None
    grid = GRID // 2
    colors = _colors(rgb, window, grid)
    part = resample(uncut.part.astype(np.float32), (grid, grid), smooth=True) > IN_OBJECT
    shrink = grid / GRID
    clicked = (window.cells(points) for points in (prompts.on, prompts.off))
    on, off = ([(int(column * shrink), int(row * shrink)) for column, row in cells] for cells in clicked)
    if not on:
        rows, columns = np.nonzero(part)
        away = np.min([np.hypot(columns - column, rows - row) for column, row in off], axis=0)
        on = [(int(columns[away.argmax()]), int(rows[away.argmax()]))]
    nearer = _distance(colors, part, on) < _distance(colors, part, off)
    kept = (resample(nearer.astype(np.float32), (GRID, GRID), smooth=True) > IN_OBJECT) & uncut.part
    if not kept.any():
        return None
    return replace(uncut, part=kept, cover=np.where(uncut.part & ~kept, 0.0, uncut.cover))


def _distance(colors: np.ndarray, part: np.ndarray, seeds: Sequence[tuple[int, int]]) -> np.ndarray:
    """Return the cost [h, w] of the cheapest path from the seeds within a part, see SPLIT; infinite outside."""
    rows, columns = np.mgrid[0 : part.shape[0], 0 : part.shape[1]]
    near = [np.maximum(abs(columns - column), abs(rows - row)) < SPLIT["click_cells"] for column, row in seeds]
    length = np.where(np.any(near, axis=0) & part, 0.0, np.inf)
    across = SPLIT["step"] + np.linalg.norm(np.diff(colors, axis=1), axis=-1)
    down = SPLIT["step"] + np.linalg.norm(np.diff(colors, axis=0), axis=-1)
    while True:
        last = length.copy()
        length[:, 1:] = np.minimum(length[:, 1:], length[:, :-1] + across)
        length[:, :-1] = np.minimum(length[:, :-1], length[:, 1:] + across)
        length[1:] = np.minimum(length[1:], length[:-1] + down)
        length[:-1] = np.minimum(length[:-1], length[1:] + down)
        length[~part] = np.inf
        if (length == last).all():
            return length


def _cells_of(window: Window, outer: Window) -> Box:
    """Return a window's box in the cells of one that contains it."""
    width, height = outer.size
    left, right = ((x - outer.x0) * GRID / width for x in (window.x0, window.x1))
    top, bottom = ((y - outer.y0) * GRID / height for y in (window.y0, window.y1))
    return left, top, right, bottom

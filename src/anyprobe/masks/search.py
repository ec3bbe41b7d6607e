"""Search for the intended object of a photo: a network looks at windows of it, and prompts choose a part.

A look resamples a window to a grid of GRID x GRID cells. The first is at the whole photo, or at the box and a margin;
the second, mirrored, at the part that was found and a margin. Their mean is the mask; its evidence is their agreement.
The same in web/src/photo/search.js.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.masks.check import object_box
from anyprobe.masks.networks import Network
from anyprobe.masks.parts import fill_holes, grow, label_parts
from anyprobe.masks.prompts import Point
from anyprobe.masks.resize import resize

INSIDE = contract("mask")["inside"]
NUMBERS = contract("mask")["search"]

GRID = NUMBERS["grid"]

MARGIN = NUMBERS["margin"]
"""Margin of a window around an object, in shares of the longer side of its box."""

WINDOWS = NUMBERS["windows"]
"""Sides of the windows around a click where nothing was found, in longer sides of the photo."""

BORDER_TOUCH, SURE = NUMBERS["border_touch"], NUMBERS["sure"]
"""Largest share of its outline on the window's border of a part that counts, and probability at which it ends the
search."""

PART_SHARE = NUMBERS["part_share"]
"""Smallest rest beside an excluded part, as a share of it, for which that part is left out rather than cut."""

EDGE_CELLS = NUMBERS["edge_cells"]
"""Width beside a part [cells] in which its soft edge may lie."""

SPLIT = NUMBERS["split"]
"""Settings of cutting a part on a coarser grid, where a step costs a constant and the difference of the two colours."""

NECK = NUMBERS["neck"]
"""Distance by which a part is shrunk to test whether it is one, in square roots of its cells."""

BLANK = NUMBERS["blank"]
"""Smallest range of display values in a window where anything can stand out."""

Box = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Prompts:
    """Clicks x, y on the object and beside it, and a box x0, y0, x1, y1 around it, in pixels of the photo."""

    on: Sequence[Point] = ()
    off: Sequence[Point] = ()
    box: Box | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Window:
    """A window of a photo, in whole pixels."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def size(self) -> tuple[int, int]:
        return self.x1 - self.x0, self.y1 - self.y0

    def around(self, box: Box, margin: float) -> Window:
        """Return the window of a box and a margin in its longer sides, clipped to this window."""
        more = margin * max(box[2] - box[0], box[3] - box[1])
        return Window(
            x0=max(self.x0, int(np.floor(box[0] - more))),
            y0=max(self.y0, int(np.floor(box[1] - more))),
            x1=min(self.x1, int(np.ceil(box[2] + more))),
            y1=min(self.y1, int(np.ceil(box[3] + more))),
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

    def cells(self, points: Iterable[Point]) -> list[tuple[int, int]]:
        """Return column and row of the points inside the window."""
        width, height = self.size
        found = (
            (int(np.floor((x - self.x0) * GRID / width)), int(np.floor((y - self.y0) * GRID / height)))
            for x, y in points
        )
        return [(x, y) for x, y in found if 0 <= x < GRID and 0 <= y < GRID]

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
    """An object in a window: cover [GRID, GRID] in [0, 1], without other parts, and the part of it that it is, bool.

    agreed: IoU of what two looks found, 1 after one; whole: its share of all that the first found, 1 by clicks.
    """

    window: Window
    cover: np.ndarray
    part: np.ndarray
    agreed: float = 1.0
    whole: float = 1.0

    def expected(self) -> float:
        """IoU to expect if the cover of each cell is a probability: of the part and what is beside it."""
        near = _grown(self.part, 2 * EDGE_CELLS)
        inside = float(self.cover[self.part].sum())
        return inside / max(float(self.part.sum()) + float(self.cover[near & ~self.part].sum()), 1e-6)

    def single(self) -> float:
        """1 where the part stays one when it is shrunk, less where two pieces hang together by a neck: 1 less the
        second piece's share of the first."""
        cells = max(1, int(NECK * np.sqrt(self.part.sum())))
        _, sizes = label_parts(~_grown(~np.pad(self.part, 1), cells))
        sizes = np.sort(sizes[1:])
        return 1.0 if len(sizes) < 2 else 1.0 - float(sizes[-2] / sizes[-1])

    def border_share(self, photo: Window, is_photos: bool) -> float:
        """Return the part's cells on the window's sides that are, or are not, the photo's border; over the sides of the
        part's box."""
        window, part = self.window, self.part
        sides = (
            (window.x0 == photo.x0, part[:, 0]),
            (window.y0 == photo.y0, part[0]),
            (window.x1 == photo.x1, part[:, -1]),
            (window.y1 == photo.y1, part[-1]),
        )
        x0, y0, x1, y1 = object_box(part)
        return sum(int(side.sum()) for there, side in sides if there == is_photos) / (2 * (x1 - x0 + y1 - y0))

    def mask(self, width: int, height: int) -> np.ndarray:
        """Return the mask [height, width] float32 of the whole photo, with the network's soft edge."""
        soft = np.where(self.part, np.maximum(self.cover, 0.51), np.minimum(self.cover, 0.49))
        soft = np.where(_grown(self.part, EDGE_CELLS), soft, 0.0).astype(np.float32)
        return self._placed(soft, width, height)

    def only(self, cover: np.ndarray) -> np.ndarray:
        """Restrict another segmenter's cover [H, W] to this part at full resolution, its small holes filled."""
        height, width = cover.shape
        inner, near = (
            self._placed(one.astype(np.float32), width, height) > INSIDE
            for one in (~_grown(~self.part, EDGE_CELLS), _grown(self.part, EDGE_CELLS))
        )
        return np.where(inner & (cover <= INSIDE), 0.51, cover * near).astype(np.float32)

    def _placed(self, cells: np.ndarray, width: int, height: int) -> np.ndarray:
        """Place values [GRID, GRID] of the window into a photo [height, width] that is zero elsewhere."""
        canvas = np.zeros((height, width), np.float32)
        window = self.window
        canvas[window.y0 : window.y1, window.x0 : window.x1] = resize(cells, *window.size)
        return canvas


def finding_of(cover: np.ndarray, prompts: Prompts) -> Finding | None:
    """Convert another segmenter's cover [H, W] in [0, 1] to a finding of the clicked parts; None where there is
    none."""
    if not (cover > INSIDE).any():
        return None
    photo = Window(x0=0, y0=0, x1=cover.shape[1], y1=cover.shape[0])
    window = photo.around(object_box(cover), MARGIN)
    return choose(window, resize(cover[window.y0 : window.y1, window.x0 : window.x1], GRID, GRID), prompts)


def find_object(network: Network, rgb: np.ndarray, prompts: Prompts) -> Finding | None:
    """Find the object of a photo [H, W, 3] of display values in [0, 1]; None where nothing is there."""
    height, width = rgb.shape[:2]
    photo = Window(x0=0, y0=0, x1=width, y1=height)
    start = photo if prompts.box is None else photo.around(prompts.box, MARGIN)
    cover = look(network, rgb, start, prompts)
    found = choose(start, cover, prompts)
    if found is None and prompts.on:
        found = _beside_clicks(network, rgb, photo, prompts)
    if found is None and prompts.off:
        found = _cut(rgb, start, cover, prompts)
    return None if found is None else look_closer(network, rgb, found, prompts)


def look(network: Network, rgb: np.ndarray, window: Window, prompts: Prompts, mirrored: bool = False) -> np.ndarray:
    """Run the network on a window: cover [GRID, GRID], zero outside the box."""
    seen = rgb[window.y0 : window.y1, window.x0 : window.x1]
    width, _ = window.size
    turn = (lambda x: width - x) if mirrored else (lambda x: x)

    def place(points: Iterable[Point]) -> list[Point]:
        return [(turn(x - window.x0), y - window.y0) for x, y in points]

    corners = None
    if prompts.box is not None:
        (x0, y0), (x1, y1) = place((prompts.box[:2], prompts.box[2:]))
        corners = (min(x0, x1), y0, max(x0, x1), y1)
    if float(np.ptp(seen)) < BLANK:
        return np.zeros((GRID, GRID), np.float32)
    shown = np.ascontiguousarray(seen[:, ::-1]) if mirrored else seen
    cover = network.cover(shown, place(prompts.on), place(prompts.off), corners)
    cover = resize(cover[:, ::-1] if mirrored else cover, GRID, GRID)
    return cover if prompts.box is None else cover * window.inside(prompts.box)


def choose(window: Window, cover: np.ndarray, prompts: Prompts) -> Finding | None:
    """Choose the parts under the clicks, or without clicks the heaviest one.

    None where there is none, or where it holds a click beside the object and no other part can be meant.
    """
    labels, sizes = label_parts(cover > INSIDE)
    weights = np.bincount(labels.ravel(), weights=cover.ravel(), minlength=len(sizes))
    weights[0] = 0.0
    on, off = (
        {int(labels[row, column]) for column, row in window.cells(points)} - {0} for points in (prompts.on, prompts.off)
    )
    if prompts.on:
        chosen = on if not on & off else set()
    else:
        left = [0.0 if label in off else weight for label, weight in enumerate(weights)]
        most = int(np.argmax(left))
        taken = max((weights[label] for label in off), default=0.0)
        chosen = {most} if left[most] > PART_SHARE * taken else set()
    if not chosen:
        return None
    part = fill_holes(np.isin(labels, sorted(chosen)))
    whole = 1.0 if prompts.on else float(sum(weights[label] for label in chosen) / weights.sum())
    return Finding(window=window, cover=np.where((labels > 0) & ~part, 0.0, cover), part=part, whole=whole)


def look_closer(network: Network, rgb: np.ndarray, found: Finding, prompts: Prompts) -> Finding:
    """Average a finding with a mirrored look at its window alone."""
    box = found.window.box_of(found.part)
    window = found.window.around(box, MARGIN)
    closer = prompts if prompts.box or prompts.on else replace(prompts, box=box)
    again = look(network, rgb, window, closer, mirrored=True)
    cells = _cells_of(window, found.window)
    before, kept = (resize(one.astype(np.float32), GRID, GRID, cells) for one in (found.cover, found.part))
    known = Finding(window=window, cover=before, part=kept > INSIDE)
    second = choose(window, again, prompts)
    agreed = 0.0 if second is None else _iou(known.part, second.part)
    mean = choose(window, (before + again) / 2, prompts)
    return replace(known if mean is None else mean, agreed=agreed, whole=found.whole)


def _beside_clicks(network: Network, rgb: np.ndarray, photo: Window, prompts: Prompts) -> Finding | None:
    """Return the likeliest object in windows around the clicks that no window's border cuts."""
    best, most = None, 0.0
    for share in WINDOWS:
        window = photo.square(prompts.on, share * max(photo.size))
        found = choose(window, look(network, rgb, window, prompts), prompts)
        if found is None:
            continue
        likely = found.expected() * (1.0 - min(1.0, found.border_share(photo, False) / BORDER_TOUCH))
        if likely > most:
            best, most = found, likely
        if most > SURE:
            break
    return best


def _cut(rgb: np.ndarray, window: Window, cover: np.ndarray, prompts: Prompts) -> Finding | None:
    """Cut the part that holds clicks beside the object: drop what is nearer to them than to the clicks on it, along the
    photo's colours. Without a click on it, the part's cell farthest from them counts as one."""
    plain = choose(window, cover, replace(prompts, off=()))
    if plain is None:
        return None
    grid = SPLIT["grid"]
    colors = resize(rgb[window.y0 : window.y1, window.x0 : window.x1], grid, grid)
    part = resize(plain.part.astype(np.float32), grid, grid) > INSIDE
    shrink = grid / GRID
    on, off = (
        [(int(column * shrink), int(row * shrink)) for column, row in window.cells(points)]
        for points in (prompts.on, prompts.off)
    )
    if not on:
        rows, columns = np.nonzero(part)
        away = np.min([np.hypot(columns - column, rows - row) for column, row in off], axis=0)
        on = [(int(columns[away.argmax()]), int(rows[away.argmax()]))]
    nearer = _distance(colors, part, on) < _distance(colors, part, off)
    kept = (resize(nearer.astype(np.float32), GRID, GRID) > INSIDE) & plain.part
    if not kept.any():
        return None
    return replace(plain, part=kept, cover=np.where(plain.part & ~kept, 0.0, plain.cover))


def _distance(colors: np.ndarray, part: np.ndarray, seeds: Sequence[tuple[int, int]]) -> np.ndarray:
    """Return the shortest path [h, w] from the seeds within a part, counting steps and changes of colour; infinite
    outside."""
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


def _cells_of(window: Window, of: Window) -> Box:
    """Return a window in the cells of one that contains it."""
    width, height = of.size
    return (
        (window.x0 - of.x0) * GRID / width,
        (window.y0 - of.y0) * GRID / height,
        (window.x1 - of.x0) * GRID / width,
        (window.y1 - of.y0) * GRID / height,
    )


def _grown(part: np.ndarray, cells: int) -> np.ndarray:
    for _ in range(cells):
        part = grow(part)
    return part


def _iou(one: np.ndarray, other: np.ndarray) -> float:
    return float((one & other).sum() / max((one | other).sum(), 1))

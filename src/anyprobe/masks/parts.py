"""Connected parts of a mask, of which the object is one, without pinholes; and those of a given mask that matter.

Specks, threads, and parts far from the largest do not. The same in web/src/photo/parts.js and specks.js.
"""

import numpy as np

from anyprobe.core.contract import contract

HOLE_SHARE = contract("mask")["hole_share"]
"""Largest hole that is filled, as a share of the object; larger ones are real, such as a handle's."""

NUMBERS = contract("mask")["specks"]

SHARE = NUMBERS["share"]
"""Smallest area of a part over that of the largest; smaller ones are specks."""

REACH = NUMBERS["reach"]
"""Largest distance by which a part may stick out of the box of those that are kept, in square roots of its area."""

THIN, THREAD_REACH = NUMBERS["thin"], NUMBERS["thread_reach"]
"""Half the width of a thread, at least 1 pixel, and the distance by which one may stick out of the box, both in square
roots of the mask's area."""

SOFT_PX = NUMBERS["soft_px"]
"""Width of the soft edge [px] that is removed with a part."""

LARGE, OUTLINE = NUMBERS["large"], NUMBERS["outline"]
"""Smallest area of a part over that of the largest at which it may be an object of its own, and smallest area of a mask
over that with its largest hole filled; less is an outline."""


def grow(mask: np.ndarray, steps: int = 1) -> np.ndarray:
    """Grow a mask [H, W] bool by the 4-connected neighbours of its pixels, so many times."""
    for _ in range(steps):
        grown = mask.copy()
        grown[1:] |= mask[:-1]
        grown[:-1] |= mask[1:]
        grown[:, 1:] |= mask[:, :-1]
        grown[:, :-1] |= mask[:, 1:]
        mask = grown
    return mask


def label_parts(inside: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Label the 4-connected parts of a mask.

    Args:
        inside: [H, W] bool.
    Returns:
        labels [H, W] int, 0 outside, parts numbered from 1; sizes [N + 1] in pixels, sizes[0] of the outside.
    """
    rows, starts, stops = _runs(inside)
    parent = np.arange(len(rows))

    def root(run: int) -> int:
        while parent[run] != run:
            parent[run] = parent[parent[run]]
            run = parent[run]
        return run

    above, first = 0, np.searchsorted(rows, np.arange(len(inside) + 1))
    for run in range(len(rows)):
        above = max(above, first[rows[run] - 1] if rows[run] else 0)
        other = above
        while other < len(rows) and rows[other] == rows[run] - 1 and starts[other] < stops[run]:
            if stops[other] > starts[run]:
                parent[root(other)] = root(run)
                above = other
            other += 1
    _, number = np.unique(np.array([root(run) for run in range(len(rows))], np.int64), return_inverse=True)
    flat = np.zeros(inside.size, np.int64)
    lengths = stops - starts
    offset = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    flat[np.repeat(rows * inside.shape[1] + starts, lengths) + offset] = np.repeat(number + 1, lengths)
    return flat.reshape(inside.shape), np.bincount(flat, minlength=1 + (number.max() + 1 if len(number) else 0))


def _runs(inside: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return row, first column, and column after the last, of each run of true pixels, row by row."""
    padded = np.pad(inside, ((0, 0), (1, 1))).astype(np.int8)
    rows, starts = np.nonzero(np.diff(padded, axis=1) == 1)
    _, stops = np.nonzero(np.diff(padded, axis=1) == -1)
    return rows, starts, stops


def fill_holes(part: np.ndarray) -> np.ndarray:
    """Fill the holes of a part [H, W] bool up to HOLE_SHARE of it."""
    labels, sizes = label_parts(~part)
    at_border = np.zeros(len(sizes), bool)
    for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        at_border[edge] = True
    fills = ~at_border & (sizes <= HOLE_SHARE * max(int(part.sum()), 1))
    fills[0] = False
    return part | fills[labels]


def keep_object(mask: np.ndarray) -> tuple[np.ndarray, int, bool]:
    """Keep the largest part of a mask [H, W] in [0, 1], not empty above one half, and the parts that belong to it.

    Returns:
        The mask, the given one itself where nothing is dropped; the number of its large parts; and whether it is only
        the outline of something.
    """
    radius = max(1, round(THIN * float(np.sqrt((mask > 0.5).sum()))))
    window = _window(mask > 0.5, radius + SOFT_PX)
    inside = mask[window] > 0.5
    body = grow(~grow(~np.pad(inside, radius), radius)[radius:-radius, radius:-radius], 2 * radius) & inside
    if 2 * body.sum() < inside.sum():
        body = inside  # a drawing of lines
    labels, sizes = label_parts(body)
    sizes[0] = 0
    boxes = _boxes(labels, len(sizes))
    largest = int(sizes.argmax())
    box, kept = boxes[largest], {largest}
    waiting = [int(one) for one in np.argsort(-sizes, kind="stable") if sizes[one] >= SHARE * sizes[largest]][1:]
    while near := [one for one in waiting if _overhang(boxes[one], box) <= REACH * np.sqrt(sizes[one])]:
        kept.add(near[0])
        waiting.remove(near[0])
        box = np.r_[np.minimum(box, boxes[near[0]])[:2], np.maximum(box, boxes[near[0]])[2:]]
    belongs = np.isin(labels, list(kept))
    threads, lengths = label_parts(inside & ~body)
    touching = set(np.unique(threads[grow(belongs)]).tolist()) - {0}
    reach = THREAD_REACH * float(np.sqrt(sizes[largest]))
    ends = _boxes(threads, len(lengths))
    belongs |= np.isin(threads, [one for one in touching if _overhang(ends[one], box) <= reach])
    large = int((sizes >= LARGE * sizes[largest]).sum())
    if (dropped := inside & ~belongs).any():
        mask = mask.copy()
        mask[window][dropped | grow(dropped, SOFT_PX) & ~grow(belongs, SOFT_PX)] = 0.0
    return mask, large, _is_outline(belongs, radius)


def _window(inside: np.ndarray, margin: int) -> tuple[slice, slice]:
    """Return the rows and columns of the box of a mask, and a margin [px]."""
    ends = [np.flatnonzero(inside.any(axis=axis))[[0, -1]] for axis in (1, 0)]
    rows, columns = (slice(max(first - margin, 0), last + 1 + margin) for first, last in ends)
    return rows, columns


def _is_outline(belongs: np.ndarray, radius: int) -> bool:
    """Return whether the largest hole of a mask, its gaps closed, is far larger than the mask."""
    closed = np.pad(grow(np.pad(belongs, 2 * radius), 2 * radius), 1)
    labels, sizes = label_parts(~closed)
    sizes[[0, labels[0, 0]]] = 0
    area = int(belongs.sum())
    return area < OUTLINE * (area + int(sizes.max()))


def _boxes(labels: np.ndarray, count: int) -> np.ndarray:
    """Return the bounding box x0, y0, x1, y1 (exclusive) of each label, [count, 4]."""
    rows, columns = np.nonzero(labels)
    own = labels[rows, columns]
    boxes = np.empty((count, 4), np.int64)
    boxes[:, :2], boxes[:, 2:] = max(labels.shape), 0
    for axis, places in enumerate((columns, rows)):
        np.minimum.at(boxes[:, axis], own, places)
        np.maximum.at(boxes[:, axis + 2], own, places + 1)
    return boxes


def _overhang(box: np.ndarray, of: np.ndarray) -> int:
    """Return the largest distance by which a box sticks out of another [px]."""
    return int(max(*(of[:2] - box[:2]), *(box[2:] - of[2:]), 0))

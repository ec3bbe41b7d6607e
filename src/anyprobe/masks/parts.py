"""Connected parts of a mask, of which the object is one, without pinholes; as web/src/photo/parts.js."""

from __future__ import annotations

import numpy as np

from anyprobe.core.contract import contract

HOLE_SHARE = contract("mask")["hole_share"]
"""Largest hole that is filled, as a share of the object; larger ones are real, such as a handle's."""


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
    roots = np.array([root(run) for run in range(len(rows))], np.int64)
    _, number = np.unique(roots, return_inverse=True)
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

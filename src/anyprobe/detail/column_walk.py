"""A way through the columns of a photo, on and on, all around and back to the photo without a visible end.

A video texture (Schoedl et al. 2000, "Video Textures", sec. 3) with columns in place of frames: they follow one another
as in the photo, forwards or backwards; now and then the way turns at a column without edges, or jumps to a column like
the one that would follow. The cheapest way is found by dynamic programming.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

NARROWEST_DEG = 15.0
"""Smallest width [degrees] of a photo that is repeated; a narrower one would make a pattern."""
SHORTEST_RUN_DEG, SHORTEST_RUN = 12.0, 0.3
"""Smallest length [degrees] of a run, and as a share of the photo's width, whichever is less."""
UNUSUAL = 0.5
"""Price of a run over the whole photo whose columns all are as unlike its typical one as they are on average."""
TURN, TURN_EDGES = 1.5, 1.5
"""Price of turning, and what a column of average contrast with its neighbours adds."""
JUMP, JUMP_UNLIKE = 0.6, 3.0
"""Price of a jump, and what two columns add that differ as much as the median pair."""
LEAST_JUMP = 0.12
"""Smallest jump, as a share of the photo's width."""
UNEQUAL = 2.0
"""Difference in ln radiance of two columns of which one shows nothing of what the other shows."""
CHANCE = 0.4
"""Width of the random part of a price, so that the way is not periodic."""
_NEVER = np.float32(1e6)


@dataclass(frozen=True, slots=True)
class Run:
    """Consecutive columns: the first, the step from one to the next, 1 or -1, and their number."""

    first: int
    step: int
    count: int

    @property
    def last(self) -> int:
        """The last column."""
        return self.first + self.step * (self.count - 1)


def walk_around(ln: np.ndarray, shown: np.ndarray, length: int, per_deg: float) -> list[Run] | None:
    """Return runs of `length` columns in all that lead from the photo's last column to its first.

    Args:
        ln: [R, W, 3], ln radiance of the photo's columns.
        shown: [R, W] bool, what of them is the photo's.
        per_deg: columns to a degree.
    Returns:
        None where the photo is too narrow.
    """
    width = ln.shape[1]
    shortest = max(3, int(min(SHORTEST_RUN * width, SHORTEST_RUN_DEG * per_deg)))
    if width < max(NARROWEST_DEG * per_deg, 2 * shortest) or length < shortest:
        return None
    rng = np.random.default_rng(0)
    passing, turning, jumping = _prices(ln, shown)
    total = np.concatenate([[0.0], np.cumsum(passing)]).astype(np.float32)
    column = np.arange(width)
    begun = np.full((length + 1, 2, width), _NEVER, np.float32)  # cheapest way to a run's first column
    begun_after = np.zeros((length + 1, 2, width, 2), int)  # last column of the run before, and its direction
    count = np.zeros((length + 1, 2, width), int)
    ended = np.full((2, width), _NEVER, np.float32)
    ended[1, -1] = 0.0  # the photo itself runs forwards
    for at in range(length + 1):
        if at >= shortest:
            counts = np.arange(shortest, min(width, at) + 1)[:, None]
            for forwards, step in enumerate((-1, 1)):
                first = column - step * (counts - 1)
                price = begun[at - counts, forwards, first.clip(0, width - 1)] + np.abs(
                    total[column + (step > 0)] - total[(first + (step < 0)).clip(0, width)]
                )
                price = np.where((first >= 0) & (first < width), price, _NEVER)
                best = price.argmin(axis=0)
                ended[forwards], count[at, forwards] = price[best, column], counts[best, 0]
        if at == length:
            break
        chance = CHANCE * rng.gumbel(size=width)
        for forwards in (0, 1):
            # at the photo's border, nothing beyond it could fade into what is jumped to
            price = ended[forwards][:, None] + jumping[forwards] + (_NEVER if at == 0 else 0.0)
            best, turned = price.argmin(axis=0), ended[1 - forwards] + turning
            turns = turned < price[best, column]
            begun[at, forwards] = np.where(turns, turned, price[best, column]) + chance
            begun_after[at, forwards] = np.stack(
                [np.where(turns, column, best), np.where(turns, 1 - forwards, forwards)], 1
            )
        ended = np.full_like(ended, _NEVER)
    closing = np.stack([np.where(column == 0, turning, _NEVER), jumping[1][:, 0]]) + ended
    forwards, last = (int(k) for k in np.unravel_index(int(closing.argmin()), closing.shape))
    if closing[forwards, last] > _NEVER / 2:
        return None
    return _traced(begun_after, count, forwards, last)


def _traced(begun_after: np.ndarray, count: np.ndarray, forwards: int, last: int) -> list[Run]:
    """Follow the cheapest way [T + 1, 2, W, ...] back from its last column."""
    runs: list[Run] = []
    at = len(count) - 1
    while at > 0:
        number, step = int(count[at, forwards, last]), 1 if forwards else -1
        runs.insert(0, Run(last - step * (number - 1), step, number))
        at -= number
        last, forwards = map(int, begun_after[at, forwards, runs[0].first])
    return runs


def _prices(ln: np.ndarray, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Return the prices of passing a column [W], of turning there [W], and of jumps from one to another [W, W], of
    a way that runs backwards and forwards."""
    width = ln.shape[1]
    ln = np.where(shown[..., None], ln, 0.0).astype(np.float32)
    number = np.maximum(shown.sum(axis=0), 1)
    rows = shown.any(axis=1)
    typical = np.nanmedian(np.where(shown[rows, :, None], ln[rows], np.nan), axis=1)[:, None]
    unlike = (((ln[rows] - typical) ** 2).mean(axis=-1) * shown[rows]).sum(axis=0) / number
    edges = (np.abs(np.gradient(ln, axis=1)).mean(axis=-1) * shown).sum(axis=0) / number
    flat, mark = np.moveaxis(ln, 1, 0).reshape(width, -1), shown.T.astype(np.float32)
    both = mark @ mark.T
    squares = (np.moveaxis(ln, 1, 0) ** 2).sum(axis=-1) @ mark.T
    distance = np.sqrt(np.maximum(squares + squares.T - 2 * flat @ flat.T, 0.0) / np.maximum(3 * both, 1))
    distance += UNEQUAL * (1 - both / np.maximum(number[:, None], number))
    column = np.arange(width)
    near = _NEVER * (np.abs(column[:, None] - column) < LEAST_JUMP * width)
    jumping = [
        JUMP + JUMP_UNLIKE * distance[(column + step).clip(0, width - 1)] / (np.median(distance) + 0.02) + near
        for step in (-1, 1)
    ]
    return UNUSUAL * unlike / (unlike.mean() + 1e-3) / width, TURN + TURN_EDGES * edges / (edges.mean() + 1e-3), jumping

"""Continuation of a picture sideways in strips of itself, each joined where it fits best.

After Efros and Freeman 2001: a strip is copied from the place in the picture whose beginning looks most like the
current end; both are cut along the path on which they differ least. The remaining jump in colour fades out along the
strip.
"""

from __future__ import annotations

import numpy as np

STRIP = (0.4, 0.65)
"""Widths of strips, in widths of the picture."""
JOIN = 0.09
"""Width over which two strips may be cut, in widths of the picture."""
REUSE_PENALTY = 0.8
"""Penalty of a place that was just used, in units of the mean difference over all places; it fades with each strip."""
FILLED_PENALTY = 1.0
"""Penalty of a strip that is filled rather than seen, in the same unit."""
COARSE = 3
"""Pixels of the picture per pixel compared."""
FADE = 0.5
"""Share of a strip's width over which a jump of colour fades by a factor e."""
SOFT_CUT = 2
"""Pixels on both sides of a cut over which it is soft."""


def continue_right(picture: np.ndarray, filled: np.ndarray, length: int, seed: int) -> np.ndarray:
    """Continue a picture [H, W, 3] beyond its right border: columns [H, J + length, 3].

    The first J = join_of(W) of them replace the picture's last ones, so that the continuation can begin within them.
    filled: [H, W] share that is not seen.
    """
    height, width = picture.shape[:2]
    join = join_of(width)
    empty = filled.mean(axis=0)
    random = np.random.default_rng(seed)
    canvas = np.empty((height, join + length + width, 3), np.float32)
    canvas[:, :join] = picture[:, -join:]
    used = np.zeros(width)
    end = join
    while end < join + length:
        size = join + max(2, round(random.uniform(*STRIP) * width))
        size = min(size, width)
        at = _place(picture, canvas[:, end - join : end], used, empty, size)
        strip = _joined(canvas[:, end - join : end], picture[:, at : at + size])
        canvas[:, end - join : end - join + size] = strip
        used *= 0.5
        used[max(0, at - size // 2) : at + size // 2] = 1.0
        end += size - join
    return canvas[:, : join + length]


def join_of(width: int) -> int:
    """Return the number of columns within which a picture of this width may be cut."""
    return max(2, round(JOIN * width))


def strewn(texture: np.ndarray, side: int, size: int, seed: int) -> np.ndarray:
    """Scatter blocks [side, side, C] of a zero-mean texture over a square of `size` pixels, [size, size, C].

    They overlap by half; divided by the root of the weights' squares, their sum keeps the texture's contrast.
    """
    random = np.random.default_rng(seed)
    window = np.sin(np.pi * (np.arange(side) + 0.5) / side) ** 2
    weight = np.outer(window, window)[..., None].astype(np.float32)
    step = side // 2
    count = -(-size // step) + 1
    canvas = np.zeros(((count + 1) * step, (count + 1) * step, texture.shape[2] + 1), np.float32)
    for row in range(count):
        for column in range(count):
            top, left = (random.integers(0, max(1, have - side + 1)) for have in texture.shape[:2])
            block = texture[top : top + side, left : left + side]
            place = canvas[row * step : row * step + side, column * step : column * step + side]
            place[..., :-1] += weight * block
            place[..., -1:] += weight**2
    canvas = canvas[step : step + size, step : step + size]
    return canvas[..., :-1] / np.sqrt(np.maximum(canvas[..., -1:], 1e-6))


def smoothed(picture: np.ndarray, sigma: int) -> np.ndarray:
    """Blur a picture [H, W, C] both ways; its border is extended."""
    for _ in range(2):
        flat = picture.reshape(len(picture), -1)
        picture = _along(flat, max(1, sigma)).reshape(picture.shape).swapaxes(0, 1)
    return picture


def _place(picture: np.ndarray, tail: np.ndarray, used: np.ndarray, empty: np.ndarray, size: int) -> int:
    """Return the first column of the strip of a picture [H, W, 3] that best continues a tail [H, J, 3]."""
    step = COARSE if min(tail.shape[:2]) >= COARSE else 1  # a telephoto's tail is narrower
    small, end = _shrunk(picture, step), _shrunk(tail, step)
    first = np.arange((picture.shape[1] - size) // step + 1) * step
    starts = np.minimum(first // step, max(small.shape[1] - end.shape[1], 0))
    squares = np.zeros(len(first))
    for column in range(min(end.shape[1], small.shape[1])):
        squares += ((small[:, starts + column] - end[:, column : column + 1]) ** 2).sum(axis=(0, 2))
    holes = np.convolve(empty, np.ones(size) / size, mode="valid")[first]
    price = squares / max(float(squares.mean()), 1e-9) + REUSE_PENALTY * used[first] + FILLED_PENALTY * holes
    return int(first[np.argmin(price)])


def _joined(tail: np.ndarray, strip: np.ndarray) -> np.ndarray:
    """Join a strip [H, S, 3] to a tail [H, J, 3]: up to a cut, its first columns are the tail's."""
    join = tail.shape[1]
    jump = (tail - strip[:, :join]).mean(axis=1)
    jump = _along(jump, max(2, len(jump) // 24))
    fade = np.exp(-np.maximum(np.arange(strip.shape[1]) - join / 2, 0) / (FADE * strip.shape[1]))
    strip = strip + (jump[:, None] * fade[None, :, None]).astype(np.float32)
    cut = _cut(((tail - strip[:, :join]) ** 2).sum(axis=-1))
    share = np.clip((np.arange(join)[None] - cut[:, None]) / (2 * SOFT_CUT) + 0.5, 0.0, 1.0)[..., None]
    strip[:, :join] = tail + share.astype(np.float32) * (strip[:, :join] - tail)
    return strip


def _cut(difference: np.ndarray) -> np.ndarray:
    """Find the path from top to bottom, a column a row [H], along which differences [H, J] are least."""
    height = len(difference)
    wide = np.pad(difference, ((0, 0), (1, 1)), constant_values=np.inf)
    cost = wide[:, 1:-1]
    for row in range(1, height):
        above = wide[row - 1]
        cost[row] += np.minimum(np.minimum(above[:-2], above[1:-1]), above[2:])
    path = np.empty(height, int)
    path[-1] = np.argmin(cost[-1])
    for row in range(height - 2, -1, -1):
        first = max(0, path[row + 1] - 1)
        path[row] = first + np.argmin(cost[row, first : path[row + 1] + 2])
    return path


def _along(values: np.ndarray, sigma: int) -> np.ndarray:
    """Blur values [H, C] along H."""
    reach = 2 * sigma
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    padded = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    return np.stack([np.convolve(channel, weights / weights.sum(), mode="valid") for channel in padded.T], axis=-1)


def _shrunk(picture: np.ndarray, step: int) -> np.ndarray:
    """Average over blocks of step x step pixels; incomplete ones at the end are dropped."""
    height, width = (side // step for side in picture.shape[:2])
    blocks = picture[: height * step, : width * step].reshape(height, step, width, step, -1)
    return blocks.mean(axis=(1, 3))

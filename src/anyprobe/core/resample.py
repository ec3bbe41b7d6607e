"""Resizing and reading between the pixels of pictures of floats with any number of channels."""

from collections.abc import Sequence

import numpy as np
from PIL import Image


def resample(
    picture: np.ndarray, size: tuple[int, int], *, smooth: bool = False, box: Sequence[float] | None = None
) -> np.ndarray:
    """Resize [H, W] or [H, W, C] to (width, height), float32: means over areas.

    Args:
        smooth: linear instead, between the pixels where it is enlarged, over twice the areas where it shrinks.
        box: x0, y0, x1, y1 of the part to resize [px], not necessarily integers; None: the whole picture.
    """
    if picture.ndim == 3:
        return np.stack([resample(picture[..., k], size, smooth=smooth, box=box) for k in range(picture.shape[2])], -1)
    way = Image.Resampling.BILINEAR if smooth else Image.Resampling.BOX
    part = None if box is None else (box[0], box[1], box[2], box[3])
    return np.asarray(Image.fromarray(np.ascontiguousarray(picture, np.float32)).resize(size, way, box=part))


def overlaps(borders: np.ndarray, count: int) -> np.ndarray:
    """Return the part of each of an axis' pixels that lies between each two of N + 1 borders, [N, count]."""
    pixel = np.arange(count)
    return np.clip(np.minimum(borders[1:, None], pixel + 1) - np.maximum(borders[:-1, None], pixel), 0.0, None)


def widest(picture: np.ndarray, reach: int) -> np.ndarray:
    """Return the maxima over squares of 2 reach + 1 pixels around those of a picture [H, W] >= 0."""
    for _ in range(2):  # rows, then columns; Pillow's MaxFilter takes ten times as long
        rows, covered = np.pad(picture, ((reach, reach), (0, 0))), 1
        while 2 * covered <= 2 * reach + 1:
            rows, covered = np.maximum(rows[:-covered], rows[covered:]), 2 * covered
        last = 2 * reach + 1 - covered
        picture = np.maximum(rows[: len(picture)], rows[last : last + len(picture)]).T
    return picture


def between(picture: np.ndarray, column: np.ndarray, row: np.ndarray, *, wraps: bool = False) -> np.ndarray:
    """Interpolate [H, W, C] linearly at columns and rows [...], 0 in the middle of the first: [..., C].

    wraps: whether it goes on from its other side; else places outside count as its border.
    """
    height, width = picture.shape[:2]
    if not wraps:
        column, row = np.clip(column, 0, width - 1), np.clip(row, 0, height - 1)
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    x, y = (column - left)[..., None], (row - top)[..., None]
    right, below = (left + 1, top + 1) if wraps else (np.minimum(left + 1, width - 1), np.minimum(top + 1, height - 1))
    left, right, top, below = left % width, right % width, top % height, below % height
    upper = picture[top, left] * (1 - x) + picture[top, right] * x
    return upper * (1 - y) + (picture[below, left] * (1 - x) + picture[below, right] * x) * y

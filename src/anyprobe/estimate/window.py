"""A square of a photo at another size, each sample the mean over the pixels that it covers."""

from __future__ import annotations

import numpy as np


def sample_window(
    values: np.ndarray, mask: np.ndarray | None, center: tuple[float, float], side: float, size: int
) -> np.ndarray:
    """Return the square of that side in pixels around center (x, y): [size, size, C + 1] float32, values times mask,
    and mask.

    Outside the picture both are zero.

    Args:
        values: [H, W, C].
        mask: [H, W]; None: 1 in the whole picture.
    """
    height, width, channels = values.shape
    rows, row_weights = _taps(center[1] - side / 2.0, side, size, height)
    columns, column_weights = _taps(center[0] - side / 2.0, side, size, width)
    top, left = int(rows.min()), int(columns.min())
    inside = slice(top, int(rows.max()) + 1), slice(left, int(columns.max()) + 1)
    rows, columns = rows - top, columns - left
    if mask is None:
        cover = row_weights.sum(axis=1)[:, None, None] * column_weights.sum(axis=1)[None, :, None]
        planes = np.ascontiguousarray(values[inside], np.float32)
        return np.concatenate([_reduced(planes, rows, row_weights, columns, column_weights), cover], axis=2)
    planes = np.empty((inside[0].stop - top, inside[1].stop - left, channels + 1), np.float32)
    for channel in range(channels):  # twice as fast as all at once
        np.multiply(values[inside][..., channel], mask[inside], out=planes[..., channel])
    planes[..., -1] = mask[inside]
    return _reduced(planes, rows, row_weights, columns, column_weights)


def _reduced(
    planes: np.ndarray, rows: np.ndarray, row_weights: np.ndarray, columns: np.ndarray, column_weights: np.ndarray
) -> np.ndarray:
    """[size, size, C] of contiguous planes [H, W, C]: weighted sums of rows, then of columns, [size, K] of each.

    Sums of ufuncs, not matrix products: their last bits do not depend on threads.
    """
    height, width, channels = planes.shape
    lines = planes.reshape(height, width * channels)
    down = row_weights[:, :1] * lines[rows[:, 0]]
    for row, weight in zip(rows.T[1:], row_weights.T[1:], strict=True):
        down += weight[:, None] * lines[row]
    down = down.reshape(len(rows), width, channels)
    across = column_weights[:, :1] * down[:, columns[:, 0]]
    for column, weight in zip(columns.T[1:], column_weights.T[1:], strict=True):
        across += weight[:, None] * down[:, column]
    return across


def _taps(start: float, side: float, size: int, length: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels [size, K] of an axis of that length which each sample of the window [start, start + side) reads, and
    their weights [size, K] float32; a row's sum is 1 but where the window runs over the border."""
    step = side / size
    low = start + step * np.arange(size)[:, None]
    if step >= 1.0:
        pixel = np.floor(low) + np.arange(int(np.ceil(step)) + 1)
        weights = np.clip(np.minimum(low + step, pixel + 1) - np.maximum(low, pixel), 0.0, None) / step
    else:
        middle = low + step / 2.0 - 0.5
        pixel = np.floor(middle) + np.arange(2)
        weights = np.clip(1.0 - np.abs(middle - pixel), 0.0, None)
    weights = np.where((pixel >= 0) & (pixel < length), weights, 0.0)
    return np.clip(pixel, 0, length - 1).astype(np.intp), weights.astype(np.float32)

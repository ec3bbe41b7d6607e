"""The square crop that the paper's chain sees, each sample the mean over the pixels that it covers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.frames import turn_towards
from anyprobe.estimate.light_graph import CROP_MARGIN
from anyprobe.masks.check import object_box


@dataclass(frozen=True, kw_only=True, slots=True)
class Crop:
    """A square window on the object.

    Attributes:
        image: [S, S, 4] float32: rgb times mask, and mask, all in [0, 1].
        camera_from_crop: [3, 3] float64, rotation from the frame that looks at the
            window's centre along -Z to the photo's camera.
        center_px: x, y of its centre in the photo; pixel i covers [i, i + 1).
        tan_half: tangent of half the angle that its side takes in, seen as its own camera's picture.
    """

    image: np.ndarray
    camera_from_crop: np.ndarray
    center_px: tuple[float, float]
    tan_half: float


def crop_of(inputs: Mapping[str, np.ndarray], size: int) -> Crop:
    """Cut the square around the object out of its window, see light_graph.graph_inputs, and bring it to size x size.

    Averaged over areas when shrinking, bilinear when enlarging, with colour premultiplied by the mask so that no
    background bleeds in. What lies over the border of the photo is empty.
    """
    window = inputs["window"][0]
    width, height, _, left, top, step = (float(one) for one in inputs["geometry"][0])
    x0, y0, x1, y1 = object_box(window[..., 3])
    center, side = ((x0 + x1) / 2.0, (y0 + y1) / 2.0), CROP_MARGIN * max(x1 - x0, y1 - y0)
    image = np.clip(sample_window(window[..., :3].clip(max=1.0), window[..., 3], center, side, size), 0.0, 1.0)
    focal = max(width, height) / 2.0 / float(inputs["lens"][0, 0])
    x, y = left + step * center[0], top + step * center[1]
    ray = PinholeCamera(width=int(width), height=int(height), focal=focal).ray((x, y))
    # away from the photo's centre a pixel takes in less: by cos^2 along the radius, by cos across it
    tan_half = step * side / 2 / focal * (-ray[2]) ** 1.5
    return Crop(image=image, camera_from_crop=turn_towards(ray), center_px=(x, y), tan_half=float(tan_half))


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

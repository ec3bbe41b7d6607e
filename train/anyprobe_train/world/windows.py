"""Pictures over windows of a photo's plane."""

import cv2
import numpy as np

Window = tuple[float, float, float, float]
"""A part of the photo's plane: left, right, top, bottom [tangents], y up."""


def warped(values: np.ndarray, matrix: np.ndarray, rows: int, columns: int, samples: int, border: int) -> np.ndarray:
    """Return values [S, T, C] where a homography [3, 3] of pixel edges says that each pixel of [rows, columns, C] lies,
    bilinear, the mean of samples^2 points; border: cv2's name of what is beyond them."""
    fine = np.diag([1 / samples, 1 / samples, 1.0]) @ [[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]]
    middles = np.array([[1.0, 0.0, -0.5], [0.0, 1.0, -0.5], [0.0, 0.0, 1.0]])
    size, how = (columns * samples, rows * samples), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    out = cv2.warpPerspective(values, middles @ matrix @ fine, size, flags=how, borderMode=border)
    return out if samples == 1 else cv2.resize(out, (columns, rows), interpolation=cv2.INTER_AREA)


def window_resampled(values: np.ndarray, old: Window, new: Window, size: int, samples: int) -> np.ndarray:
    """Return values [S, T, C] over a window `old` of the plane at those of another, [size, size, C]: bilinear, the mean
    of samples^2 points; the border goes on."""
    x, y = values.shape[1] / (old[1] - old[0]), values.shape[0] / (old[3] - old[2])
    across = [x * (new[1] - new[0]) / size, 0.0, x * (new[0] - old[0])]
    down = [0.0, y * (new[3] - new[2]) / size, y * (new[2] - old[2])]
    matrix = np.array([across, down, [0.0, 0.0, 1.0]])
    return warped(values, matrix, size, size, samples, cv2.BORDER_REPLICATE)

"""Compiled kernels: pictures over windows of a photo's plane, and on the sphere."""

import cv2
import numpy as np

from anyprobe_train.world.march import compiled

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


@compiled
def on_sphere(context, most):
    """Return what a context picture shows beside the object on the sphere, [64, 128, 4] uint8: RGB x cover, cover;
    most: tangent of half the square as it is taken for."""
    rows, times, size = 64, 3, len(context)
    out = np.zeros((rows, 2 * rows, 4), np.uint8)
    free = np.zeros((size, size), np.float32)
    for i in range(size):
        for j in range(size):
            hidden = 0
            for a in range(max(i - 1, 0), min(i + 2, size)):
                for b in range(max(j - 1, 0), min(j + 2, size)):
                    hidden = max(hidden, context[a, b, 3])
            free[i, j] = context[i, j, 4] / 255.0 * (1 - hidden / 255.0)
    turn = ((np.arange(2 * rows * times) + 0.5) / (2 * rows * times) - 0.5) * 2 * np.pi
    sine, cosine = np.sin(turn), np.cos(turn)
    for i in range(rows):
        for j in range(rows // 2, 3 * rows // 2):  # before the camera
            r = g = b = cover = 0.0
            for a in range(times):
                v = (i + (a + 0.5) / times) / rows * np.pi
                high, flat = np.cos(v), np.sin(v)
                for c in range(j * times, (j + 1) * times):
                    z = flat * cosine[c]
                    if z < 0.05:
                        continue
                    x, y = flat * sine[c] / z / most, high / z / most
                    if abs(x) >= 1 or abs(y) >= 1:
                        continue
                    column, row = int((x + 1) * size / 2), int((1 - y) * size / 2)
                    w = free[row, column]
                    inside = max(context[row, column, 4] / 255.0, 1e-3)
                    r += w * context[row, column, 0] / inside
                    g += w * context[row, column, 1] / inside
                    b += w * context[row, column, 2] / inside
                    cover += w
            n = times * times
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = (
                min(r / n, 255.0) + 0.5,
                min(g / n, 255.0) + 0.5,
                min(b / n, 255.0) + 0.5,
            )
            out[i, j, 3] = 255 * cover / n + 0.5
    return out

"""Compiled kernels: pictures over windows of a photo's plane, and on the sphere."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, error_model="numpy")
def resampled(values, turn, tangent, x0, x1, y0, y1, size, samples, first, last, left, right):
    """Return a view's values [V, V, C] over a window of a photo's plane, [size, size, C], zero beyond the view.

    turn: view_from_photo [3, 3]. x0, x1, y0, y1: tangents of left, right, top and bottom. samples: of a pixel each way;
    only rows and columns first to last, left to right of the result are filled.
    """
    side, channels = len(values), values.shape[2]
    out = np.zeros((size, size, channels), np.float32)
    for i in range(first, last):
        for j in range(left, right):
            for a in range(samples):
                for b in range(samples):
                    x = x0 + (x1 - x0) * (j + (b + 0.5) / samples) / size
                    y = y0 + (y1 - y0) * (i + (a + 0.5) / samples) / size
                    p = turn[0, 0] * x + turn[0, 1] * y - turn[0, 2]
                    q = turn[1, 0] * x + turn[1, 1] * y - turn[1, 2]
                    r = -(turn[2, 0] * x + turn[2, 1] * y - turn[2, 2])
                    if r <= 1e-3:
                        continue
                    c = (p / r / tangent + 1) * side / 2 - 0.5
                    d = (1 - q / r / tangent) * side / 2 - 0.5
                    if c <= -1 or d <= -1 or c >= side or d >= side:
                        continue
                    c0, d0 = int(math.floor(c)), int(math.floor(d))
                    fc, fd = c - c0, d - d0
                    for k in range(4):
                        u, v = c0 + k % 2, d0 + k // 2
                        w = (fc if k % 2 else 1 - fc) * (fd if k // 2 else 1 - fd)
                        if 0 <= u < side and 0 <= v < side:
                            for n in range(channels):
                                out[i, j, n] += w * values[v, u, n]
    return out / (samples * samples)


@njit(cache=True, error_model="numpy")
def window_resampled(values, old, new, size, samples):
    """Return values [S, T, C] over a window `old` (left, right, top, bottom) of the plane at those of another, [size,
    size, C]: bilinear, the mean of samples^2 points; the border goes on."""
    rows, columns, channels = values.shape
    out = np.zeros((size, size, channels), np.float32)
    for i in range(size):
        for j in range(size):
            for a in range(samples):
                for b in range(samples):
                    x = new[0] + (new[1] - new[0]) * (j + (b + 0.5) / samples) / size
                    y = new[2] + (new[3] - new[2]) * (i + (a + 0.5) / samples) / size
                    c = (x - old[0]) / (old[1] - old[0]) * columns - 0.5
                    r = (y - old[2]) / (old[3] - old[2]) * rows - 0.5
                    c, r = min(max(c, 0.0), columns - 1.001), min(max(r, 0.0), rows - 1.001)
                    c0, r0 = int(c), int(r)
                    fc, fr = c - c0, r - r0
                    for n in range(channels):
                        out[i, j, n] += (1 - fr) * ((1 - fc) * values[r0, c0, n] + fc * values[r0, c0 + 1, n]) + fr * (
                            (1 - fc) * values[r0 + 1, c0, n] + fc * values[r0 + 1, c0 + 1, n]
                        )
    return out / (samples * samples)


@njit(cache=True, error_model="numpy")
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
    for i in range(rows):
        for j in range(2 * rows):
            r = g = b = cover = 0.0
            for a in range(times):
                v = (i + (a + 0.5) / times) / rows * np.pi
                for c in range(times):
                    u = ((j + (c + 0.5) / times) / (2 * rows) - 0.5) * 2 * np.pi
                    z = np.sin(v) * np.cos(u)
                    if z < 0.05:
                        continue
                    x, y = np.sin(v) * np.sin(u) / z / most, np.cos(v) / z / most
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

"""render.voxels.blocked for one ray, compiled: a photo asks for 100,000, which NumPy would take seconds for."""

import math

import numpy as np
from numba import njit

CELLS_SIDE = 64
compiled = njit(cache=True, error_model="numpy", fastmath=True)
"""Decorator of kernels; nothing in them is infinite or no number."""


@compiled
def blocked_cells(words, x, y, z, dx, dy, dz, most):
    """Return where a ray in cells meets an occupied one, as a multiple of its direction below `most`; else -1."""
    if abs(dx) < 1e-9:
        dx = 1e-9
    if abs(dy) < 1e-9:
        dy = 1e-9
    if abs(dz) < 1e-9:
        dz = 1e-9
    wx, wy, wz = 1.0 / dx, 1.0 / dy, 1.0 / dz
    ax, bx = -x * wx, (CELLS_SIDE - x) * wx
    ay, by = -y * wy, (CELLS_SIDE - y) * wy
    az, bz = -z * wz, (CELLS_SIDE - z) * wz
    t = max(0.0, min(ax, bx), min(ay, by), min(az, bz))
    last = min(max(ax, bx), max(ay, by), max(az, bz), most)
    if t >= last:
        return -1.0
    column = min(max(int(math.floor(x + t * dx)), 0), CELLS_SIDE - 1)
    row = min(max(int(math.floor(z + t * dz)), 0), CELLS_SIDE - 1)
    sx, sz = (1 if dx > 0 else -1), (1 if dz > 0 else -1)
    tx = (column + (1 if dx > 0 else 0) - x) * wx
    tz = (row + (1 if dz > 0 else 0) - z) * wz
    wx, wz = abs(wx), abs(wz)
    while True:
        leave = min(tx, tz, last)
        h0, h1 = y + t * dy, y + leave * dy
        if h0 > h1:
            h0, h1 = h1, h0
        bottom = min(max(int(math.floor(h0)), 0), CELLS_SIDE - 1)
        top = min(max(int(math.floor(h1)), 0), CELLS_SIDE - 1)
        mask = (np.uint64(0xFFFFFFFFFFFFFFFF) >> np.uint64(CELLS_SIDE - 1 - top)) & (
            np.uint64(0xFFFFFFFFFFFFFFFF) << np.uint64(bottom)
        )
        if words[row, column] & mask:
            return t
        if leave >= last:
            return -1.0
        t = leave
        if tx <= tz:
            column += sx
            tx += wx
            if column < 0 or column >= CELLS_SIDE:
                return -1.0
        else:
            row += sz
            tz += wz
            if row < 0 or row >= CELLS_SIDE:
                return -1.0


@compiled
def hidden_bits(words, low, cell, points, normals, azimuths, rings, own, seed):
    """Return bits [N, 2] uint64 of the cells about +Y, each by one jittered ray, that a shape hides from points [N, 3]
    of itself; rays start `own` before the surface along the normal."""
    np.random.seed(seed)
    result = np.zeros((len(points), 2), np.uint64)
    for k in range(len(points)):
        nx, ny, nz = normals[k]
        x, y, z = points[k]
        x, y, z = (
            (x + own * nx - low[0]) / cell[0],
            (y + own * ny - low[1]) / cell[1],
            (z + own * nz - low[2]) / cell[2],
        )
        for ring in range(rings):
            for azimuth in range(azimuths):
                sine = (ring + np.random.random()) * 2 / rings - 1
                angle = (azimuth + np.random.random()) * 2 * math.pi / azimuths
                cosine = math.sqrt(max(1 - sine * sine, 0.0))
                dx, dy, dz = cosine * math.sin(angle), sine, -cosine * math.cos(angle)
                if dx * nx + dy * ny + dz * nz <= 0:
                    continue
                if blocked_cells(words, x, y, z, dx / cell[0], dy / cell[1], dz / cell[2], 1e9) >= 0:
                    c = ring * azimuths + azimuth
                    result[k, c >> 6] |= np.uint64(1) << np.uint64(c & 63)
    return result

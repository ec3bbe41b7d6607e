"""Compiled kernels: what rays hit in a TracedScene (f, i, w, q: its arrays)."""

from __future__ import annotations

import math

from numba import njit

from anyprobe_train.world.march import blocked_cells
from anyprobe_train.world.scene import (
    AT,
    BODIES,
    BODY,
    BODY_CELL,
    BODY_SIZE,
    EYE,
    FALLING,
    GRID_POINTS,
    GRID_SPREAD,
    GROUND,
    HALF,
    IS_BALL,
    LIGHT,
    LOW,
    MIDDLE,
    MIRRORED_SIDE,
    NORMAL,
    ORIGIN,
    PANEL,
    PANEL_SIZE,
    PANELS,
    PICTURE,
    PICTURE_SIDE,
    PLACE,
    POWER,
    RADIUS,
    RIGHT,
    SCALE,
    SKY_ROWS,
    SOURCE,
    SOURCE_SIZE,
    TEXELS,
    TURN,
    UP,
)

FAR_AWAY = 1e9
LEAST_ALBEDO, MOST_ALBEDO = 0.03, 0.8
"""Bounds of the albedo of a map's own ground."""
FULL, REST = 0, 1
"""Parts of the sky: all of it, and without its sources."""


@njit(cache=True, error_model="numpy")
def sky_at(i, q, part, level, x, y, z):
    """Return radiance along a unit direction of a level of the sky, with sources (FULL) or without (REST), bilinear."""
    start, size = part * i[TEXELS], i[SKY_ROWS]
    for _ in range(level):
        start += 2 * size * size
        size //= 2
    column = (0.5 + math.atan2(x, -z) / (2.0 * math.pi)) * 2 * size - 0.5
    row = min(max(math.acos(min(max(y, -1.0), 1.0)) / math.pi * size - 0.5, 0.0), size - 1.0)
    c0, r0 = int(math.floor(column)), int(row)
    fc, fr = column - c0, row - r0
    c1, r1 = (c0 + 1) % (2 * size), min(r0 + 1, size - 1)
    c0 = c0 % (2 * size)
    a, b = start + r0 * 2 * size, start + r1 * 2 * size
    w0, w1, w2, w3 = (1 - fc) * (1 - fr), fc * (1 - fr), (1 - fc) * fr, fc * fr
    return (
        w0 * q[a + c0, 0] + w1 * q[a + c1, 0] + w2 * q[b + c0, 0] + w3 * q[b + c1, 0],
        w0 * q[a + c0, 1] + w1 * q[a + c1, 1] + w2 * q[b + c0, 1] + w3 * q[b + c1, 1],
        w0 * q[a + c0, 2] + w1 * q[a + c1, 2] + w2 * q[b + c0, 2] + w3 * q[b + c1, 2],
    )


@njit(cache=True, error_model="numpy")
def hit_body(f, i, w, number, ox, oy, oz, dx, dy, dz, most):
    """Return the distance at which a ray meets a body, or -1."""
    b = i[BODY] + number * BODY_SIZE
    s = f[b + SCALE]
    c, e = f[b + TURN], f[b + TURN + 1]
    px, py, pz = ox - f[b + PLACE], oy - f[b + PLACE + 1], oz - f[b + PLACE + 2]
    lx, lz = (c * px - e * pz) / s, (e * px + c * pz) / s  # R_y(-turn)
    kx, kz = (c * dx - e * dz) / s, (e * dx + c * dz) / s
    return blocked_cells(
        w[number],
        (lx - f[b + LOW]) / f[b + BODY_CELL],
        (py / s - f[b + LOW + 1]) / f[b + BODY_CELL + 1],
        (lz - f[b + LOW + 2]) / f[b + BODY_CELL + 2],
        kx / f[b + BODY_CELL],
        dy / s / f[b + BODY_CELL + 1],
        kz / f[b + BODY_CELL + 2],
        most,
    )


@njit(cache=True, error_model="numpy")
def hit_panel(f, i, ox, oy, oz, dx, dy, dz, most, without):
    """Return the nearest panel that a ray meets before `most`, its distance, and x, y on it; -1 if none."""
    best, distance, bx, by = -1, most, 0.0, 0.0
    for number in range(i[PANELS]):
        if number == without:
            continue
        p = i[PANEL] + number * PANEL_SIZE
        slope = f[p + NORMAL] * dx + f[p + NORMAL + 1] * dy + f[p + NORMAL + 2] * dz
        if abs(slope) < 1e-7:
            continue
        ax, ay, az = f[p + ORIGIN] - ox, f[p + ORIGIN + 1] - oy, f[p + ORIGIN + 2] - oz
        t = (f[p + NORMAL] * ax + f[p + NORMAL + 1] * ay + f[p + NORMAL + 2] * az) / slope
        if t <= 1e-4 or t >= distance:
            continue
        qx, qy, qz = t * dx - ax, t * dy - ay, t * dz - az
        x = qx * f[p + RIGHT] + qy * f[p + RIGHT + 1] + qz * f[p + RIGHT + 2]
        y = qx * f[p + UP] + qy * f[p + UP + 1] + qz * f[p + UP + 2]
        if abs(x) <= f[p + HALF] and abs(y) <= f[p + HALF + 1]:
            best, distance, bx, by = number, t, x, y
    return best, distance, bx, by


@njit(cache=True, error_model="numpy")
def bilinear_at(f, start, size, column, row):
    """Return a picture's value [size, size, 3] that begins at `start`, between pixels."""
    column, row = min(max(column, 0.0), size - 1.001), min(max(row, 0.0), size - 1.001)
    c, r = int(column), int(row)
    fc, fr = column - c, row - r
    a = start + (r * size + c) * 3
    b = a + size * 3
    w0, w1, w2, w3 = (1 - fc) * (1 - fr), fc * (1 - fr), (1 - fc) * fr, fc * fr
    return (
        w0 * f[a] + w1 * f[a + 3] + w2 * f[b] + w3 * f[b + 3],
        w0 * f[a + 1] + w1 * f[a + 4] + w2 * f[b + 1] + w3 * f[b + 4],
        w0 * f[a + 2] + w1 * f[a + 5] + w2 * f[b + 2] + w3 * f[b + 5],
    )


@njit(cache=True, error_model="numpy")
def grid_start(i, number, kind):
    """Return where a panel's grid of a kind begins."""
    return i[LIGHT] + (number * 3 + kind) * GRID_POINTS * GRID_POINTS * 3


@njit(cache=True, error_model="numpy")
def grid_at(f, i, number, kind, x, y):
    """Return the irradiance of a panel's grid at x, y on it."""
    p = i[PANEL] + number * PANEL_SIZE
    spread = f[p + GRID_SPREAD]
    x, y = x - f[p + MIDDLE], y - f[p + MIDDLE + 1]
    column = (x / (abs(x) + spread) + 1) * (GRID_POINTS / 2) - 0.5
    row = (y / (abs(y) + spread) + 1) * (GRID_POINTS / 2) - 0.5
    return bilinear_at(f, grid_start(i, number, kind), GRID_POINTS, column, row)


@njit(cache=True, error_model="numpy")
def panel_point(f, i, number, column, row):
    """Return x, y on a panel of a point of its grids: dense around the middle, the outermost far away; inside it."""
    p = i[PANEL] + number * PANEL_SIZE
    g, h = (column + 0.5) / (GRID_POINTS / 2) - 1, (row + 0.5) / (GRID_POINTS / 2) - 1
    x = f[p + MIDDLE] + f[p + GRID_SPREAD] * g / (1 - abs(g))
    y = f[p + MIDDLE + 1] + f[p + GRID_SPREAD] * h / (1 - abs(h))
    a, b = 0.999 * f[p + HALF], 0.999 * f[p + HALF + 1]
    return min(max(x, -a), a), min(max(y, -b), b)


@njit(cache=True, error_model="numpy")
def albedo_at(f, i, q, number, x, y, px, py, pz):
    """Return the albedo of a panel at x, y on it, which is p in the world."""
    p = i[PANEL] + number * PANEL_SIZE
    if f[p + GROUND] > 0:
        dx, dy, dz = px - f[EYE], py - f[EYE + 1], pz - f[EYE + 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        r, g, b = sky_at(i, q, FULL, 1, dx / length, dy / length, dz / length)
        return (
            min(max(r * math.pi / f[FALLING], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(g * math.pi / f[FALLING + 1], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(b * math.pi / f[FALLING + 2], LEAST_ALBEDO), MOST_ALBEDO),
        )
    size = i[PICTURE_SIDE]
    a, b = x / f[p + MIRRORED_SIDE], y / f[p + MIRRORED_SIDE]
    a, b = abs(a - 2 * math.floor((a + 1) / 2)), abs(b - 2 * math.floor((b + 1) / 2))  # mirrored: 0 to 1
    return bilinear_at(f, i[PICTURE] + number * size * size * 3, size, a * size - 0.5, b * size - 0.5)


@njit(cache=True, error_model="numpy")
def is_blocked(f, i, w, first, ox, oy, oz, dx, dy, dz, most):
    """Return whether a body from number `first` on hides what lies along a ray."""
    for b in range(first, i[BODIES]):
        if hit_body(f, i, w, b, ox, oy, oz, dx, dy, dz, most) >= 0.0:
            return True
    return False


@njit(cache=True, error_model="numpy")
def toward_source(f, i, number, ox, oy, oz):
    """Return a direction to a source, irradiance on what faces it, the tangent of its radius, and its distance."""
    s = i[SOURCE] + number * SOURCE_SIZE
    if f[s + IS_BALL] == 0:
        return (
            f[s + AT],
            f[s + AT + 1],
            f[s + AT + 2],
            f[s + POWER],
            f[s + POWER + 1],
            f[s + POWER + 2],
            math.tan(f[s + RADIUS]),
            FAR_AWAY,
        )
    dx, dy, dz = f[s + AT] - ox, f[s + AT + 1] - oy, f[s + AT + 2] - oz
    distance = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1.001 * f[s + RADIUS])
    sine = f[s + RADIUS] / distance
    e = math.pi * sine * sine
    tangent = sine / math.sqrt(max(1 - sine * sine, 1e-6))
    return (
        dx / distance,
        dy / distance,
        dz / distance,
        e * f[s + POWER],
        e * f[s + POWER + 1],
        e * f[s + POWER + 2],
        tangent,
        distance,
    )


@njit(cache=True, error_model="numpy")
def basis(x, y, z):
    """Return two unit vectors across a unit one."""
    sign = 1.0 if z >= 0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return 1.0 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y

"""Compiled kernels: what rays hit in a TracedScene (f, i, w, q: its arrays)."""

import math

import numpy as np

from anyprobe_train.world import scene as at
from anyprobe_train.world.march import blocked_cells, compiled

FAR_AWAY = 1e9
LEAST_ALBEDO, MOST_ALBEDO = 0.03, 0.8
"""Bounds of the albedo of a map's own ground."""
LEAST_ROWS = 8
"""Rows of the last level of a sky."""
FULL, REST = 0, 1
"""Parts of the sky: all of it, and without its sources."""


TURNS = np.stack([np.cos(np.arange(1024) * math.pi / 512), np.sin(np.arange(1024) * math.pi / 512)], axis=1)
"""Cosine and sine of even steps around a circle."""


@compiled
def random(number):
    """Return a number in [0, 1) that is a function of a whole one, neighbours as if drawn anew."""
    x = np.uint64(number) * np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    return np.float64((x ^ (x >> np.uint64(32))) >> np.uint64(11)) * 2.0**-53


@compiled
def in_disc(number, k, count):
    """Return x, y of point k of `count` that fill a unit disc evenly (Vogel's spiral), turned and moved at random."""
    scaled = 1024 * random(number)
    turn = int(scaled)
    radius = math.sqrt((k + scaled - turn) / count)
    turn = (turn + 633 * k) & 1023  # the golden angle
    return radius * TURNS[turn, 0], radius * TURNS[turn, 1]


@compiled
def angle_of(y, x):
    """Return atan2(y, x) to 1e-5 rad, by a polynomial."""
    a, b = abs(x), abs(y)
    q = min(a, b) / max(a, b, 1e-30)
    s = q * q
    c = -0.11643287 + s * (0.05265332 - s * 0.0117212)
    angle = q * (0.99997726 + s * (-0.33262347 + s * (0.19354346 + s * c)))
    angle = 0.5 * math.pi - angle if b > a else angle
    angle = math.pi - angle if x < 0 else angle
    return -angle if y < 0 else angle


@compiled
def polar_angle(y):
    """Return acos(y) to 7e-5 rad (Abramowitz and Stegun 4.4.45)."""
    a = min(abs(y), 1.0)
    angle = math.sqrt(1.0 - a) * (1.5707288 + a * (-0.2121144 + a * (0.074261 - a * 0.0187293)))
    return math.pi - angle if y < 0 else angle


@compiled
def level_of(texels, rows):
    """Return the level of a sky, whose first has so many rows, one of whose texels is as large as so many there."""
    level = 0
    while texels > 2.0 and rows >> level > LEAST_ROWS:
        texels, level = 0.25 * texels, level + 1
    return level


@compiled
def sky_at(i, q, part, level, x, y, z):
    """Return radiance along a unit direction of a level of the sky, with sources (FULL) or without (REST), bilinear."""
    size = i[at.SKY_ROWS] >> level
    start = part * i[at.TEXELS] + 8 * (i[at.SKY_ROWS] * i[at.SKY_ROWS] - size * size) // 3
    column = (0.5 + angle_of(x, -z) * (0.5 / math.pi)) * 2 * size - 0.5
    row = min(max(polar_angle(y) * (size / math.pi) - 0.5, 0.0), size - 1.0)
    c0, r0 = int(math.floor(column)), int(row)
    fc, fr = column - c0, row - r0
    c1, r1 = (c0 + 1) & (2 * size - 1), min(r0 + 1, size - 1)
    c0 = c0 & (2 * size - 1)
    a, b = start + r0 * 2 * size, start + r1 * 2 * size
    w0, w1, w2, w3 = (1 - fc) * (1 - fr), fc * (1 - fr), (1 - fc) * fr, fc * fr
    return (
        w0 * q[a + c0, 0] + w1 * q[a + c1, 0] + w2 * q[b + c0, 0] + w3 * q[b + c1, 0],
        w0 * q[a + c0, 1] + w1 * q[a + c1, 1] + w2 * q[b + c0, 1] + w3 * q[b + c1, 1],
        w0 * q[a + c0, 2] + w1 * q[a + c1, 2] + w2 * q[b + c0, 2] + w3 * q[b + c1, 2],
    )


@compiled
def hit_body(f, i, w, number, ox, oy, oz, dx, dy, dz, most):
    """Return the distance at which a ray meets a body, or -1."""
    b = i[at.BODY] + number * at.BODY_SIZE
    x, y, z = f[b + at.BALL] - ox, f[b + at.BALL + 1] - oy, f[b + at.BALL + 2] - oz
    along, away = x * dx + y * dy + z * dz, x * x + y * y + z * z
    if away > f[b + at.BALL + 3] and (
        along < 0 or away - along * along / (dx * dx + dy * dy + dz * dz) > f[b + at.BALL + 3]
    ):
        return -1.0
    m = b + at.CELLS_FROM_WORLD
    return blocked_cells(
        w[number],
        f[m] * ox + f[m + 1] * oy + f[m + 2] * oz + f[m + 3],
        f[m + 4] * ox + f[m + 5] * oy + f[m + 6] * oz + f[m + 7],
        f[m + 8] * ox + f[m + 9] * oy + f[m + 10] * oz + f[m + 11],
        f[m] * dx + f[m + 1] * dy + f[m + 2] * dz,
        f[m + 4] * dx + f[m + 5] * dy + f[m + 6] * dz,
        f[m + 8] * dx + f[m + 9] * dy + f[m + 10] * dz,
        most,
    )


@compiled
def hit_panel(f, i, ox, oy, oz, dx, dy, dz, most, without):
    """Return the nearest panel that a ray meets before `most`, its distance, and x, y on it; -1 if none."""
    best, distance, bx, by = -1, most, 0.0, 0.0
    for number in range(i[at.PANELS]):
        if number == without:
            continue
        p = i[at.PANEL] + number * at.PANEL_SIZE
        slope = f[p + at.NORMAL] * dx + f[p + at.NORMAL + 1] * dy + f[p + at.NORMAL + 2] * dz
        if abs(slope) < 1e-7:
            continue
        ax, ay, az = f[p + at.ORIGIN] - ox, f[p + at.ORIGIN + 1] - oy, f[p + at.ORIGIN + 2] - oz
        t = (f[p + at.NORMAL] * ax + f[p + at.NORMAL + 1] * ay + f[p + at.NORMAL + 2] * az) / slope
        if t <= 1e-4 or t >= distance:
            continue
        qx, qy, qz = t * dx - ax, t * dy - ay, t * dz - az
        x = qx * f[p + at.RIGHT] + qy * f[p + at.RIGHT + 1] + qz * f[p + at.RIGHT + 2]
        y = qx * f[p + at.UP] + qy * f[p + at.UP + 1] + qz * f[p + at.UP + 2]
        if abs(x) <= f[p + at.HALF] and abs(y) <= f[p + at.HALF + 1]:
            best, distance, bx, by = number, t, x, y
    return best, distance, bx, by


@compiled
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


@compiled
def grid_start(i, number, kind):
    """Return where a panel's grid of a kind begins."""
    return i[at.LIGHT] + (number * 3 + kind) * at.GRID_POINTS * at.GRID_POINTS * 3


@compiled
def grid_at(f, i, number, kind, x, y):
    """Return the irradiance of a panel's grid at x, y on it."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    spread = f[p + at.GRID_SPREAD]
    x, y = x - f[p + at.MIDDLE], y - f[p + at.MIDDLE + 1]
    column = (x / (abs(x) + spread) + 1) * (at.GRID_POINTS / 2) - 0.5
    row = (y / (abs(y) + spread) + 1) * (at.GRID_POINTS / 2) - 0.5
    return bilinear_at(f, grid_start(i, number, kind), at.GRID_POINTS, column, row)


@compiled
def panel_point(f, i, number, column, row):
    """Return x, y on a panel of a point of its grids: dense around the middle, the outermost far away; inside it."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    g, h = (column + 0.5) / (at.GRID_POINTS / 2) - 1, (row + 0.5) / (at.GRID_POINTS / 2) - 1
    x = f[p + at.MIDDLE] + f[p + at.GRID_SPREAD] * g / (1 - abs(g))
    y = f[p + at.MIDDLE + 1] + f[p + at.GRID_SPREAD] * h / (1 - abs(h))
    a, b = 0.999 * f[p + at.HALF], 0.999 * f[p + at.HALF + 1]
    return min(max(x, -a), a), min(max(y, -b), b)


@compiled
def albedo_at(f, i, q, number, x, y, px, py, pz):
    """Return the albedo of a panel at x, y on it, which is p in the world."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    if f[p + at.GROUND] > 0:
        dx, dy, dz = px - f[at.EYE], py - f[at.EYE + 1], pz - f[at.EYE + 2]
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        r, g, b = sky_at(i, q, FULL, 1, dx / length, dy / length, dz / length)
        return (
            min(max(r * math.pi / f[at.FALLING], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(g * math.pi / f[at.FALLING + 1], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(b * math.pi / f[at.FALLING + 2], LEAST_ALBEDO), MOST_ALBEDO),
        )
    size = i[at.PICTURE_SIDE]
    a, b = x / f[p + at.MIRRORED_SIDE], y / f[p + at.MIRRORED_SIDE]
    a, b = abs(a - 2 * math.floor((a + 1) / 2)), abs(b - 2 * math.floor((b + 1) / 2))  # mirrored: 0 to 1
    return bilinear_at(f, i[at.PICTURE] + number * size * size * 3, size, a * size - 0.5, b * size - 0.5)


@compiled
def is_blocked(f, i, w, first, ox, oy, oz, dx, dy, dz, most):
    """Return whether a body from number `first` on hides what lies along a ray."""
    for b in range(first, i[at.BODIES]):
        if hit_body(f, i, w, b, ox, oy, oz, dx, dy, dz, most) >= 0.0:
            return True
    return False


@compiled
def toward_source(f, i, number, ox, oy, oz):
    """Return a direction to a source, irradiance on what faces it, the tangent of its radius, and its distance."""
    s = i[at.SOURCE] + number * at.SOURCE_SIZE
    if f[s + at.IS_BALL] == 0:
        return (
            f[s + at.AT],
            f[s + at.AT + 1],
            f[s + at.AT + 2],
            f[s + at.POWER],
            f[s + at.POWER + 1],
            f[s + at.POWER + 2],
            f[s + at.RADIUS],
            FAR_AWAY,
        )
    dx, dy, dz = f[s + at.AT] - ox, f[s + at.AT + 1] - oy, f[s + at.AT + 2] - oz
    distance = max(math.sqrt(dx * dx + dy * dy + dz * dz), 1.001 * f[s + at.RADIUS])
    sine = f[s + at.RADIUS] / distance
    e = math.pi * sine * sine
    tangent = sine / math.sqrt(max(1 - sine * sine, 1e-6))
    return (
        dx / distance,
        dy / distance,
        dz / distance,
        e * f[s + at.POWER],
        e * f[s + at.POWER + 1],
        e * f[s + at.POWER + 2],
        tangent,
        distance,
    )


@compiled
def basis(x, y, z):
    """Return two unit vectors across a unit one."""
    sign = 1.0 if z >= 0 else -1.0
    a = -1.0 / (sign + z)
    b = x * y * a
    return 1.0 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y

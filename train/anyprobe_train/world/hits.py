"""Compiled kernels: what rays hit in a TracedScene (f, i, w, q: its arrays)."""

import math

import numpy as np

from anyprobe_train.world import scene as at
from anyprobe_train.world.march import blocked_cells, compiled
from anyprobe_train.world.vectors import between, dot, minus, row_of, scaled, unit, vector

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
def sky_at(i, q, part, level, d):
    """Return radiance along a unit direction of a level of the sky, with sources (FULL) or without (REST), bilinear."""
    size = i[at.SKY_ROWS] >> level
    start = part * i[at.TEXELS] + 8 * (i[at.SKY_ROWS] * i[at.SKY_ROWS] - size * size) // 3
    column = (0.5 + angle_of(d[0], -d[2]) * (0.5 / math.pi)) * 2 * size - 0.5
    row = min(max(polar_angle(d[1]) * (size / math.pi) - 0.5, 0.0), size - 1.0)
    c0, r0 = int(math.floor(column)), int(row)
    fc, fr = column - c0, row - r0
    c1, r1 = (c0 + 1) & (2 * size - 1), min(r0 + 1, size - 1)
    c0 = c0 & (2 * size - 1)
    a, b = start + r0 * 2 * size, start + r1 * 2 * size
    return between(fc, fr, row_of(q, a + c0), row_of(q, a + c1), row_of(q, b + c0), row_of(q, b + c1))


@compiled
def hit_body(f, i, w, number, o, d, most):
    """Return the distance at which a ray meets a body, or -1."""
    b = i[at.BODY] + number * at.BODY_SIZE
    away = minus(vector(f, b + at.BALL), o)
    along, square = dot(away, d), dot(away, away)
    if square > f[b + at.BALL + 3] and (along < 0 or square - along * along / dot(d, d) > f[b + at.BALL + 3]):
        return -1.0
    m = b + at.CELLS_FROM_WORLD
    x, y, z = vector(f, m), vector(f, m + 4), vector(f, m + 8)
    place = dot(x, o) + f[m + 3], dot(y, o) + f[m + 7], dot(z, o) + f[m + 11]
    return blocked_cells(w[number], *place, dot(x, d), dot(y, d), dot(z, d), most)


@compiled
def hit_panel(f, i, o, d, most, without):
    """Return the nearest panel that a ray meets before `most`, its distance, and x, y on it; -1 if none."""
    best, distance, bx, by = -1, most, 0.0, 0.0
    for number in range(i[at.PANELS]):
        if number == without:
            continue
        p = i[at.PANEL] + number * at.PANEL_SIZE
        normal = vector(f, p + at.NORMAL)
        slope = dot(normal, d)
        if abs(slope) < 1e-7:
            continue
        away = minus(vector(f, p + at.ORIGIN), o)
        t = dot(normal, away) / slope
        if t <= 1e-4 or t >= distance:
            continue
        place = minus(scaled(t, d), away)
        x, y = dot(place, vector(f, p + at.RIGHT)), dot(place, vector(f, p + at.UP))
        if abs(x) <= f[p + at.HALF] and abs(y) <= f[p + at.HALF + 1]:
            best, distance, bx, by = number, t, x, y
    return best, distance, bx, by


@compiled
def bilinear_at(f, start, size, column, row):
    """Return a picture's value [size, size, 3] that begins at `start`, between pixels."""
    column, row = min(max(column, 0.0), size - 1.001), min(max(row, 0.0), size - 1.001)
    c, r = int(column), int(row)
    a = start + (r * size + c) * 3
    b = a + size * 3
    return between(column - c, row - r, vector(f, a), vector(f, a + 3), vector(f, b), vector(f, b + 3))


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
def albedo_at(f, i, q, number, x, y, place):
    """Return the albedo of a panel at x, y on it, which is a place in the world."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    if f[p + at.GROUND] > 0:
        light = sky_at(i, q, FULL, 1, unit(minus(place, vector(f, at.EYE))))
        return (
            min(max(light[0] * math.pi / f[at.FALLING], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(light[1] * math.pi / f[at.FALLING + 1], LEAST_ALBEDO), MOST_ALBEDO),
            min(max(light[2] * math.pi / f[at.FALLING + 2], LEAST_ALBEDO), MOST_ALBEDO),
        )
    size = i[at.PICTURE_SIDE]
    a, b = x / f[p + at.MIRRORED_SIDE], y / f[p + at.MIRRORED_SIDE]
    a, b = abs(a - 2 * math.floor((a + 1) / 2)), abs(b - 2 * math.floor((b + 1) / 2))  # mirrored: 0 to 1
    return bilinear_at(f, i[at.PICTURE] + number * size * size * 3, size, a * size - 0.5, b * size - 0.5)


@compiled
def glow_of(f, i, number):
    """Return the mean radiance of a body."""
    return vector(f, i[at.BODY] + number * at.BODY_SIZE + at.GLOW)


@compiled
def first_hit(f, i, w, first, o, d, most):
    """Return the number of a body from `first` on that hides what lies along a ray, -1 if none does."""
    for b in range(first, i[at.BODIES]):
        if hit_body(f, i, w, b, o, d, most) >= 0.0:
            return b
    return -1


@compiled
def toward_source(f, i, number, o):
    """Return a direction to a source, irradiance on what faces it, the tangent of its radius, and its distance."""
    s = i[at.SOURCE] + number * at.SOURCE_SIZE
    place, power, radius = vector(f, s + at.AT), vector(f, s + at.POWER), f[s + at.RADIUS]
    if f[s + at.IS_BALL] == 0:
        return place, power, radius, FAR_AWAY
    away = minus(place, o)
    distance = max(math.sqrt(dot(away, away)), 1.001 * radius)
    sine = radius / distance
    tangent = sine / math.sqrt(max(1 - sine * sine, 1e-6))
    return scaled(1 / distance, away), scaled(math.pi * sine * sine, power), tangent, distance

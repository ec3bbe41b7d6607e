"""Compiled kernels: what rays see in a Scene (f, i, w, q: its arrays), and the light that falls on points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anyprobe_train.world.march import blocked_cells
from anyprobe_train.world.scene import (
    ALPHA,
    AT,
    BODIES,
    BODY,
    BODY_SIZE,
    CELL,
    EYE,
    F0,
    FALLING,
    FREE,
    GLOW,
    GRID,
    GROUND,
    HALF,
    LIGHT,
    LIT,
    LOW,
    MEAN,
    MIDDLE,
    NEAR,
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
    ROWS,
    SCALE,
    SIDE,
    SOURCE,
    SOURCE_SIZE,
    SOURCES,
    SPREAD,
    TEXELS,
    TURN,
    UP,
)

GATHERED = 7
"""Square root of the number of directions over a panel's point."""
SOURCE_RAYS = 3
"""Rays to a source from a panel's point."""
SPARSE = 2
"""Points of a grid that are skipped each way, but of the first panel's, which the object stands on."""
FAR = 1e9
COARSE_LEVEL = 4
"""Level of the map, of 16 rows, that soft light is gathered from."""
LEAST_ALBEDO, MOST_ALBEDO = 0.03, 0.8
"""Bounds of the albedo of a map's own ground."""
FULL, REST = 0, 1


@njit(cache=True, error_model="numpy")
def sky_at(i, q, part, level, x, y, z):
    """Return radiance along a unit direction of a level of the sky, with sources (FULL) or without (REST), bilinear."""
    start, size = part * i[TEXELS], i[ROWS]
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
        (lx - f[b + LOW]) / f[b + CELL],
        (py / s - f[b + LOW + 1]) / f[b + CELL + 1],
        (lz - f[b + LOW + 2]) / f[b + CELL + 2],
        kx / f[b + CELL],
        dy / s / f[b + CELL + 1],
        kz / f[b + CELL + 2],
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
    return i[LIGHT] + (number * 3 + kind) * GRID * GRID * 3


@njit(cache=True, error_model="numpy")
def grid_at(f, i, number, kind, x, y):
    """Return the irradiance of a panel's grid at x, y on it."""
    p = i[PANEL] + number * PANEL_SIZE
    spread = f[p + SPREAD]
    x, y = x - f[p + MIDDLE], y - f[p + MIDDLE + 1]
    column = (x / (abs(x) + spread) + 1) * (GRID / 2) - 0.5
    row = (y / (abs(y) + spread) + 1) * (GRID / 2) - 0.5
    return bilinear_at(f, grid_start(i, number, kind), GRID, column, row)


@njit(cache=True, error_model="numpy")
def panel_point(f, i, number, column, row):
    """Return x, y on a panel of a point of its grids: dense around the middle, the outermost far away; inside it."""
    p = i[PANEL] + number * PANEL_SIZE
    g, h = (column + 0.5) / (GRID / 2) - 1, (row + 0.5) / (GRID / 2) - 1
    x = f[p + MIDDLE] + f[p + SPREAD] * g / (1 - abs(g))
    y = f[p + MIDDLE + 1] + f[p + SPREAD] * h / (1 - abs(h))
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
    a, b = x / f[p + SIDE], y / f[p + SIDE]
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
    if f[s + NEAR] == 0:
        return (
            f[s + AT],
            f[s + AT + 1],
            f[s + AT + 2],
            f[s + POWER],
            f[s + POWER + 1],
            f[s + POWER + 2],
            math.tan(f[s + RADIUS]),
            FAR,
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


@njit(cache=True, error_model="numpy")
def seen_share(f, i, w, number, ox, oy, oz, nx, ny, nz, rays, without, own):
    """Return the shares of a source that a point sees past all but the object, and past all, by jittered rays, and its
    cosine. without: the panel that the point lies on; own: distance from the point that rays start at."""
    lx, ly, lz, _, _, _, tangent, distance = toward_source(f, i, number, ox, oy, oz)
    cosine = lx * nx + ly * ny + lz * nz
    if cosine < -tangent:
        return 0.0, 0.0, 0.0
    tx, ty, tz, ux, uy, uz = basis(lx, ly, lz)
    px, py, pz = ox + own * nx, oy + own * ny, oz + own * nz
    free, seen = 0, 0
    for _ in range(rays):
        reach, angle = tangent * math.sqrt(np.random.random()), 2 * math.pi * np.random.random()
        a, b = reach * math.cos(angle), reach * math.sin(angle)
        dx, dy, dz = lx + a * tx + b * ux, ly + a * ty + b * uy, lz + a * tz + b * uz
        length = 1 / math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx * length, dy * length, dz * length
        if dx * nx + dy * ny + dz * nz <= 0:
            continue
        panel, _, _, _ = hit_panel(f, i, px, py, pz, dx, dy, dz, distance, without)
        if panel >= 0 or is_blocked(f, i, w, 1, px, py, pz, dx, dy, dz, distance):
            continue
        free += 1
        if i[BODIES] > 0 and hit_body(f, i, w, 0, px, py, pz, dx, dy, dz, distance) >= 0:
            continue
        seen += 1
    return free / rays, seen / rays, max(cosine, 0.0)


@njit(cache=True, error_model="numpy")
def fall_on(f, i, w, q, number, ox, oy, oz, out):
    """Gather the light on point o of a panel's front into out [3, 3]: FREE, LIT and SOFT."""
    p = i[PANEL] + number * PANEL_SIZE
    nx, ny, nz = f[p + NORMAL], f[p + NORMAL + 1], f[p + NORMAL + 2]
    tx, ty, tz, ux, uy, uz = basis(nx, ny, nz)
    weight = math.pi / (GATHERED * GATHERED)
    out[:] = 0.0
    count = i[BODIES]
    for m in range(GATHERED):
        for n in range(GATHERED):
            a = (m + np.random.random()) / GATHERED
            angle = 2 * math.pi * (n + np.random.random()) / GATHERED
            r = math.sqrt(a)
            c, s, h = r * math.cos(angle), r * math.sin(angle), math.sqrt(1 - a)
            dx, dy, dz = c * tx + s * ux + h * nx, c * ty + s * uy + h * ny, c * tz + s * uz + h * nz
            panel, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR, number)
            hidden = -1
            for k in range(1, count):
                d = hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t)
                if d >= 0:
                    hidden, t = k, d
            if hidden > 0:
                g = i[BODY] + hidden * BODY_SIZE + GLOW
                lr, lg, lb = f[g], f[g + 1], f[g + 2]
            elif panel >= 0:
                lr, lg, lb = grid_at(f, i, panel, FREE, x, y)
                e = i[PANEL] + panel * PANEL_SIZE + MEAN
                lr, lg, lb = f[e] * lr / math.pi, f[e + 1] * lg / math.pi, f[e + 2] * lb / math.pi
            else:
                lr, lg, lb = sky_at(i, q, REST, COARSE_LEVEL, dx, dy, dz)
            out[0, 0] += weight * lr
            out[0, 1] += weight * lg
            out[0, 2] += weight * lb
            if count > 0 and hit_body(f, i, w, 0, ox, oy, oz, dx, dy, dz, t) >= 0:
                g = i[BODY] + GLOW
                lr, lg, lb = f[g], f[g + 1], f[g + 2]
            out[2, 0] += weight * lr
            out[2, 1] += weight * lg
            out[2, 2] += weight * lb
    for k in range(3):
        out[1, k] = out[2, k]
    for s in range(i[SOURCES]):
        free, seen, cosine = seen_share(f, i, w, s, ox, oy, oz, nx, ny, nz, SOURCE_RAYS, number, 0.0)
        if free > 0:
            _, _, _, er, eg, eb, _, _ = toward_source(f, i, s, ox, oy, oz)
            out[0, 0] += free * cosine * er
            out[0, 1] += free * cosine * eg
            out[0, 2] += free * cosine * eb
            out[1, 0] += seen * cosine * er
            out[1, 1] += seen * cosine * eg
            out[1, 2] += seen * cosine * eb


@njit(cache=True, error_model="numpy")
def fill_panel(f, i, w, q, number, step, kinds, out, grids):
    """Gather the light on each `step`-th point of a panel's grids into grids [3, GRID, GRID, 3]."""
    p = i[PANEL] + number * PANEL_SIZE
    for row in range(step // 2, GRID, step):
        for column in range(step // 2, GRID, step):
            x, y = panel_point(f, i, number, column - 0.5 * (1 - step % 2), row - 0.5 * (1 - step % 2))
            ox = f[p + ORIGIN] + x * f[p + RIGHT] + y * f[p + UP] + 1e-4 * f[p + NORMAL]
            oy = f[p + ORIGIN + 1] + x * f[p + RIGHT + 1] + y * f[p + UP + 1] + 1e-4 * f[p + NORMAL + 1]
            oz = f[p + ORIGIN + 2] + x * f[p + RIGHT + 2] + y * f[p + UP + 2] + 1e-4 * f[p + NORMAL + 2]
            fall_on(f, i, w, q, number, ox, oy, oz, out)
            for k in range(kinds):
                for a in range(row - step // 2, min(row - step // 2 + step, GRID)):
                    for b in range(column - step // 2, min(column - step // 2 + step, GRID)):
                        for n in range(3):
                            grids[k, a, b, n] = out[k, n]


@njit(cache=True, error_model="numpy")
def light_panels(f, i, w, q, seed):
    """Fill the grids of all panels: first what falls on them directly, then with the light between them."""
    np.random.seed(seed)
    count = i[PANELS]
    out, grids = np.zeros((3, 3), np.float32), np.zeros((count, 3, GRID, GRID, 3), np.float32)
    size = 3 * GRID * GRID * 3
    if count > 1:
        for p in range(count):
            fill_panel(f, i, w, q, p, 8, 3, out, grids[p])
        for p in range(count):
            start = i[LIGHT] + p * size
            for n in range(GRID * GRID * 3):  # what other panels send is lit with the object there
                f[start + n] = grids[p, LIT].flat[n]
    for p in range(count):
        fill_panel(f, i, w, q, p, 1 if p == 0 else SPARSE, 3, out, grids[p])
    for p in range(count):
        for k in range(3):
            smooth(grids[p, k])
            if p > 0:
                smooth(grids[p, k])
    start = i[LIGHT]
    for n in range(grids.size):
        f[start + n] = grids.flat[n]


@njit(cache=True, error_model="numpy")
def smooth(grid):
    """Blur a grid [GRID, GRID, 3] by 1 2 1 both ways: the noise of few directions."""
    old = grid.copy()
    for a in range(GRID):
        for b in range(GRID):
            for n in range(3):
                grid[a, b, n] = 0.25 * (old[max(a - 1, 0), b, n] + 2 * old[a, b, n] + old[min(a + 1, GRID - 1), b, n])
    old = grid.copy()
    for a in range(GRID):
        for b in range(GRID):
            for n in range(3):
                grid[a, b, n] = 0.25 * (old[a, max(b - 1, 0), n] + 2 * old[a, b, n] + old[a, min(b + 1, GRID - 1), n])


@njit(cache=True, error_model="numpy")
def diffuse_of(f, i, q, number, kind, x, y, px, py, pz):
    """Return the radiance that a panel reflects evenly at x, y on it, which is p in the world, by one of its grids."""
    er, eg, eb = grid_at(f, i, number, kind, x, y)
    ar, ag, ab = albedo_at(f, i, q, number, x, y, px, py, pz)
    return ar * er / math.pi, ag * eg / math.pi, ab * eb / math.pi


@njit(cache=True, error_model="numpy")
def coat_along(f, i, q, number, kind, part, px, py, pz, dx, dy, dz):
    """Return the radiance that a panel's coat at p mirrors to where d comes from: one look at a level of the sky as
    wide as the lobe, or at another panel. part: FULL or REST.

    The coat's share of light f0 A + B is Karis' fit ("Physically Based Shading on Mobile", 2014).
    """
    p = i[PANEL] + number * PANEL_SIZE
    f0, alpha = f[p + F0], f[p + ALPHA]
    slope = f[p + NORMAL] * dx + f[p + NORMAL + 1] * dy + f[p + NORMAL + 2] * dz
    if f0 <= 0 or slope >= 0:
        return 0.0, 0.0, 0.0
    rough = math.sqrt(alpha)
    rx, ry, rz, rw = 1 - rough, 0.0425 - 0.0275 * rough, 1.04 - 0.572 * rough, 0.022 * rough - 0.04
    a = min(rx * rx, 2.0 ** (9.28 * slope)) * rx + ry
    share = f0 * (rz - 1.04 * a) + rw + 1.04 * a
    mx = dx - 2 * slope * f[p + NORMAL]
    my = dy - 2 * slope * f[p + NORMAL + 1]
    mz = dz - 2 * slope * f[p + NORMAL + 2]
    other, t, u, v = hit_panel(f, i, px, py, pz, mx, my, mz, FAR, number)
    if other >= 0:
        r, g, b = diffuse_of(f, i, q, other, kind, u, v, px + t * mx, py + t * my, pz + t * mz)
    else:
        level = int(math.log2(max(alpha * i[ROWS] / math.pi, 1.0)) + 0.5)
        r, g, b = sky_at(i, q, part, min(level, int(math.log2(i[ROWS])) - 3), mx, my, mz)
    return share * r, share * g, share * b


@njit(cache=True, error_model="numpy")
def panel_along(f, i, q, number, kind, x, y, px, py, pz, dx, dy, dz):
    """Return the radiance of a panel at x, y on it, p in the world, seen along d, by one of its grids."""
    r, g, b = diffuse_of(f, i, q, number, kind, x, y, px, py, pz)
    f0 = f[i[PANEL] + number * PANEL_SIZE + F0]
    if f0 <= 0:
        return r, g, b
    cr, cg, cb = coat_along(f, i, q, number, kind, FULL, px, py, pz, dx, dy, dz)
    return (1 - f0) * r + cr, (1 - f0) * g + cg, (1 - f0) * b + cb


@njit(cache=True, error_model="numpy")
def lamp_along(f, i, ox, oy, oz, dx, dy, dz, most):
    """Return the number of the glowing ball that a ray meets before `most`, or -1."""
    for number in range(i[SOURCES]):
        s = i[SOURCE] + number * SOURCE_SIZE
        if f[s + NEAR] > 0:
            x, y, z = f[s + AT] - ox, f[s + AT + 1] - oy, f[s + AT + 2] - oz
            along = x * dx + y * dy + z * dz
            across = x * x + y * y + z * z - along * along
            if 0 < along < most and across < f[s + RADIUS] * f[s + RADIUS]:
                return number
    return -1


@njit(cache=True, error_model="numpy")
def mirrored_along(f, i, w, q, ox, oy, oz, dx, dy, dz, level):
    """Return radiance along a ray past the object and without sources: other bodies' glow, panels as lit, the sky."""
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR, -1)
    for k in range(1, i[BODIES]):
        if hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t) >= 0:
            g = i[BODY] + k * BODY_SIZE + GLOW
            return f[g], f[g + 1], f[g + 2]
    if p >= 0:
        return panel_along(f, i, q, p, LIT, x, y, ox + t * dx, oy + t * dy, oz + t * dz, dx, dy, dz)
    return sky_at(i, q, REST, level, dx, dy, dz)


@njit(cache=True, error_model="numpy")
def seen_without(f, i, w, q, ox, oy, oz, dx, dy, dz, level):
    """Return radiance along a ray with the object away: lamps, other bodies' glow, panels, and the sky; a map's own
    ground is the map."""
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR, -1)
    for k in range(1, i[BODIES]):
        d = hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t)
        if d >= 0:
            g = i[BODY] + k * BODY_SIZE + GLOW
            return f[g], f[g + 1], f[g + 2]
    s = lamp_along(f, i, ox, oy, oz, dx, dy, dz, t)
    if s >= 0:
        s = i[SOURCE] + s * SOURCE_SIZE + POWER
        return f[s], f[s + 1], f[s + 2]
    if p >= 0 and f[i[PANEL] + p * PANEL_SIZE + GROUND] == 0:
        return panel_along(f, i, q, p, FREE, x, y, ox + t * dx, oy + t * dy, oz + t * dz, dx, dy, dz)
    return sky_at(i, q, FULL, level, dx, dy, dz)


@njit(cache=True, error_model="numpy")
def probe_map(f, i, w, q, cx, cy, cz, camera, rows, samples):
    """Return what a probe at c sees with the object away, [rows, 2 rows, 3] in the frame world_from_camera [3, 3]."""
    out = np.zeros((rows, 2 * rows, 3), np.float32)
    fine = rows * samples
    for r in range(fine):
        v = (r + 0.5) / fine * math.pi
        sv, cv = math.sin(v), math.cos(v)
        for c in range(2 * fine):
            u = ((c + 0.5) / (2 * fine) - 0.5) * 2 * math.pi
            a, b, d = sv * math.sin(u), cv, -sv * math.cos(u)
            x = camera[0, 0] * a + camera[0, 1] * b + camera[0, 2] * d
            y = camera[1, 0] * a + camera[1, 1] * b + camera[1, 2] * d
            z = camera[2, 0] * a + camera[2, 1] * b + camera[2, 2] * d
            lr, lg, lb = seen_without(f, i, w, q, cx, cy, cz, x, y, z, 1)
            out[r // samples, c // samples, 0] += lr / (samples * samples)
            out[r // samples, c // samples, 1] += lg / (samples * samples)
            out[r // samples, c // samples, 2] += lb / (samples * samples)
    return out

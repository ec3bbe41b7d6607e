"""Compiled kernels: what rays see in a Scene (f, i, w, q: its arrays), and the light that falls on points."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from anyprobe_train.world.hits import (
    FAR_AWAY,
    FULL,
    REST,
    albedo_at,
    basis,
    grid_at,
    hit_body,
    hit_panel,
    is_blocked,
    panel_point,
    sky_at,
    toward_source,
)
from anyprobe_train.world.scene import (
    AT,
    BODIES,
    BODY,
    BODY_SIZE,
    COAT_ALPHA,
    F0,
    FREE,
    GLOW,
    GRID_POINTS,
    GROUND,
    IS_BALL,
    LIGHT,
    LIT,
    MEAN,
    NORMAL,
    ORIGIN,
    PANEL,
    PANEL_SIZE,
    PANELS,
    POWER,
    RADIUS,
    RIGHT,
    SKY_ROWS,
    SOURCE,
    SOURCE_COUNT,
    SOURCE_SIZE,
    UP,
)

GATHERED = 7
"""Square root of the number of directions over a panel's point."""
SOURCE_RAYS = 3
"""Rays to a source from a panel's point."""
SPARSE = 2
"""Points of a grid that are skipped each way, but of the first panel's, which the object stands on."""
COARSE_LEVEL = 4
"""Level of the map, of 16 rows, that soft light is gathered from."""


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
            panel, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, number)
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
    for s in range(i[SOURCE_COUNT]):
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
    """Gather the light on each `step`-th point of a panel's grids into grids [3, GRID_POINTS, GRID_POINTS, 3]."""
    p = i[PANEL] + number * PANEL_SIZE
    for row in range(step // 2, GRID_POINTS, step):
        for column in range(step // 2, GRID_POINTS, step):
            x, y = panel_point(f, i, number, column - 0.5 * (1 - step % 2), row - 0.5 * (1 - step % 2))
            ox = f[p + ORIGIN] + x * f[p + RIGHT] + y * f[p + UP] + 1e-4 * f[p + NORMAL]
            oy = f[p + ORIGIN + 1] + x * f[p + RIGHT + 1] + y * f[p + UP + 1] + 1e-4 * f[p + NORMAL + 1]
            oz = f[p + ORIGIN + 2] + x * f[p + RIGHT + 2] + y * f[p + UP + 2] + 1e-4 * f[p + NORMAL + 2]
            fall_on(f, i, w, q, number, ox, oy, oz, out)
            for k in range(kinds):
                for a in range(row - step // 2, min(row - step // 2 + step, GRID_POINTS)):
                    for b in range(column - step // 2, min(column - step // 2 + step, GRID_POINTS)):
                        for n in range(3):
                            grids[k, a, b, n] = out[k, n]


@njit(cache=True, error_model="numpy")
def light_panels(f, i, w, q, seed):
    """Fill the grids of all panels: first what falls on them directly, then with the light between them."""
    np.random.seed(seed)
    count = i[PANELS]
    out, grids = np.zeros((3, 3), np.float32), np.zeros((count, 3, GRID_POINTS, GRID_POINTS, 3), np.float32)
    size = 3 * GRID_POINTS * GRID_POINTS * 3
    if count > 1:
        for p in range(count):
            fill_panel(f, i, w, q, p, 8, 3, out, grids[p])
        for p in range(count):
            start = i[LIGHT] + p * size
            for n in range(GRID_POINTS * GRID_POINTS * 3):  # what other panels send is lit with the object there
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
    """Blur a grid [GRID_POINTS, GRID_POINTS, 3] by 1 2 1 both ways: the noise of few directions."""
    old = grid.copy()
    for a in range(GRID_POINTS):
        for b in range(GRID_POINTS):
            for n in range(3):
                grid[a, b, n] = 0.25 * (
                    old[max(a - 1, 0), b, n] + 2 * old[a, b, n] + old[min(a + 1, GRID_POINTS - 1), b, n]
                )
    old = grid.copy()
    for a in range(GRID_POINTS):
        for b in range(GRID_POINTS):
            for n in range(3):
                grid[a, b, n] = 0.25 * (
                    old[a, max(b - 1, 0), n] + 2 * old[a, b, n] + old[a, min(b + 1, GRID_POINTS - 1), n]
                )


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
    f0, alpha = f[p + F0], f[p + COAT_ALPHA]
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
    other, t, u, v = hit_panel(f, i, px, py, pz, mx, my, mz, FAR_AWAY, number)
    if other >= 0:
        r, g, b = diffuse_of(f, i, q, other, kind, u, v, px + t * mx, py + t * my, pz + t * mz)
    else:
        level = int(math.log2(max(alpha * i[SKY_ROWS] / math.pi, 1.0)) + 0.5)
        r, g, b = sky_at(i, q, part, min(level, int(math.log2(i[SKY_ROWS])) - 3), mx, my, mz)
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
    for number in range(i[SOURCE_COUNT]):
        s = i[SOURCE] + number * SOURCE_SIZE
        if f[s + IS_BALL] > 0:
            x, y, z = f[s + AT] - ox, f[s + AT + 1] - oy, f[s + AT + 2] - oz
            along = x * dx + y * dy + z * dz
            across = x * x + y * y + z * z - along * along
            if 0 < along < most and across < f[s + RADIUS] * f[s + RADIUS]:
                return number
    return -1


@njit(cache=True, error_model="numpy")
def mirrored_along(f, i, w, q, ox, oy, oz, dx, dy, dz, level):
    """Return radiance along a ray past the object and without sources: other bodies' glow, panels as lit, the sky."""
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, -1)
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
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, -1)
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

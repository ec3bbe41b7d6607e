"""Compiled kernels: what rays see in a Scene (f, i, w, q: its arrays), and the light that falls on points."""

import math

import numpy as np

from anyprobe_train.world import scene as at
from anyprobe_train.world.hits import (
    FAR_AWAY,
    FULL,
    REST,
    albedo_at,
    basis,
    grid_at,
    hit_body,
    hit_panel,
    in_disc,
    is_blocked,
    level_of,
    panel_point,
    random,
    sky_at,
    toward_source,
)
from anyprobe_train.world.march import compiled

GATHERED, SETS = 49, 16
"""Directions over a panel's point, and sets of them that points choose from."""
SOURCE_RAYS = 3
"""Rays to a source from a panel's point."""
SPARSE = 2
"""Step between points of a grid that light is gathered on."""
DENSE = at.GRID_POINTS // 4
"""From so far inside the first panel's grids on, at the object's foot, on each point."""
PROBE_EVEN = 0.01
"""Difference of two points of a probe's pixel, over their sum, from which on four are seen."""
COARSE_LEVEL = 4
"""Level of the map, of 16 rows, that soft light is gathered from."""


@compiled
def seen_share(f, i, w, number, ox, oy, oz, nx, ny, nz, rays, without, own, hides, draw, part, parts):
    """Return the mean cosine over a source of what a point sees of it past all but the object, and past all, and the
    share that it sees, by jittered rays.

    without: the panel that the point lies on; own: distance from the point that rays start at; hides: whether the
    object may be in the way; draw: number of the point, by which rays are drawn; part: which of `parts` of one set of
    rays they are.
    """
    lx, ly, lz, _, _, _, tangent, distance = toward_source(f, i, number, ox, oy, oz)
    if lx * nx + ly * ny + lz * nz < -tangent:
        return 0.0, 0.0, 0.0
    tx, ty, tz, ux, uy, uz = basis(lx, ly, lz)
    px, py, pz = ox + own * nx, oy + own * ny, oz + own * nz
    free, seen, share = 0.0, 0.0, 0
    for k in range(rays):
        a, b = in_disc(draw * i[at.SOURCE_COUNT] + number, k * parts + part, rays * parts)
        a, b = a * tangent, b * tangent
        length = 1 / math.sqrt(1 + a * a + b * b)
        dx, dy, dz = ((lx + a * tx + b * ux) * length, (ly + a * ty + b * uy) * length, (lz + a * tz + b * uz) * length)
        cosine = dx * nx + dy * ny + dz * nz
        if cosine <= 0:
            continue
        panel, _, _, _ = hit_panel(f, i, px, py, pz, dx, dy, dz, distance, without)
        if panel >= 0 or is_blocked(f, i, w, 1, px, py, pz, dx, dy, dz, distance):
            continue
        free += cosine
        if not hides or hit_body(f, i, w, 0, px, py, pz, dx, dy, dz, distance) < 0:
            seen, share = seen + cosine, share + 1
    return free / rays, seen / rays, share / rays


@compiled
def soft_light(i, q, nx, ny, nz, seed, ways, light):
    """Fill SETS of directions, even in cosine about a normal, into ways [SETS, GATHERED, 3], and into light what the
    sky without sources adds along each to the irradiance; each set's sum is the sky's whole."""
    tx, ty, tz, ux, uy, uz = basis(nx, ny, nz)
    whole = np.zeros(3)
    for s in range(SETS):
        for k in range(GATHERED):
            a, b = in_disc(seed + s, k, GATHERED)
            h = math.sqrt(max(1 - a * a - b * b, 0.0))
            x, y, z = a * tx + b * ux + h * nx, a * ty + b * uy + h * ny, a * tz + b * uz + h * nz
            ways[s, k, 0], ways[s, k, 1], ways[s, k, 2] = x, y, z
            light[s, k, 0], light[s, k, 1], light[s, k, 2] = sky_at(i, q, REST, COARSE_LEVEL, x, y, z)
            for n in range(3):
                whole[n] += light[s, k, n] * math.pi / (SETS * GATHERED)
    for s in range(SETS):
        for n in range(3):
            light[s, :, n] *= whole[n] / max(light[s, :, n].sum(), 1e-20)


@compiled
def fall_on(f, i, w, number, ox, oy, oz, ways, light, draw, out):
    """Gather the light on point o of a panel's front into out [3, 3]: FREE, LIT and SOFT. ways, light: [GATHERED, 3]
    each, a set of `soft_light`."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    nx, ny, nz = f[p + at.NORMAL], f[p + at.NORMAL + 1], f[p + at.NORMAL + 2]
    out[:] = 0.0
    for m in range(GATHERED):
        dx, dy, dz = ways[m, 0], ways[m, 1], ways[m, 2]
        panel, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, number)
        glow = -1
        for k in range(1, i[at.BODIES]):
            d = hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t)
            if d >= 0:
                glow, t = i[at.BODY] + k * at.BODY_SIZE + at.GLOW, d
        r, g, b = light[m, 0], light[m, 1], light[m, 2]
        if glow >= 0:
            r, g, b = f[glow] * math.pi / GATHERED, f[glow + 1] * math.pi / GATHERED, f[glow + 2] * math.pi / GATHERED
        elif panel >= 0:
            r, g, b = grid_at(f, i, panel, at.FREE, x, y)
            e = i[at.PANEL] + panel * at.PANEL_SIZE + at.MEAN
            r, g, b = f[e] * r / GATHERED, f[e + 1] * g / GATHERED, f[e + 2] * b / GATHERED
        out[at.FREE, 0] += r
        out[at.FREE, 1] += g
        out[at.FREE, 2] += b
        if i[at.BODIES] > 0 and hit_body(f, i, w, 0, ox, oy, oz, dx, dy, dz, t) >= 0:
            e = i[at.BODY] + at.GLOW
            r, g, b = f[e] * math.pi / GATHERED, f[e + 1] * math.pi / GATHERED, f[e + 2] * math.pi / GATHERED
        out[at.SOFT, 0] += r
        out[at.SOFT, 1] += g
        out[at.SOFT, 2] += b
    out[at.LIT] = out[at.SOFT]
    for s in range(i[at.SOURCE_COUNT]):
        free, seen, _ = seen_share(
            f, i, w, s, ox, oy, oz, nx, ny, nz, SOURCE_RAYS, number, 0.0, i[at.BODIES] > 0, draw, 0, 1
        )
        if free > 0:
            _, _, _, er, eg, eb, _, _ = toward_source(f, i, s, ox, oy, oz)
            out[at.FREE, 0] += free * er
            out[at.FREE, 1] += free * eg
            out[at.FREE, 2] += free * eb
            out[at.LIT, 0] += seen * er
            out[at.LIT, 1] += seen * eg
            out[at.LIT, 2] += seen * eb


@compiled
def fill_panel(f, i, w, number, step, first, last, ways, light, seed, out, grids):
    """Gather the light on each `step`-th point of a panel's grids, rows and columns first to last, into grids [3,
    GRID_POINTS, GRID_POINTS, 3]."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    for row in range(first + step // 2, last, step):
        for column in range(first + step // 2, last, step):
            x, y = panel_point(f, i, number, column - 0.5 * (1 - step % 2), row - 0.5 * (1 - step % 2))
            ox = f[p + at.ORIGIN] + x * f[p + at.RIGHT] + y * f[p + at.UP] + 1e-4 * f[p + at.NORMAL]
            oy = f[p + at.ORIGIN + 1] + x * f[p + at.RIGHT + 1] + y * f[p + at.UP + 1] + 1e-4 * f[p + at.NORMAL + 1]
            oz = f[p + at.ORIGIN + 2] + x * f[p + at.RIGHT + 2] + y * f[p + at.UP + 2] + 1e-4 * f[p + at.NORMAL + 2]
            draw = seed + row * at.GRID_POINTS + column
            s = int(SETS * random(draw))
            fall_on(f, i, w, number, ox, oy, oz, ways[s], light[s], draw, out)
            for k in range(3):
                for a in range(row - step // 2, min(row - step // 2 + step, last)):
                    for b in range(column - step // 2, min(column - step // 2 + step, last)):
                        for n in range(3):
                            grids[k, a, b, n] = out[k, n]


@compiled
def light_panels(f, i, w, q, seed):
    """Fill the grids of all panels: first what falls on them directly, then with the light between them."""
    count = i[at.PANELS]
    out, grids = np.zeros((3, 3), np.float32), np.zeros((count, 3, at.GRID_POINTS, at.GRID_POINTS, 3), np.float32)
    ways, light = np.zeros((count, SETS, GATHERED, 3), np.float32), np.zeros((count, SETS, GATHERED, 3), np.float32)
    for p in range(count):
        e = i[at.PANEL] + p * at.PANEL_SIZE + at.NORMAL
        soft_light(i, q, f[e], f[e + 1], f[e + 2], seed, ways[p], light[p])
    size = 3 * at.GRID_POINTS * at.GRID_POINTS * 3
    if count > 1:
        for p in range(count):
            fill_panel(f, i, w, p, 8, 0, at.GRID_POINTS, ways[p], light[p], seed, out, grids[p])
        for p in range(count):
            start = i[at.LIGHT] + p * size
            for n in range(at.GRID_POINTS * at.GRID_POINTS * 3):  # what other panels send is lit with the object there
                f[start + n] = grids[p, at.LIT].flat[n]
    for p in range(count):
        fill_panel(f, i, w, p, SPARSE, 0, at.GRID_POINTS, ways[p], light[p], seed + 1 + p, out, grids[p])
    if count:
        fill_panel(f, i, w, 0, 1, DENSE, at.GRID_POINTS - DENSE, ways[0], light[0], seed, out, grids[0])
    for p in range(count):
        for k in range(3):
            smooth(grids[p, k])
            if p > 0:
                smooth(grids[p, k])
    start = i[at.LIGHT]
    for n in range(grids.size):
        f[start + n] = grids.flat[n]


@compiled
def smooth(grid):
    """Blur a grid [GRID_POINTS, GRID_POINTS, 3] by 1 2 1 both ways: the noise of few directions."""
    old = grid.copy()
    for a in range(at.GRID_POINTS):
        for b in range(at.GRID_POINTS):
            for n in range(3):
                grid[a, b, n] = 0.25 * (
                    old[max(a - 1, 0), b, n] + 2 * old[a, b, n] + old[min(a + 1, at.GRID_POINTS - 1), b, n]
                )
    old = grid.copy()
    for a in range(at.GRID_POINTS):
        for b in range(at.GRID_POINTS):
            for n in range(3):
                grid[a, b, n] = 0.25 * (
                    old[a, max(b - 1, 0), n] + 2 * old[a, b, n] + old[a, min(b + 1, at.GRID_POINTS - 1), n]
                )


@compiled
def diffuse_of(f, i, q, number, kind, x, y, px, py, pz):
    """Return the radiance that a panel reflects evenly at x, y on it, which is p in the world, by one of its grids."""
    er, eg, eb = grid_at(f, i, number, kind, x, y)
    ar, ag, ab = albedo_at(f, i, q, number, x, y, px, py, pz)
    return ar * er / math.pi, ag * eg / math.pi, ab * eb / math.pi


@compiled
def coat_along(f, i, q, number, kind, part, px, py, pz, dx, dy, dz):
    """Return the radiance that a panel's coat at p mirrors to where d comes from: one look at a level of the sky as
    wide as the lobe, or at another panel. part: FULL or REST.

    The coat's share of light f0 A + B is Karis' fit ("Physically Based Shading on Mobile", 2014).
    """
    p = i[at.PANEL] + number * at.PANEL_SIZE
    f0, alpha = f[p + at.F0], f[p + at.COAT_ALPHA]
    slope = f[p + at.NORMAL] * dx + f[p + at.NORMAL + 1] * dy + f[p + at.NORMAL + 2] * dz
    if f0 <= 0 or slope >= 0:
        return 0.0, 0.0, 0.0
    rough = math.sqrt(alpha)
    rx, ry, rz, rw = 1 - rough, 0.0425 - 0.0275 * rough, 1.04 - 0.572 * rough, 0.022 * rough - 0.04
    a = min(rx * rx, math.exp(6.4324 * slope)) * rx + ry
    share = f0 * (rz - 1.04 * a) + rw + 1.04 * a
    mx = dx - 2 * slope * f[p + at.NORMAL]
    my = dy - 2 * slope * f[p + at.NORMAL + 1]
    mz = dz - 2 * slope * f[p + at.NORMAL + 2]
    other, t, u, v = hit_panel(f, i, px, py, pz, mx, my, mz, FAR_AWAY, number)
    if other >= 0:
        r, g, b = diffuse_of(f, i, q, other, kind, u, v, px + t * mx, py + t * my, pz + t * mz)
    else:
        wide = alpha * i[at.SKY_ROWS] / math.pi
        r, g, b = sky_at(i, q, part, level_of(wide * wide, i[at.SKY_ROWS]), mx, my, mz)
    return share * r, share * g, share * b


@compiled
def panel_along(f, i, q, number, kind, x, y, px, py, pz, dx, dy, dz):
    """Return the radiance of a panel at x, y on it, p in the world, seen along d, by one of its grids."""
    r, g, b = diffuse_of(f, i, q, number, kind, x, y, px, py, pz)
    f0 = f[i[at.PANEL] + number * at.PANEL_SIZE + at.F0]
    if f0 <= 0:
        return r, g, b
    cr, cg, cb = coat_along(f, i, q, number, kind, FULL, px, py, pz, dx, dy, dz)
    return (1 - f0) * r + cr, (1 - f0) * g + cg, (1 - f0) * b + cb


@compiled
def lamp_along(f, i, ox, oy, oz, dx, dy, dz, most):
    """Return the number of the glowing ball that a ray meets before `most`, or -1."""
    for number in range(i[at.SOURCE_COUNT]):
        s = i[at.SOURCE] + number * at.SOURCE_SIZE
        if f[s + at.IS_BALL] > 0:
            x, y, z = f[s + at.AT] - ox, f[s + at.AT + 1] - oy, f[s + at.AT + 2] - oz
            along = x * dx + y * dy + z * dz
            across = x * x + y * y + z * z - along * along
            if 0 < along < most and across < f[s + at.RADIUS] * f[s + at.RADIUS]:
                return number
    return -1


@compiled
def mirrored_along(f, i, w, q, ox, oy, oz, dx, dy, dz, level):
    """Return radiance along a ray past the object and without sources: other bodies' glow, panels as lit, the sky."""
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, -1)
    for k in range(1, i[at.BODIES]):
        if hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t) >= 0:
            g = i[at.BODY] + k * at.BODY_SIZE + at.GLOW
            return f[g], f[g + 1], f[g + 2]
    if p >= 0:
        return panel_along(f, i, q, p, at.LIT, x, y, ox + t * dx, oy + t * dy, oz + t * dz, dx, dy, dz)
    return sky_at(i, q, REST, level, dx, dy, dz)


@compiled
def seen_without(f, i, w, q, ox, oy, oz, dx, dy, dz, level):
    """Return radiance along a ray with the object away: lamps, other bodies' glow, panels, and the sky; a map's own
    ground is the map."""
    p, t, x, y = hit_panel(f, i, ox, oy, oz, dx, dy, dz, FAR_AWAY, -1)
    for k in range(1, i[at.BODIES]):
        d = hit_body(f, i, w, k, ox, oy, oz, dx, dy, dz, t)
        if d >= 0:
            g = i[at.BODY] + k * at.BODY_SIZE + at.GLOW
            return f[g], f[g + 1], f[g + 2]
    s = lamp_along(f, i, ox, oy, oz, dx, dy, dz, t)
    if s >= 0:
        s = i[at.SOURCE] + s * at.SOURCE_SIZE + at.POWER
        return f[s], f[s + 1], f[s + 2]
    if p >= 0 and f[i[at.PANEL] + p * at.PANEL_SIZE + at.GROUND] == 0:
        return panel_along(f, i, q, p, at.FREE, x, y, ox + t * dx, oy + t * dy, oz + t * dz, dx, dy, dz)
    return sky_at(i, q, FULL, level, dx, dy, dz)


@compiled
def probe_map(f, i, w, q, cx, cy, cz, camera, rows):
    """Return what a probe at c sees with the object away, [rows, 2 rows, 3] in the frame world_from_camera [3, 3]: the
    mean of two points of each pixel, of four where they differ."""
    out = np.zeros((rows, 2 * rows, 3), np.float32)
    turn = (np.arange(4 * rows) + 0.5) / (2 * rows) * math.pi
    sine, cosine = np.sin(turn), np.cos(turn)
    for row in range(rows):
        for column in range(2 * rows):
            count, first, last = 0, 0.0, 0.0
            while count < 4:
                if count == 2 and abs(first - last) < PROBE_EVEN * (first + last):
                    break
                a, b = two_by_two(count)
                flat, y = sine[2 * row + a], cosine[2 * row + a]
                x, z = -flat * sine[2 * column + b], flat * cosine[2 * column + b]
                dx = camera[0, 0] * x + camera[0, 1] * y + camera[0, 2] * z
                dy = camera[1, 0] * x + camera[1, 1] * y + camera[1, 2] * z
                dz = camera[2, 0] * x + camera[2, 1] * y + camera[2, 2] * z
                lr, lg, lb = seen_without(f, i, w, q, cx, cy, cz, dx, dy, dz, 1)
                out[row, column, 0] += lr
                out[row, column, 1] += lg
                out[row, column, 2] += lb
                first, last, count = last, lr + lg + lb, count + 1
            for n in range(3):
                out[row, column, n] /= count
    return out


@compiled
def two_by_two(k):
    """Return row and column of point k of a pixel's four: first two on a diagonal, then the others."""
    return k & 1, (k ^ (k >> 1)) & 1

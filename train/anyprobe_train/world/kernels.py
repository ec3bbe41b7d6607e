"""Compiled kernels: what rays see in a Scene (f, i, w, q: its arrays), and the light that falls on points."""

import math

import numpy as np

from anyprobe_train.world import scene as at
from anyprobe_train.world.hits import (
    FAR_AWAY,
    FULL,
    REST,
    albedo_at,
    first_hit,
    glow_of,
    grid_at,
    hit_body,
    hit_panel,
    in_disc,
    level_of,
    panel_point,
    random,
    sky_at,
    toward_source,
)
from anyprobe_train.world.march import compiled
from anyprobe_train.world.vectors import add_to, basis, dot, minus, mixed, moved, row_of, scaled, times, vector

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
def seen_share(f, i, w, number, o, n, rays, without, own, hides, draw, part, parts):
    """Return the mean cosine over a source of what a point sees of it past all but the object, and past all, and the
    share that it sees, by jittered rays.

    without: the panel that the point lies on; own: distance from the point that rays start at; hides: whether the
    object may be in the way; draw: number of the point, by which rays are drawn; part: which of `parts` of one set of
    rays they are.
    """
    to, _, tangent, distance = toward_source(f, i, number, o)
    if dot(to, n) < -tangent:
        return 0.0, 0.0, 0.0
    t, u = basis(to)
    start = moved(o, own, n)
    free, seen, share = 0.0, 0.0, 0
    for k in range(rays):
        a, b = in_disc(draw * i[at.SOURCE_COUNT] + number, k * parts + part, rays * parts)
        a, b = a * tangent, b * tangent
        d = scaled(1 / math.sqrt(1 + a * a + b * b), moved(moved(to, a, t), b, u))
        cosine = dot(d, n)
        if cosine <= 0:
            continue
        panel, _, _, _ = hit_panel(f, i, start, d, distance, without)
        if panel >= 0 or first_hit(f, i, w, 1, start, d, distance) >= 0:
            continue
        free += cosine
        if not hides or hit_body(f, i, w, 0, start, d, distance) < 0:
            seen, share = seen + cosine, share + 1
    return free / rays, seen / rays, share / rays


@compiled
def soft_light(i, q, n, seed, ways, light):
    """Fill SETS of directions, even in cosine about a normal, into ways [SETS, GATHERED, 3], and into light what the
    sky without sources adds along each to the irradiance; each set's sum is the sky's whole."""
    t, u = basis(n)
    whole = np.zeros(3)
    for s in range(SETS):
        for k in range(GATHERED):
            a, b = in_disc(seed + s, k, GATHERED)
            d = mixed(a, b, math.sqrt(max(1 - a * a - b * b, 0.0)), t, u, n)
            ways[s, k, 0], ways[s, k, 1], ways[s, k, 2] = d
            light[s, k, 0], light[s, k, 1], light[s, k, 2] = sky_at(i, q, REST, COARSE_LEVEL, d)
            for c in range(3):
                whole[c] += light[s, k, c] * math.pi / (SETS * GATHERED)
    for s in range(SETS):
        for c in range(3):
            light[s, :, c] *= whole[c] / max(light[s, :, c].sum(), 1e-20)


@compiled
def fall_on(f, i, w, number, o, ways, light, draw, out):
    """Gather the light on point o of a panel's front into out [3, 3]: FREE, LIT and SOFT. ways, light: [GATHERED, 3]
    each, a set of `soft_light`."""
    n = vector(f, i[at.PANEL] + number * at.PANEL_SIZE + at.NORMAL)
    out[:] = 0.0
    for m in range(GATHERED):
        d = row_of(ways, m)
        panel, t, x, y = hit_panel(f, i, o, d, FAR_AWAY, number)
        body = -1
        for k in range(1, i[at.BODIES]):
            away = hit_body(f, i, w, k, o, d, t)
            if away >= 0:
                body, t = k, away
        sent = row_of(light, m)
        if body >= 0:
            sent = scaled(math.pi / GATHERED, glow_of(f, i, body))
        elif panel >= 0:
            mean = vector(f, i[at.PANEL] + panel * at.PANEL_SIZE + at.MEAN)
            sent = scaled(1 / GATHERED, times(mean, grid_at(f, i, panel, at.FREE, x, y)))
        add_to(out, at.FREE, sent)
        if i[at.BODIES] > 0 and hit_body(f, i, w, 0, o, d, t) >= 0:
            sent = scaled(math.pi / GATHERED, glow_of(f, i, 0))
        add_to(out, at.SOFT, sent)
    out[at.LIT] = out[at.SOFT]
    for s in range(i[at.SOURCE_COUNT]):
        free, seen, _ = seen_share(f, i, w, s, o, n, SOURCE_RAYS, number, 0.0, i[at.BODIES] > 0, draw, 0, 1)
        if free > 0:
            _, power, _, _ = toward_source(f, i, s, o)
            add_to(out, at.FREE, scaled(free, power))
            add_to(out, at.LIT, scaled(seen, power))


@compiled
def fill_panel(f, i, w, number, step, first, last, ways, light, seed, out, grids):
    """Gather the light on each `step`-th point of a panel's grids, rows and columns first to last, into grids [3,
    GRID_POINTS, GRID_POINTS, 3]."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    for row in range(first + step // 2, last, step):
        for column in range(first + step // 2, last, step):
            x, y = panel_point(f, i, number, column - 0.5 * (1 - step % 2), row - 0.5 * (1 - step % 2))
            o = moved(moved(vector(f, p + at.ORIGIN), x, vector(f, p + at.RIGHT)), y, vector(f, p + at.UP))
            o = moved(o, 1e-4, vector(f, p + at.NORMAL))
            draw = seed + row * at.GRID_POINTS + column
            s = int(SETS * random(draw))
            fall_on(f, i, w, number, o, ways[s], light[s], draw, out)
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
        soft_light(i, q, vector(f, i[at.PANEL] + p * at.PANEL_SIZE + at.NORMAL), seed, ways[p], light[p])
    size = 3 * at.GRID_POINTS * at.GRID_POINTS * 3
    if count > 1:
        for p in range(count):
            fill_panel(f, i, w, p, 8, 0, at.GRID_POINTS, ways[p], light[p], seed, out, grids[p])
        for p in range(count):
            start, lit = i[at.LIGHT] + p * size, grids[p, at.LIT].ravel()
            f[start : start + len(lit)] = lit  # what other panels send is lit with the object there
    for p in range(count):
        fill_panel(f, i, w, p, SPARSE, 0, at.GRID_POINTS, ways[p], light[p], seed + 1 + p, out, grids[p])
    if count:
        fill_panel(f, i, w, 0, 1, DENSE, at.GRID_POINTS - DENSE, ways[0], light[0], seed, out, grids[0])
    for p in range(count):
        for k in range(3):
            smooth(grids[p, k])
            if p > 0:
                smooth(grids[p, k])
    f[i[at.LIGHT] : i[at.LIGHT] + grids.size] = grids.ravel()


@compiled
def smooth(grid):
    """Blur a grid [GRID_POINTS, GRID_POINTS, 3] by 1 2 1 both ways: the noise of few directions."""
    for down, right in ((1, 0), (0, 1)):
        old, last = grid.copy(), at.GRID_POINTS - 1
        for a in range(at.GRID_POINTS):
            for b in range(at.GRID_POINTS):
                for n in range(3):
                    before = old[max(a - down, 0), max(b - right, 0), n]
                    after = old[min(a + down, last), min(b + right, last), n]
                    grid[a, b, n] = 0.25 * (before + 2 * old[a, b, n] + after)


@compiled
def diffuse_of(f, i, q, number, kind, x, y, place):
    """Return the radiance that a panel reflects evenly at x, y on it, a place in the world, by one of its grids."""
    return scaled(1 / math.pi, times(albedo_at(f, i, q, number, x, y, place), grid_at(f, i, number, kind, x, y)))


@compiled
def coat_along(f, i, q, number, kind, part, place, d):
    """Return the radiance that a panel's coat at a place mirrors to where d comes from: one look at a level of the sky
    as wide as the lobe, or at another panel. part: FULL or REST.

    The coat's share of light f0 A + B is Karis' fit ("Physically Based Shading on Mobile", 2014).
    """
    p = i[at.PANEL] + number * at.PANEL_SIZE
    f0, alpha, normal = f[p + at.F0], f[p + at.COAT_ALPHA], vector(f, p + at.NORMAL)
    slope = dot(normal, d)
    if f0 <= 0 or slope >= 0:
        return 0.0, 0.0, 0.0
    rough = math.sqrt(alpha)
    rx, ry, rz, rw = 1 - rough, 0.0425 - 0.0275 * rough, 1.04 - 0.572 * rough, 0.022 * rough - 0.04
    a = min(rx * rx, math.exp(6.4324 * slope)) * rx + ry
    share = f0 * (rz - 1.04 * a) + rw + 1.04 * a
    mirrored = moved(d, -2 * slope, normal)
    other, t, u, v = hit_panel(f, i, place, mirrored, FAR_AWAY, number)
    if other >= 0:
        return scaled(share, diffuse_of(f, i, q, other, kind, u, v, moved(place, t, mirrored)))
    wide = alpha * i[at.SKY_ROWS] / math.pi
    return scaled(share, sky_at(i, q, part, level_of(wide * wide, i[at.SKY_ROWS]), mirrored))


@compiled
def panel_along(f, i, q, number, kind, x, y, place, d):
    """Return the radiance of a panel at x, y on it, a place in the world, seen along d, by one of its grids."""
    base = diffuse_of(f, i, q, number, kind, x, y, place)
    f0 = f[i[at.PANEL] + number * at.PANEL_SIZE + at.F0]
    if f0 <= 0:
        return base
    return moved(coat_along(f, i, q, number, kind, FULL, place, d), 1 - f0, base)


@compiled
def lamp_along(f, i, o, d, most):
    """Return the number of the glowing ball that a ray meets before `most`, or -1."""
    for number in range(i[at.SOURCE_COUNT]):
        s = i[at.SOURCE] + number * at.SOURCE_SIZE
        if f[s + at.IS_BALL] > 0:
            away = minus(vector(f, s + at.AT), o)
            along = dot(away, d)
            if 0 < along < most and dot(away, away) - along * along < f[s + at.RADIUS] * f[s + at.RADIUS]:
                return number
    return -1


@compiled
def mirrored_along(f, i, w, q, o, d, level):
    """Return radiance along a ray past the object and without sources: other bodies' glow, panels as lit, the sky."""
    p, t, x, y = hit_panel(f, i, o, d, FAR_AWAY, -1)
    body = first_hit(f, i, w, 1, o, d, t)
    if body >= 0:
        return glow_of(f, i, body)
    if p >= 0:
        return panel_along(f, i, q, p, at.LIT, x, y, moved(o, t, d), d)
    return sky_at(i, q, REST, level, d)


@compiled
def seen_without(f, i, w, q, o, d, level):
    """Return radiance along a ray with the object away: lamps, other bodies' glow, panels, and the sky; a map's own
    ground is the map."""
    p, t, x, y = hit_panel(f, i, o, d, FAR_AWAY, -1)
    body = first_hit(f, i, w, 1, o, d, t)
    if body >= 0:
        return glow_of(f, i, body)
    lamp = lamp_along(f, i, o, d, t)
    if lamp >= 0:
        return vector(f, i[at.SOURCE] + lamp * at.SOURCE_SIZE + at.POWER)
    if p >= 0 and f[i[at.PANEL] + p * at.PANEL_SIZE + at.GROUND] == 0:
        return panel_along(f, i, q, p, at.FREE, x, y, moved(o, t, d), d)
    return sky_at(i, q, FULL, level, d)


@compiled
def probe_map(f, i, w, q, center, camera, rows):
    """Return what a probe at a place sees with the object away, [rows, 2 rows, 3] in the frame world_from_camera
    [3, 3]: the mean of two points of each pixel, of four where they differ."""
    out = np.zeros((rows, 2 * rows, 3), np.float32)
    turn = (np.arange(4 * rows) + 0.5) / (2 * rows) * math.pi
    sine, cosine = np.sin(turn), np.cos(turn)
    for row in range(rows):
        line = out[row]
        for column in range(2 * rows):
            count, first, last = 0, 0.0, 0.0
            while count < 4:
                if count == 2 and abs(first - last) < PROBE_EVEN * (first + last):
                    break
                a, b = two_by_two(count)
                flat = sine[2 * row + a]
                way = -flat * sine[2 * column + b], cosine[2 * row + a], flat * cosine[2 * column + b]
                d = dot(row_of(camera, 0), way), dot(row_of(camera, 1), way), dot(row_of(camera, 2), way)
                light = seen_without(f, i, w, q, center, d, 1)
                add_to(line, column, light)
                first, last, count = last, light[0] + light[1] + light[2], count + 1
            for n in range(3):
                line[column, n] /= count
    return out


@compiled
def two_by_two(k):
    """Return row and column of point k of a pixel's four: first two on a diagonal, then the others."""
    return k & 1, (k ^ (k >> 1)) & 1

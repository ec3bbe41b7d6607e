"""Compiled kernels: the object as its camera sees it, and the picture behind it."""

import math

import numpy as np

from anyprobe_train.world import scene as at
from anyprobe_train.world.hits import (
    FAR_AWAY,
    FULL,
    REST,
    albedo_at,
    angle_of,
    glow_of,
    grid_at,
    hit_body,
    hit_panel,
    in_disc,
    level_of,
    random,
    sky_at,
    toward_source,
)
from anyprobe_train.world.kernels import coat_along, diffuse_of, lamp_along, mirrored_along, seen_share, two_by_two
from anyprobe_train.world.march import compiled
from anyprobe_train.world.vectors import add_to, basis, dot, minus, mixed, moved, row_of, scaled, times, unit, vector
from anyprobe_train.world.views import OWN, VIEW_AZIMUTHS, VIEW_RINGS

MOST_RATIO = 1.5
"""Ratio of the light on a map's own ground with the object over that without."""
PICTURE_EVEN = 0.03
"""Difference of two points of a picture's pixel, over their sum, from which on four are seen."""
CELL_TANGENT = 0.2
"""Tangent of half of a cell's width."""
WIDENED = 0.19
"""Factor of a source's squared radius that it adds to alpha^2 of the lobe that mirrors it (light.octahedral)."""


@compiled
def seen_along(f, i, q, directions, center, sky):
    """Return what a place sees along directions [C, 3] on panels without the object, else sky [C, 3]."""
    seen = sky.copy()
    for c in range(len(directions)):
        d = row_of(directions, c)
        p, t, x, y = hit_panel(f, i, center, d, FAR_AWAY, -1)
        if p >= 0:
            seen[c] = diffuse_of(f, i, q, p, at.FREE, x, y, moved(center, t, d))
    return seen


@compiled
def received(f, i, w, q, points, normals, bits, directions, sky, seen, out):
    """Fill out [N, 3] with the soft light that falls on points of the object over that of `seen` without it in the
    way. bits: [N, 2] uint64, cells that the object hides from each."""
    for k in range(len(points)):
        n = row_of(normals, k)
        o = moved(row_of(points, k), OWN, n)
        lit = free = 1e-9, 1e-9, 1e-9
        for c in range(len(directions)):
            d = row_of(directions, c)
            cosine = dot(n, d)
            if cosine <= 0:
                continue
            free = moved(free, cosine, row_of(seen, c))
            if (bits[k, c >> 6] >> np.uint64(c & 63)) & np.uint64(1):
                light = glow_of(f, i, 0)
            else:
                p, t, x, y = hit_panel(f, i, o, d, FAR_AWAY, -1)
                body = -1
                for m in range(1, i[at.BODIES]):
                    if hit_body(f, i, w, m, o, d, t) >= 0:
                        body = m
                if body > 0:
                    light = glow_of(f, i, body)
                elif p >= 0 and f[i[at.PANEL] + p * at.PANEL_SIZE + at.GROUND] > 0:
                    light = diffuse_of(f, i, q, p, at.LIT, x, y, moved(o, t, d))
                elif p >= 0:
                    mean = vector(f, i[at.PANEL] + p * at.PANEL_SIZE + at.MEAN)
                    light = scaled(1 / math.pi, times(grid_at(f, i, p, at.LIT, x, y), mean))
                else:
                    light = row_of(sky, c)
            lit = moved(lit, cosine, light)
        out[k] = min(lit[0] / free[0], 8.0), min(lit[1] / free[1], 8.0), min(lit[2] / free[2], 8.0)


@compiled
def visible_normal(wo, alpha, p, s):
    """Return a half vector by the normals that wo [local, z up] sees, for a point of the unit disc (Heitz, JCGT
    2018)."""
    v = unit((alpha * wo[0], alpha * wo[1], wo[2]))
    across = v[0] * v[0] + v[1] * v[1]
    if across > 1e-12:
        root = 1.0 / math.sqrt(across)
        t = -v[1] * root, v[0] * root, 0.0
    else:
        t = 1.0, 0.0, 0.0
    u = v[1] * t[2] - v[2] * t[1], v[2] * t[0] - v[0] * t[2], v[0] * t[1] - v[1] * t[0]
    half = 0.5 * (1 + v[2])
    s = (1 - half) * math.sqrt(max(1 - p * p, 0.0)) + half * s
    n = mixed(p, s, math.sqrt(max(1 - p * p - s * s, 0.0)), t, u, v)
    return unit((alpha * n[0], alpha * n[1], max(n[2], 1e-6)))


@compiled
def distribution(cosine, alpha):
    """Evaluate D(h) [1/sr] of GGX."""
    a2 = alpha * alpha
    d = cosine * cosine * (a2 - 1) + 1
    return a2 / (math.pi * d * d)


@compiled
def visibility(no, ni, alpha):
    """Evaluate G / (4 (n.wo) (n.wi)), height-correlated Smith."""
    a2 = alpha * alpha
    return 0.5 / max(no * math.sqrt(a2 + (1 - a2) * ni * ni) + ni * math.sqrt(a2 + (1 - a2) * no * no), 1e-7)


@compiled
def from_source(f, i, s, o, n, wo, alpha):
    """Return irradiance [3] on what faces source s, what a point's coat sends of it to wo for f0 = 1, that times
    Schlick's weight, and the weight."""
    to, power, tangent, _ = toward_source(f, i, s, o)
    ni, no = dot(to, n), max(dot(wo, n), 1e-3)
    h = moved(to, 1.0, wo)
    length = math.sqrt(dot(h, h)) + 1e-9
    m = 1 - min(dot(h, wo) / length, 1.0)
    schlick = m * m * m * m * m
    if alpha < 0.5 * tangent:  # a disc is seen as such
        away = math.acos(min(max(dot(minus(scaled(2 * no, n), wo), to), -1.0), 1.0))
        share = min(max((math.atan(tangent) - away) / max(2 * alpha, 0.03) + 0.5, 0.0), 1.0)
        one = share / (math.pi * tangent * tangent)
    elif ni > 0:
        wide = math.sqrt(alpha * alpha + WIDENED * tangent * tangent)
        one = distribution(min(dot(h, n) / length, 1.0), wide) * visibility(no, max(ni, 1e-4), alpha) * ni
    else:
        one = 0.0
    return power, one, one * schlick, schlick


@compiled
def mirrored(f, i, w, q, o, n, wo, alpha, samples, near, draw):
    """Return the light of all but sources that the coat of a point mirrors, for f0 = 1 [3], and that times Schlick's
    weight [3]. near: see shade_object; draw: the point's number, by which rays are drawn."""
    t, u = basis(n)
    no = max(dot(wo, n), 1e-3)
    local = dot(wo, t), dot(wo, u), no
    start = moved(o, OWN, n)
    whole = grazing = 0.0, 0.0, 0.0
    a2 = alpha * alpha
    g1o = 2 * no / (no + math.sqrt(a2 + (1 - a2) * no * no))
    for k in range(samples):
        a, b = in_disc(draw, k, samples)
        h = visible_normal(local, alpha, a, b)
        oh = max(dot(local, h), 1e-6)
        ix, iy, iz = minus(scaled(2 * oh, h), local)
        if iz <= 1e-4:
            continue
        weight = 4 * visibility(no, iz, alpha) * no * iz / g1o  # G / G1
        solid = 4 * no / (samples * max(distribution(h[2], alpha) * g1o, 1e-9))
        level = level_of(solid * i[at.SKY_ROWS] * i[at.SKY_ROWS] / (2 * math.pi), i[at.SKY_ROWS])
        d = mixed(ix, iy, iz, t, u, n)
        if near[cell_of(d)] and hit_body(f, i, w, 0, start, d, FAR_AWAY) >= 0:
            light = glow_of(f, i, 0)
        else:
            light = mirrored_along(f, i, w, q, start, d, level)
        m = 1 - oh
        whole = moved(whole, weight, light)
        grazing = moved(grazing, weight * m * m * m * m * m, light)
    return scaled(1 / samples, whole), scaled(1 / samples, grazing)


@compiled
def cell_of(d):
    """Return the number of the cell (views.cell_middles) that a unit direction lies in."""
    ring = min(int((d[1] + 1) * (VIEW_RINGS / 2)), VIEW_RINGS - 1)
    turn = angle_of(d[0], -d[2]) * (VIEW_AZIMUTHS / 2 / math.pi)
    return ring * VIEW_AZIMUTHS + (int(math.floor(turn)) & VIEW_AZIMUTHS - 1)


@compiled
def shade_object(f, i, w, q, points, normals, soft, albedo, f0, alpha, samples, rays, near, place, seed, out):
    """Fill out [N, 3] with the radiance of points of the object, seen from the eye. soft: [N, 3] irradiance on them of
    all but sources; albedo, f0: [N, 3]; near: [P, cells] bool, whether the object hides a cell or one beside it from
    points of places [N]."""
    for k in range(len(points)):
        o, n = row_of(points, k), row_of(normals, k)
        wo = minus(vector(f, at.EYE), o)
        wo = scaled(1 / math.sqrt(dot(wo, wo)), wo)
        base, hidden = row_of(soft, k), near[place[k]]
        whole, grazing = mirrored(f, i, w, q, o, n, wo, alpha, samples, hidden, seed + k)
        own = flat = 0.0, 0.0, 0.0
        for s in range(i[at.SOURCE_COUNT]):
            to, _, tangent, _ = toward_source(f, i, s, o)
            hides = tangent > CELL_TANGENT or hidden[cell_of(to)]
            few = rays if hides or dot(to, n) < tangent else 1
            _, cosine, share = seen_share(f, i, w, s, o, n, few, -1, OWN, hides, seed + k, 0, 1)
            if share <= 0:
                continue
            power, one, steep, schlick = from_source(f, i, s, o, n, wo, alpha)
            base = moved(base, cosine * (1 - schlick), power)
            power = scaled(share, power)
            own, flat = moved(own, one, power), moved(flat, steep, power)
        for c in range(3):
            coat = f0[k, c] * (whole[c] + own[c])
            out[k, c] = coat + (1 - f0[k, c]) * (grazing[c] + flat[c] + albedo[k, c] * base[c] / math.pi)


@compiled
def picture(f, i, w, q, camera, tangent, wanted, view, tan_half, radiance, cover, seed):
    """Return what the eye sees without the object, [S, S, 3], in the pixels `wanted` [S, S] of a square of tangents
    [-t, t]: the mean of two points of each, of four where they differ.

    camera: world_from_camera [3, 3]. view [3, 3], tan_half, radiance [V, V, 3], cover [V, V]: the object as it is seen,
    for coats that mirror it.
    """
    size, eye = len(wanted), vector(f, at.EYE)
    out = np.zeros((size, size, 3), np.float32)
    for row in range(size):
        line = out[row]
        for column in range(size):
            count, first, last = 0, 0.0, 0.0
            while wanted[row, column] and count < 4:
                if count == 2 and abs(first - last) < PICTURE_EVEN * (first + last):
                    break
                a, b = two_by_two(count)
                draw = seed + row * size + column
                scale = 1024 * random(4 * draw + count)
                x = ((2 * column + b + int(scale) / 1024) / size - 1) * tangent
                y = (1 - (2 * row + a + scale - int(scale)) / size) * tangent
                way = x, y, -1.0
                d = dot(row_of(camera, 0), way), dot(row_of(camera, 1), way), dot(row_of(camera, 2), way)
                d = scaled(1 / math.sqrt(x * x + y * y + 1), d)
                p, t, u, v = hit_panel(f, i, eye, d, FAR_AWAY, -1)
                lamp = lamp_along(f, i, eye, d, t)
                if lamp >= 0:
                    light = vector(f, i[at.SOURCE] + lamp * at.SOURCE_SIZE + at.POWER)
                elif p < 0:
                    light = sky_at(i, q, FULL, 0, d)
                else:
                    light = panel_seen(f, i, w, q, p, t, u, v, d, view, tan_half, radiance, cover, draw, count)
                add_to(line, column, light)
                first, last, count = last, light[0] + light[1] + light[2], count + 1
            for n in range(3):
                line[column, n] /= max(count, 1)
    return out


@compiled
def panel_seen(f, i, w, q, number, t, u, v, d, view, tan_half, radiance, cover, draw, part):
    """Return the radiance of a panel at u, v on it, t along a ray from the eye: with the object, exact shadows of
    sources, and its coat. draw: number of the pixel, by which rays are drawn; part: which of its four points it is."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    n = vector(f, p + at.NORMAL)
    o = moved(moved(vector(f, at.EYE), t, d), 1e-4, n)
    fallen = grid_at(f, i, number, at.SOFT, u, v)
    own = grazing = 0.0, 0.0, 0.0
    f0, alpha = f[p + at.F0], f[p + at.COAT_ALPHA]
    for s in range(i[at.SOURCE_COUNT]):
        _, cosine, share = seen_share(f, i, w, s, o, n, 1, number, 0.0, i[at.BODIES] > 0, draw, part, 4)
        if share <= 0:
            continue
        power, one, steep, _ = from_source(f, i, s, o, n, scaled(-1.0, d), alpha)
        fallen = moved(fallen, cosine, power)
        if f0 > 0:
            power = scaled(share, power)
            own, grazing = moved(own, one, power), moved(grazing, steep, power)
    if f[p + at.GROUND] > 0:
        far = max(abs(u), abs(v)) / f[p + at.HALF]
        fade = min(max((1 - far) / 0.25, 0.0), 1.0)
        free, light = grid_at(f, i, number, at.FREE, u, v), sky_at(i, q, FULL, 0, d)
        return (
            light[0] * (1 + fade * (min(fallen[0] / max(free[0], 1e-6), MOST_RATIO) - 1)),
            light[1] * (1 + fade * (min(fallen[1] / max(free[1], 1e-6), MOST_RATIO) - 1)),
            light[2] * (1 + fade * (min(fallen[2] / max(free[2], 1e-6), MOST_RATIO) - 1)),
        )
    shown = scaled((1 - f0) / math.pi, times(albedo_at(f, i, q, number, u, v, o), fallen))
    if f0 <= 0:
        return shown
    shown = moved(moved(shown, f0, own), 1 - f0, grazing)
    no = -dot(n, d)
    if i[at.BODIES] > 0 and alpha < 0.5 and no > 0:
        first = 12 * draw + 3 * part
        jitter = random(first) - 0.5, random(first + 1) - 0.5, random(first + 2) - 0.5
        way = moved(moved(d, 2 * no, n), 0.7 * alpha, jitter)
        away = hit_body(f, i, w, 0, o, way, FAR_AWAY)
        if away >= 0:
            m = 1 - no
            weight = f0 + (1 - f0) * m * m * m * m * m
            return moved(shown, weight, object_at(f, i, view, tan_half, radiance, cover, moved(o, away, way)))
    return moved(shown, 1.0, coat_along(f, i, q, number, at.LIT, REST, o, d))


@compiled
def object_at(f, i, view, tan_half, radiance, cover, place):
    """Return the object's radiance at a point of it: what the eye sees there, or its mean."""
    away = minus(place, vector(f, at.EYE))
    a, b, c = mixed(away[0], away[1], away[2], row_of(view, 0), row_of(view, 1), row_of(view, 2))
    size = len(cover)
    column, row = int((1 - a / c / tan_half) * size / 2), int((b / c / tan_half + 1) * size / 2)
    if 0 <= column < size and 0 <= row < size and cover[row, column] > 0.5:
        return row_of(radiance[row], column)
    return glow_of(f, i, 0)

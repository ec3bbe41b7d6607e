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
    basis,
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
from anyprobe_train.world.views import VIEW_AZIMUTHS, VIEW_RINGS

OWN = 0.055
"""Distance [radii] from the object's surface at which rays start, so that they leave the cells it lies in."""
MOST_RATIO = 1.5
"""Ratio of the light on a map's own ground with the object over that without."""
PICTURE_EVEN = 0.03
"""Difference of two points of a picture's pixel, over their sum, from which on four are seen."""
CELL_TANGENT = 0.2
"""Tangent of half of a cell's width."""
WIDENED = 0.19
"""Factor of a source's squared radius that it adds to alpha^2 of the lobe that mirrors it (light.octahedral)."""


@compiled
def seen_along(f, i, q, directions, cx, cy, cz, sky):
    """Return what c sees along directions [C, 3] on panels without the object, else sky [C, 3]."""
    seen = sky.copy()
    for c in range(len(directions)):
        dx, dy, dz = directions[c, 0], directions[c, 1], directions[c, 2]
        p, t, x, y = hit_panel(f, i, cx, cy, cz, dx, dy, dz, FAR_AWAY, -1)
        if p >= 0:
            seen[c] = diffuse_of(f, i, q, p, at.FREE, x, y, cx + t * dx, cy + t * dy, cz + t * dz)
    return seen


@compiled
def received(f, i, w, q, points, normals, bits, directions, sky, seen, out):
    """Fill out [N, 3] with the soft light that falls on points of the object over that of `seen` without it in the
    way. bits: [N, 2] uint64, cells that the object hides from each."""
    glow = i[at.BODY] + at.GLOW
    for k in range(len(points)):
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        px, py, pz = points[k, 0] + OWN * nx, points[k, 1] + OWN * ny, points[k, 2] + OWN * nz
        d0 = d1 = d2 = u0 = u1 = u2 = 1e-9
        for c in range(len(directions)):
            dx, dy, dz = directions[c, 0], directions[c, 1], directions[c, 2]
            cosine = nx * dx + ny * dy + nz * dz
            if cosine <= 0:
                continue
            u0 += cosine * seen[c, 0]
            u1 += cosine * seen[c, 1]
            u2 += cosine * seen[c, 2]
            if (bits[k, c >> 6] >> np.uint64(c & 63)) & np.uint64(1):
                r, g, b = f[glow], f[glow + 1], f[glow + 2]
            else:
                p, t, x, y = hit_panel(f, i, px, py, pz, dx, dy, dz, FAR_AWAY, -1)
                hidden = -1
                for m in range(1, i[at.BODIES]):
                    if hit_body(f, i, w, m, px, py, pz, dx, dy, dz, t) >= 0:
                        hidden = m
                if hidden > 0:
                    e = i[at.BODY] + hidden * at.BODY_SIZE + at.GLOW
                    r, g, b = f[e], f[e + 1], f[e + 2]
                elif p >= 0 and f[i[at.PANEL] + p * at.PANEL_SIZE + at.GROUND] > 0:
                    r, g, b = diffuse_of(f, i, q, p, at.LIT, x, y, px + t * dx, py + t * dy, pz + t * dz)
                elif p >= 0:
                    r, g, b = grid_at(f, i, p, at.LIT, x, y)
                    e = i[at.PANEL] + p * at.PANEL_SIZE + at.MEAN
                    r, g, b = r * f[e] / math.pi, g * f[e + 1] / math.pi, b * f[e + 2] / math.pi
                else:
                    r, g, b = sky[c, 0], sky[c, 1], sky[c, 2]
            d0 += cosine * r
            d1 += cosine * g
            d2 += cosine * b
        out[k, 0], out[k, 1], out[k, 2] = min(d0 / u0, 8.0), min(d1 / u1, 8.0), min(d2 / u2, 8.0)


@compiled
def visible_normal(wx, wy, wz, alpha, p, s):
    """Return a half vector by the normals that wo [local, z up] sees, for a point of the unit disc (Heitz, JCGT
    2018)."""
    vx, vy, vz = alpha * wx, alpha * wy, wz
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx / length, vy / length, vz / length
    across = vx * vx + vy * vy
    if across > 1e-12:
        root = 1.0 / math.sqrt(across)
        t1x, t1y, t1z = -vy * root, vx * root, 0.0
    else:
        t1x, t1y, t1z = 1.0, 0.0, 0.0
    t2x, t2y, t2z = vy * t1z - vz * t1y, vz * t1x - vx * t1z, vx * t1y - vy * t1x
    half = 0.5 * (1 + vz)
    s = (1 - half) * math.sqrt(max(1 - p * p, 0.0)) + half * s
    h = math.sqrt(max(1 - p * p - s * s, 0.0))
    nx, ny, nz = p * t1x + s * t2x + h * vx, p * t1y + s * t2y + h * vy, p * t1z + s * t2z + h * vz
    nx, ny, nz = alpha * nx, alpha * ny, max(nz, 1e-6)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return nx / length, ny / length, nz / length


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
def from_source(f, i, s, ox, oy, oz, nx, ny, nz, wx, wy, wz, alpha):
    """Return irradiance on what faces source s, what a point's coat sends of it to wo for f0 = 1, that times Schlick's
    weight, and the weight."""
    lx, ly, lz, er, eg, eb, tangent, _ = toward_source(f, i, s, ox, oy, oz)
    ni, no = lx * nx + ly * ny + lz * nz, max(wx * nx + wy * ny + wz * nz, 1e-3)
    hx, hy, hz = lx + wx, ly + wy, lz + wz
    length = math.sqrt(hx * hx + hy * hy + hz * hz) + 1e-9
    nh = min((hx * nx + hy * ny + hz * nz) / length, 1.0)
    m = 1 - min((hx * wx + hy * wy + hz * wz) / length, 1.0)
    schlick = m * m * m * m * m
    if alpha < 0.5 * tangent:  # a disc is seen as such
        rx, ry, rz = 2 * no * nx - wx, 2 * no * ny - wy, 2 * no * nz - wz
        away = math.acos(min(max(rx * lx + ry * ly + rz * lz, -1.0), 1.0))
        share = min(max((math.atan(tangent) - away) / max(2 * alpha, 0.03) + 0.5, 0.0), 1.0)
        one = share / (math.pi * tangent * tangent)
    elif ni > 0:
        wide = math.sqrt(alpha * alpha + WIDENED * tangent * tangent)
        one = distribution(nh, wide) * visibility(no, max(ni, 1e-4), alpha) * ni
    else:
        one = 0.0
    return er, eg, eb, one, one * schlick, schlick


@compiled
def mirrored(f, i, w, q, ox, oy, oz, nx, ny, nz, wx, wy, wz, alpha, samples, near, draw):
    """Return the light of all but sources that the coat of a point mirrors, for f0 = 1 [3], and that times Schlick's
    weight [3]. near: see shade_object; draw: the point's number, by which rays are drawn."""
    tx, ty, tz, ux, uy, uz = basis(nx, ny, nz)
    lx, ly = wx * tx + wy * ty + wz * tz, wx * ux + wy * uy + wz * uz
    no = max(wx * nx + wy * ny + wz * nz, 1e-3)
    px, py, pz = ox + OWN * nx, oy + OWN * ny, oz + OWN * nz
    r1 = g1 = b1 = rs = gs = bs = 0.0
    a2 = alpha * alpha
    g1o = 2 * no / (no + math.sqrt(a2 + (1 - a2) * no * no))
    for k in range(samples):
        a, b = in_disc(draw, k, samples)
        hx, hy, hz = visible_normal(lx, ly, no, alpha, a, b)
        oh = max(lx * hx + ly * hy + no * hz, 1e-6)
        ix, iy, iz = 2 * oh * hx - lx, 2 * oh * hy - ly, 2 * oh * hz - no
        if iz <= 1e-4:
            continue
        weight = 4 * visibility(no, iz, alpha) * no * iz / g1o  # G / G1
        solid = 4 * no / (samples * max(distribution(hz, alpha) * g1o, 1e-9))
        level = level_of(solid * i[at.SKY_ROWS] * i[at.SKY_ROWS] / (2 * math.pi), i[at.SKY_ROWS])
        dx, dy, dz = ix * tx + iy * ux + iz * nx, ix * ty + iy * uy + iz * ny, ix * tz + iy * uz + iz * nz
        if near[cell_of(dx, dy, dz)] and hit_body(f, i, w, 0, px, py, pz, dx, dy, dz, FAR_AWAY) >= 0:
            e = i[at.BODY] + at.GLOW
            r, g, c = f[e], f[e + 1], f[e + 2]
        else:
            r, g, c = mirrored_along(f, i, w, q, px, py, pz, dx, dy, dz, level)
        m = 1 - oh
        s = weight * m * m * m * m * m
        r1 += weight * r
        g1 += weight * g
        b1 += weight * c
        rs += s * r
        gs += s * g
        bs += s * c
    return r1 / samples, g1 / samples, b1 / samples, rs / samples, gs / samples, bs / samples


@compiled
def cell_of(x, y, z):
    """Return the number of the cell (views.cell_middles) that a unit direction lies in."""
    ring = min(int((y + 1) * (VIEW_RINGS / 2)), VIEW_RINGS - 1)
    return ring * VIEW_AZIMUTHS + (int(math.floor(angle_of(x, -z) * (VIEW_AZIMUTHS / 2 / math.pi))) & VIEW_AZIMUTHS - 1)


@compiled
def shade_object(f, i, w, q, points, normals, soft, albedo, f0, alpha, samples, rays, near, place, seed, out):
    """Fill out [N, 3] with the radiance of points of the object, seen from the eye. soft: [N, 3] irradiance on them of
    all but sources; albedo, f0: [N, 3]; near: [P, cells] bool, whether the object hides a cell or one beside it from
    points of places [N]."""
    for k in range(len(points)):
        ox, oy, oz = points[k, 0], points[k, 1], points[k, 2]
        nx, ny, nz = normals[k, 0], normals[k, 1], normals[k, 2]
        wx, wy, wz = f[at.EYE] - ox, f[at.EYE + 1] - oy, f[at.EYE + 2] - oz
        length = 1 / math.sqrt(wx * wx + wy * wy + wz * wz)
        wx, wy, wz = wx * length, wy * length, wz * length
        e0, e1, e2 = soft[k, 0], soft[k, 1], soft[k, 2]
        hidden = near[place[k]]
        m = mirrored(f, i, w, q, ox, oy, oz, nx, ny, nz, wx, wy, wz, alpha, samples, hidden, seed + k)
        s0 = s1 = s2 = g0 = g1 = g2 = 0.0
        for s in range(i[at.SOURCE_COUNT]):
            lx, ly, lz, _, _, _, tangent, _ = toward_source(f, i, s, ox, oy, oz)
            hides = tangent > CELL_TANGENT or hidden[cell_of(lx, ly, lz)]
            few = rays if hides or lx * nx + ly * ny + lz * nz < tangent else 1
            _, cosine, share = seen_share(f, i, w, s, ox, oy, oz, nx, ny, nz, few, -1, OWN, hides, seed + k, 0, 1)
            if share <= 0:
                continue
            er, eg, eb, one, grazing, schlick = from_source(f, i, s, ox, oy, oz, nx, ny, nz, wx, wy, wz, alpha)
            through = cosine * (1 - schlick)
            e0 += er * through
            e1 += eg * through
            e2 += eb * through
            er, eg, eb = er * share, eg * share, eb * share
            s0 += er * one
            s1 += eg * one
            s2 += eb * one
            g0 += er * grazing
            g1 += eg * grazing
            g2 += eb * grazing
        out[k, 0] = f0[k, 0] * (m[0] + s0) + (1 - f0[k, 0]) * (m[3] + g0 + albedo[k, 0] * e0 / math.pi)
        out[k, 1] = f0[k, 1] * (m[1] + s1) + (1 - f0[k, 1]) * (m[4] + g1 + albedo[k, 1] * e1 / math.pi)
        out[k, 2] = f0[k, 2] * (m[2] + s2) + (1 - f0[k, 2]) * (m[5] + g2 + albedo[k, 2] * e2 / math.pi)


@compiled
def picture(f, i, w, q, camera, tangent, wanted, view, tan_half, radiance, cover, seed):
    """Return what the eye sees without the object, [S, S, 3], in the pixels `wanted` [S, S] of a square of tangents
    [-t, t]: the mean of two points of each, of four where they differ.

    camera: world_from_camera [3, 3]. view [3, 3], tan_half, radiance [V, V, 3], cover [V, V]: the object as it is seen,
    for coats that mirror it.
    """
    size = len(wanted)
    out = np.zeros((size, size, 3), np.float32)
    ex, ey, ez = f[at.EYE], f[at.EYE + 1], f[at.EYE + 2]
    for row in range(size):
        for column in range(size):
            count, first, last = 0, 0.0, 0.0
            while wanted[row, column] and count < 4:
                if count == 2 and abs(first - last) < PICTURE_EVEN * (first + last):
                    break
                a, b = two_by_two(count)
                draw = seed + row * size + column
                scaled = 1024 * random(4 * draw + count)
                x = ((2 * column + b + int(scaled) / 1024) / size - 1) * tangent
                y = (1 - (2 * row + a + scaled - int(scaled)) / size) * tangent
                length = 1 / math.sqrt(x * x + y * y + 1)
                dx = (camera[0, 0] * x + camera[0, 1] * y - camera[0, 2]) * length
                dy = (camera[1, 0] * x + camera[1, 1] * y - camera[1, 2]) * length
                dz = (camera[2, 0] * x + camera[2, 1] * y - camera[2, 2]) * length
                p, t, u, v = hit_panel(f, i, ex, ey, ez, dx, dy, dz, FAR_AWAY, -1)
                lamp = lamp_along(f, i, ex, ey, ez, dx, dy, dz, t)
                if lamp >= 0:
                    e = i[at.SOURCE] + lamp * at.SOURCE_SIZE + at.POWER
                    r, g, c = f[e], f[e + 1], f[e + 2]
                elif p < 0:
                    r, g, c = sky_at(i, q, FULL, 0, dx, dy, dz)
                else:
                    r, g, c = panel_seen(
                        f, i, w, q, p, t, u, v, dx, dy, dz, view, tan_half, radiance, cover, draw, count
                    )
                out[row, column, 0] += r
                out[row, column, 1] += g
                out[row, column, 2] += c
                first, last, count = last, r + g + c, count + 1
            for n in range(3):
                out[row, column, n] /= max(count, 1)
    return out


@compiled
def panel_seen(f, i, w, q, number, t, u, v, dx, dy, dz, view, tan_half, radiance, cover, draw, part):
    """Return the radiance of a panel at u, v on it, t along a ray from the eye: with the object, exact shadows of
    sources, and its coat. draw: number of the pixel, by which rays are drawn; part: which of its four points it is."""
    p = i[at.PANEL] + number * at.PANEL_SIZE
    nx, ny, nz = f[p + at.NORMAL], f[p + at.NORMAL + 1], f[p + at.NORMAL + 2]
    qx, qy, qz = f[at.EYE] + t * dx + 1e-4 * nx, f[at.EYE + 1] + t * dy + 1e-4 * ny, f[at.EYE + 2] + t * dz + 1e-4 * nz
    e0, e1, e2 = grid_at(f, i, number, at.SOFT, u, v)
    s0 = s1 = s2 = g0 = g1 = g2 = 0.0
    f0, alpha = f[p + at.F0], f[p + at.COAT_ALPHA]
    for s in range(i[at.SOURCE_COUNT]):
        _, cosine, share = seen_share(
            f, i, w, s, qx, qy, qz, nx, ny, nz, 1, number, 0.0, i[at.BODIES] > 0, draw, part, 4
        )
        if share <= 0:
            continue
        _, _, _, er, eg, eb, _, _ = toward_source(f, i, s, qx, qy, qz)
        e0 += er * cosine
        e1 += eg * cosine
        e2 += eb * cosine
        if f0 > 0:
            _, _, _, one, grazing, _ = from_source(f, i, s, qx, qy, qz, nx, ny, nz, -dx, -dy, -dz, alpha)
            s0 += er * share * one
            s1 += eg * share * one
            s2 += eb * share * one
            g0 += er * share * grazing
            g1 += eg * share * grazing
            g2 += eb * share * grazing
    if f[p + at.GROUND] > 0:
        far = max(abs(u), abs(v)) / f[p + at.HALF]
        fade = min(max((1 - far) / 0.25, 0.0), 1.0)
        fr, fg, fb = grid_at(f, i, number, at.FREE, u, v)
        r, g, b = sky_at(i, q, FULL, 0, dx, dy, dz)
        return (
            r * (1 + fade * (min(e0 / max(fr, 1e-6), MOST_RATIO) - 1)),
            g * (1 + fade * (min(e1 / max(fg, 1e-6), MOST_RATIO) - 1)),
            b * (1 + fade * (min(e2 / max(fb, 1e-6), MOST_RATIO) - 1)),
        )
    ar, ag, ab = albedo_at(f, i, q, number, u, v, qx, qy, qz)
    r, g, b = (1 - f0) * ar * e0 / math.pi, (1 - f0) * ag * e1 / math.pi, (1 - f0) * ab * e2 / math.pi
    if f0 <= 0:
        return r, g, b
    r, g, b = r + f0 * s0 + (1 - f0) * g0, g + f0 * s1 + (1 - f0) * g1, b + f0 * s2 + (1 - f0) * g2
    no = -(nx * dx + ny * dy + nz * dz)
    if i[at.BODIES] > 0 and alpha < 0.5 and no > 0:
        one, two, three = (
            random(12 * draw + 3 * part),
            random(12 * draw + 3 * part + 1),
            random(12 * draw + 3 * part + 2),
        )
        rx = dx + 2 * no * nx + 0.7 * alpha * (one - 0.5)
        ry = dy + 2 * no * ny + 0.7 * alpha * (two - 0.5)
        rz = dz + 2 * no * nz + 0.7 * alpha * (three - 0.5)
        away = hit_body(f, i, w, 0, qx, qy, qz, rx, ry, rz, FAR_AWAY)
        if away >= 0:
            m = 1 - no
            weight = f0 + (1 - f0) * m * m * m * m * m
            x, y, z = qx + away * rx, qy + away * ry, qz + away * rz
            kr, kg, kb = object_at(f, i, view, tan_half, radiance, cover, x, y, z)
            return r + weight * kr, g + weight * kg, b + weight * kb
    kr, kg, kb = coat_along(f, i, q, number, at.LIT, REST, qx, qy, qz, dx, dy, dz)
    return r + kr, g + kg, b + kb


@compiled
def object_at(f, i, view, tan_half, radiance, cover, x, y, z):
    """Return the object's radiance at a point of it: what the eye sees there, or its mean."""
    x, y, z = x - f[at.EYE], y - f[at.EYE + 1], z - f[at.EYE + 2]
    a = view[0, 0] * x + view[1, 0] * y + view[2, 0] * z
    b = view[0, 1] * x + view[1, 1] * y + view[2, 1] * z
    c = -(view[0, 2] * x + view[1, 2] * y + view[2, 2] * z)
    size = len(cover)
    column, row = int((a / c / tan_half + 1) * size / 2), int((1 - b / c / tan_half) * size / 2)
    if 0 <= column < size and 0 <= row < size and cover[row, column] > 0.5:
        return radiance[row, column, 0], radiance[row, column, 1], radiance[row, column, 2]
    e = i[at.BODY] + at.GLOW
    return f[e], f[e + 1], f[e + 2]

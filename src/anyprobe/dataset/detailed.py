"""Rooms, studios and streets with as much detail as a photo: the maps that lend theirs to estimates (anyprobe.detail).

Furniture, books, planks, bricks, clouds, trees and facades, drawn from a seed. Metres; the eye stands at the origin's
height above the floor; radiance has no scale.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import pixel_directions
from anyprobe.dataset.boxes import Boxes, Builder, Hits, cast, lines, noise, turbulence, visible
from anyprobe.dataset.sky import GROUNDS, clear_sky
from anyprobe.dataset.studio import direction_at, tint

SUPERSAMPLE = 2
PLAIN, WOOD, BOOKS, FABRIC, FACADE, LEAVES, GRID = range(7)
"""Textures of boxes."""
WOODS = np.array([[0.42, 0.27, 0.15], [0.25, 0.14, 0.07], [0.6, 0.46, 0.3], [0.33, 0.25, 0.19], [0.5, 0.5, 0.48]])
WALLS = np.array([[0.8, 0.78, 0.74], [0.72, 0.7, 0.62], [0.55, 0.6, 0.62], [0.7, 0.55, 0.45], [0.4, 0.45, 0.4]])


def panorama(look: Callable[[np.ndarray], np.ndarray], height: int) -> np.ndarray:
    """What look(d [N, 3]) -> [N, 3] gives, [height, 2 height, 3] float32, each pixel the mean of SUPERSAMPLE^2."""
    d = pixel_directions(height * SUPERSAMPLE).astype(np.float64)
    bands = [look(band.reshape(-1, 3)).reshape(band.shape) for band in np.array_split(d, 8)]
    fine = np.minimum(np.concatenate(bands), 1e4)
    shape = (height, SUPERSAMPLE, 2 * height, SUPERSAMPLE, 3)
    return fine.reshape(shape).mean(axis=(1, 3)).astype(np.float32)


def detailed_room(rng: np.random.Generator, height: int) -> np.ndarray:
    """A furnished room, lit by its windows and lamps."""
    half = np.array([rng.uniform(1.7, 3.4), rng.uniform(1.15, 1.5), rng.uniform(1.7, 3.4)])
    eye = np.array([rng.uniform(-0.45, 0.45) * half[0], rng.uniform(-0.25, 0.25), rng.uniform(-0.45, 0.45) * half[2]])
    scene = Builder()
    wood = WOODS[rng.integers(5)] * rng.uniform(0.6, 1.3)
    for _ in range(rng.integers(12, 22)):
        _furnish(rng, scene, half, eye, wood)
    lamps = _lamps(rng, scene, half)
    openings = _openings(rng, half)
    return _interior(rng, scene.boxes(), half, eye, lamps, openings, WALLS[rng.integers(5)] * tint(rng, 0.05), wood, height)


def detailed_studio(rng: np.random.Generator, height: int) -> np.ndarray:
    """A photographer's studio: soft boxes and panels on stands, a backdrop, dark walls or white ones."""
    half = np.array([rng.uniform(3, 5), rng.uniform(1.5, 2.2), rng.uniform(3, 5)])
    eye = rng.uniform(-0.2, 0.2, 3) * half * [1, 0.5, 1]
    scene, lamps = Builder(), []
    dark = np.full(3, rng.choice([0.04, 0.12, 0.5, 0.75])) * tint(rng, 0.03)
    for _ in range(rng.integers(3, 7)):
        a, r, size = rng.uniform(0, 6.28), rng.uniform(1.8, 0.9 * half[[0, 2]].min()), rng.uniform(0.4, 1.3, 2)
        at = np.array([r * np.sin(a), rng.uniform(-0.2, 1.0), -r * np.cos(a)])
        lit = rng.random() < 0.6
        along = abs(np.sin(a)) > 0.7
        panel = [0.1, size[1], size[0]] if along else [size[0], size[1], 0.1]
        scene.add(at, panel, 0.8 if rng.random() < 0.7 else 0.03, rng.uniform(6, 25) if lit else 0.0, GRID)
        low, high = -half[1], at[1] - size[1] / 2
        scene.add([at[0], (low + high) / 2, at[2]], [0.04, high - low, 0.04], 0.03)
        for leg in (-0.3, 0.3):
            scene.add([at[0] + leg / 2, low + 0.03, at[2]], [0.35, 0.03, 0.03], 0.03)
            scene.add([at[0], low + 0.03, at[2] + leg / 2], [0.03, 0.03, 0.35], 0.03)
        if lit:
            lamps.append((at * 0.92, 4.0 * size.prod()))
    for x in np.arange(-half[0], half[0], rng.uniform(0.8, 1.6)):  # rails under the ceiling
        scene.add([x, half[1] - 0.25, 0], [0.06, 0.06, 2 * half[2] - 0.1], 0.05 + 0.5 * rng.random())
    scene.add([0, -0.1, -half[2] + 0.15], [rng.uniform(1.5, 2.7), 2 * half[1] - 0.4, 0.05], rng.uniform(0.1, 0.9) * tint(rng, 0.15))
    for _ in range(rng.integers(3, 8)):  # cases and apple boxes
        a, size = rng.uniform(0, 6.28), rng.uniform(0.2, 0.7, 3)
        spot = np.array([np.sin(a), 0, np.cos(a)]) * rng.uniform(0.6, 0.9) * half
        scene.add([spot[0], -half[1] + size[1] / 2, spot[2]], size, rng.choice([0.05, 0.3, 0.6]), 0, rng.choice([PLAIN, WOOD]))
    if not lamps:
        lamps = [(np.array([0.5, half[1] - 0.3, 0.2]), 3.0)]
    return _interior(rng, scene.boxes(), half, eye, lamps, [], dark, WOODS[rng.integers(5)], height)


def _furnish(rng: np.random.Generator, scene: Builder, half: np.ndarray, eye: np.ndarray, wood: np.ndarray) -> None:
    """One piece of furniture against a wall or in the room, out of the eye's way."""
    floor, kind = -half[1], rng.choice(["table", "shelf", "sofa", "cabinet", "chair", "bed", "plant"])
    deep = {"table": 0.8, "shelf": 0.35, "sofa": 0.9, "cabinet": 0.5, "chair": 0.5, "bed": 2.0, "plant": 0.4}[kind]
    wide = {"table": 1.5, "shelf": 1.2, "sofa": 2.0, "cabinet": 1.3, "chair": 0.5, "bed": 1.5, "plant": 0.4}[kind]
    wide, turned = wide * rng.uniform(0.7, 1.4), rng.random() < 0.5
    x, z = (deep, wide) if turned else (wide, deep)
    side = rng.choice([-1, 1])
    gap = 0.06 if kind not in ("table", "chair") else rng.uniform(0.06, 0.8)
    at = np.array([rng.uniform(-1, 1) * max(half[0] - x / 2, 0), 0, rng.uniform(-1, 1) * max(half[2] - z / 2, 0)])
    axis = 0 if turned else 2
    at[axis] = side * (half[axis] - deep / 2 - gap)
    reach = np.array([x, z]) / 2
    if np.all(np.abs(at - eye)[[0, 2]] < reach + 0.45) or any(
        np.all(np.minimum(high[[0, 2]], at[[0, 2]] + reach) > np.maximum(low[[0, 2]], at[[0, 2]] - reach))
        for low, high, *_ in scene.rows
    ):
        return

    def put(centre, size, albedo, texture=PLAIN, shadow=True):
        scene.add(at + np.array([centre[0], floor + centre[1], centre[2]]), size, albedo, 0.0, texture, shadow)

    color = rng.uniform(0.05, 0.7) * np.minimum(tint(rng, 0.3), 1.4)
    if kind == "table":
        put((0, 0.73, 0), (x, 0.04, z), wood, WOOD)
        for i in (-1, 1):
            for j in (-1, 1):
                put((i * (x / 2 - 0.05), 0.355, j * (z / 2 - 0.05)), (0.06, 0.71, 0.06), wood, WOOD)
        for _ in range(rng.integers(1, 6)):
            size = rng.uniform([0.06, 0.03, 0.06], [0.3, 0.3, 0.25])
            put((rng.uniform(-0.4, 0.4) * x, 0.75 + size[1] / 2, rng.uniform(-0.4, 0.4) * z), size, rng.uniform(0.03, 0.8) * tint(rng, 0.3))
    elif kind == "shelf":
        tall = rng.uniform(1.0, 2.0)
        put((0, tall / 2, 0), (x, tall, z), wood, BOOKS)
    elif kind == "sofa":
        put((0, 0.22, 0), (x, 0.44, z), color, FABRIC)
        back = [0.0, 0.6, 0.0]
        back[axis] = side * (deep / 2 - 0.1)
        put(back, (0.2, 0.5, z) if turned else (x, 0.5, 0.2), color, FABRIC)
        for end in (-1, 1):
            arm = [0.0, 0.5, 0.0]
            arm[2 - axis] = end * (wide / 2 - 0.09)
            put(arm, (x, 0.25, 0.18) if turned else (0.18, 0.25, z), color, FABRIC)
    elif kind == "cabinet":
        tall = rng.uniform(0.5, 1.9)
        put((0, tall / 2, 0), (x, tall, z), wood if rng.random() < 0.6 else color, GRID if rng.random() < 0.5 else WOOD)
        put((0, tall + 0.15, 0), (0.18, 0.3, 0.18), rng.uniform(0.05, 0.8) * tint(rng, 0.3))
    elif kind == "chair":
        put((0, 0.45, 0), (0.45, 0.05, 0.45), color, FABRIC)
        put((0, 0.72, 0.2 * side), (0.42, 0.45, 0.04), wood, WOOD)
        for i in (-0.19, 0.19):
            for j in (-0.19, 0.19):
                put((i, 0.22, j), (0.04, 0.44, 0.04), wood)
    elif kind == "bed":
        put((0, 0.25, 0), (x, 0.4, z), color, FABRIC)
        put((0, 0.5, 0), (0.9 * x, 0.12, 0.9 * z), rng.uniform(0.4, 0.85) * tint(rng, 0.1), FABRIC)
    else:
        put((0, 0.18, 0), (0.35, 0.36, 0.35), rng.uniform(0.1, 0.6) * tint(rng, 0.3))
        for _ in range(24):
            size = rng.uniform(0.05, 0.2)
            put(rng.normal([0, 0.8, 0], [0.16, 0.22, 0.16]), (size, size * 0.8, size), np.array([0.06, 0.14, 0.04]) * rng.uniform(0.4, 1.8), LEAVES, False)


def _lamps(rng: np.random.Generator, scene: Builder, half: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Lamps of the room: panels under the ceiling, spots, one that hangs, or one that stands."""
    kind, found = rng.choice(["panels", "spots", "pendant", "standing", "none"]), []
    warm = np.array([1.2, 1.0, 0.75]) ** rng.uniform(0, 2)
    if kind in ("panels", "spots"):
        size = rng.uniform([0.5, 0.2], [0.65, 1.2]) if kind == "panels" else [0.1, 0.1]
        nx, nz = np.maximum(1, (half[[0, 2]] / rng.uniform(0.9, 1.6)).astype(int))
        for x in (np.arange(nx) + 0.5) / nx * 2 - 1:
            for z in (np.arange(nz) + 0.5) / nz * 2 - 1:
                at = np.array([x * half[0], half[1] - 0.015, z * half[2]])
                scene.add(at, [size[0], 0.03, size[1]], 0.8, (12 if kind == "panels" else 60) * warm)
                found.append((at - [0, 0.05, 0], 3.0 / (nx * nz)))
    elif kind == "pendant":
        at = np.array([rng.uniform(-0.4, 0.4) * half[0], half[1] - rng.uniform(0.5, 0.9), rng.uniform(0.3, 0.6) * half[2]])
        scene.add(at, [0.35, 0.22, 0.35], 0.6, 14 * warm)
        scene.add([at[0], (at[1] + half[1]) / 2, at[2]], [0.015, half[1] - at[1], 0.015], 0.05)
        found.append((at - [0, 0.15, 0], 2.0))
    elif kind == "standing":
        at = np.array([rng.choice([-1, 1]) * (half[0] - 0.4), 0.3, rng.choice([-1, 1]) * (half[2] - 0.4)])
        scene.add(at, [0.36, 0.3, 0.36], 0.7, 12 * warm)
        scene.add([at[0], (at[1] - 0.2 - half[1]) / 2, at[2]], [0.03, at[1] - 0.15 + half[1], 0.03], 0.08)
        found.append((at + [0, 0.2, 0], 1.2))
    order = rng.permutation(len(found))[:3]
    return [found[k] for k in order]


def _openings(rng: np.random.Generator, half: np.ndarray) -> list[tuple]:
    """Windows, doors, pictures and curtains: kind, axis and side of the wall, centre [2] along it and up, half size [2]."""
    found = []
    for kind in ["window"] * rng.integers(1, 6) + ["door"] * rng.integers(1, 3) + ["picture"] * rng.integers(3, 10):
        axis, side = rng.choice([0, 2]), rng.choice([-1, 1])
        long = half[2 - axis]
        size = {"window": rng.uniform([0.4, 0.5], [1.3, 0.9]), "door": [0.45, 1.0], "picture": rng.uniform(0.12, 0.5, 2)}[kind]
        size = np.minimum(size, [0.8 * long, 0.9 * half[1]])
        up = {"window": rng.uniform(-0.1, 0.2), "door": size[1] - half[1], "picture": rng.uniform(0.0, 0.4)}[kind]
        centre = np.array([rng.uniform(-1, 1) * (long - size[0]) * 0.95, min(up, half[1] - size[1] - 0.05)])
        clash = any(
            a == axis and s == side and np.all(np.abs(centre - c) < size + e + 0.12) for _, a, s, c, e in found
        )
        if not clash:
            found.append((kind, axis, side, centre, size))
    return found


def _interior(rng, boxes: Boxes, half, eye, lamps, openings, wall, wood, height: int) -> np.ndarray:
    """The inside of a room with all that is in it."""
    seed, turn = int(rng.integers(1 << 30)), rotation_y(rng.uniform(0, 2 * np.pi))
    day = rng.random() < 0.75
    outside = np.array([0.5, 0.62, 0.75]) * rng.uniform(3, 9) if day else np.array([0.01, 0.012, 0.02])
    floor_kind, wall_kind = rng.integers(3), rng.integers(4)
    ceiling = rng.uniform(0.7, 0.85) if wall.mean() > 0.15 else wall.mean()
    lights = list(lamps) + [
        (_on_wall(half, axis, side, centre, 0.1), 3.0 * size.prod() * (1.0 if day else 0.0))
        for kind, axis, side, centre, size in openings
        if kind == "window"
    ]
    lights = [light for light in lights if light[1] > 0] or [(np.array([0.0, half[1] - 0.1, 0.0]), 1.0)]

    def look(d: np.ndarray) -> np.ndarray:
        d = d @ turn
        hits = cast(boxes, eye, d)
        with np.errstate(divide="ignore"):
            t = np.where(d > 0, (half - eye) / d, (-half - eye) / d)
        t = np.where(np.isfinite(t), t, np.inf)
        axis = t.argmin(axis=1)
        far = t.min(axis=1)
        is_wall = far < hits.distance
        inward = np.eye(3)[axis] * -np.sign(np.take_along_axis(d, axis[:, None], axis=1))
        position = np.where(is_wall[:, None], eye + d * far[:, None], hits.position)
        normal = np.where(is_wall[:, None], inward, hits.normal)
        foot = np.where(is_wall, far, hits.distance) * np.pi / (height * SUPERSAMPLE)
        albedo, glow = np.empty_like(d), np.zeros_like(d)
        for surface in range(3):
            for side in (-1, 1):
                here = np.flatnonzero(is_wall & (axis == surface) & (np.sign(d[:, surface]) == side))
                args = (np.random.default_rng((seed, 1)), position[here], foot[here])
                if surface == 1:
                    albedo[here] = _floor(*args, floor_kind, wood) if side < 0 else ceiling
                else:
                    albedo[here] = _wall(*args, surface, wall_kind, wall, half)
                    on = [one for one in openings if one[1] == surface and one[2] == side]
                    _lay(np.random.default_rng((seed, 2)), on, position[here], foot[here], d[here], here, albedo, glow, outside)
        on_box = np.flatnonzero(~is_wall)
        index = hits.index[on_box]
        albedo[on_box] = _texture(np.random.default_rng((seed, 3)), boxes, index, position[on_box], normal[on_box], foot[on_box])
        glow[on_box] = boxes.emission[index]
        corners = np.arange(len(d)).reshape(-1, 2 * height * SUPERSAMPLE)[::SUPERSAMPLE, ::SUPERSAMPLE]
        light = _light(boxes, position[corners.ravel()], normal[corners.ravel()], lights).reshape(corners.shape)
        light = light.repeat(SUPERSAMPLE, axis=0).repeat(SUPERSAMPLE, axis=1).ravel()
        corner = sum(np.exp(-(half[k] - np.abs(position[:, k])) / 0.18) * (np.abs(normal[:, k]) < 0.5) for k in range(3))
        ambient = 0.32 * (1.0 - 0.35 * np.minimum(corner, 1.5) / 1.5)
        return glow + albedo * (light + ambient)[:, None]

    return panorama(look, height)


def _on_wall(half: np.ndarray, axis: int, side: int, centre: np.ndarray, inside: float) -> np.ndarray:
    """A point [3] of a wall, so many metres before it."""
    at = np.empty(3)
    at[axis], at[2 - axis], at[1] = side * (half[axis] - inside), *centre
    return at


def _light(boxes: Boxes, position: np.ndarray, normal: np.ndarray, lights: list) -> np.ndarray:
    """Direct light of a few lights, each of four points, [N]."""
    total = np.zeros(len(position))
    start = position + 2e-3 * normal
    for at, power in lights:
        for offset in ([0.2, 0.0, 0.2], [-0.2, 0.05, 0.1], [0.1, -0.05, -0.2], [-0.1, 0.0, -0.1]):
            way = at + offset - position
            distance = np.linalg.norm(way, axis=1) + 0.3
            cosine = np.maximum((way * normal).sum(axis=1) / distance, 0.0)
            total += power / 4 * cosine / distance**2 * visible(boxes, start, at + offset)
    return np.minimum(total, 3.0)


def _floor(rng, position, foot, kind: int, wood) -> np.ndarray:
    """Planks, tiles or carpet."""
    x, z = position[:, 0], position[:, 2]
    if kind == 0:
        row = np.floor(x / 0.14)
        shade = 0.8 + 0.35 * noise(rng, np.stack([row * 7.3, np.floor((z + row * 0.77) / 1.1), row * 0], -1))
        grain = 0.22 * turbulence(rng, position * [40, 1, 3], 3, foot * 20)
        seam = np.maximum(lines(x, 0.14, 0.006, foot), lines(z + row * 0.77, 1.1, 0.006, foot))
        return wood * ((shade + grain) * (1 - 0.7 * seam))[:, None].clip(0.1)
    if kind == 1:
        size = 0.45
        check = (np.floor(x / size) + np.floor(z / size)) % 2
        seam = np.maximum(lines(x, size, 0.012, foot), lines(z, size, 0.012, foot))
        vein = 0.12 * turbulence(rng, position * 5, 4, foot * 5)
        shade = (0.55 - 0.25 * check * rng.integers(0, 2) + vein) * (1 - 0.5 * seam)
        return shade[:, None].clip(0.05) * tint(rng, 0.06)
    spots = 0.25 * turbulence(rng, position * 25, 4, foot * 25) + 0.12 * turbulence(rng, position * 1.5, 3)
    return (0.3 * (1 + spots))[:, None].clip(0.04) * tint(rng, 0.1)


def _wall(rng, position, foot, surface: int, kind: int, wall, half) -> np.ndarray:
    """Plaster, bricks, panels or paper, and a skirting board."""
    u, y = position[:, 2 - surface], position[:, 1]
    shade = 1.0 + 0.05 * turbulence(rng, position * 2, 5, foot * 2)
    if kind == 1:
        row = np.floor(y / 0.075)
        u2 = u + 0.11 * (row % 2)
        joint = np.maximum(lines(y, 0.075, 0.01, foot), lines(u2, 0.22, 0.01, foot))
        brick = 0.25 * noise(rng, np.stack([row * 3.1, np.floor(u2 / 0.22) * 5.7, row * 0], -1))
        shade = (shade + brick) * (1 - 0.3 * joint)
    elif kind == 2:
        seam = lines(u, rng.uniform(0.5, 1.2), 0.012, foot)
        low = y < -half[1] + 1.0
        shade = np.where(low, 0.75, 1.0) * shade * (1 - 0.4 * seam * low)
    elif kind == 3:
        shade = shade * (1 - 0.12 * lines(u, 0.12, 0.06, foot))
    color = wall * shade[:, None]
    board = y < -half[1] + 0.09
    color[board] = 0.7
    return color.clip(0.01, 0.92)


def _lay(rng, openings, position, foot, d, here, albedo, glow, outside) -> None:
    """Windows, doors and pictures laid over a wall's pixels `here` of albedo and glow."""
    for kind, axis, _, centre, size in openings:
        u = (position[:, 2 - axis] - centre[0]) / size[0]
        v = (position[:, 1] - centre[1]) / size[1]
        inside = (np.abs(u) < 1) & (np.abs(v) < 1)
        edge = np.maximum(np.abs(u) * size[0] - size[0], np.abs(v) * size[1] - size[1])
        at, frame = here[inside], (edge > -0.05)[inside]
        local = np.stack([u, v, u * 0], -1)[inside]
        if kind == "window":
            pane = 0.35 + 0.5 * rng.random()
            bars = np.minimum(lines(local[:, 0] * size[0] + 0.02, pane, 0.04, foot[inside]) + lines(local[:, 1] * size[1] + 0.02, 1.2 * pane, 0.04, foot[inside]), 1.0)
            bars = np.where(frame, 1.0, bars)[:, None]
            far = d[inside] * [6, 6, 6]
            green = np.array([0.2, 0.28, 0.12]) * (1 + 0.8 * turbulence(rng, far * [3, 3, 3], 5)[:, None]).clip(0.1)
            tree = d[inside][:, 1] + 0.12 * turbulence(rng, far, 4) < rng.uniform(-0.1, 0.15)
            view = np.where(tree[:, None], outside * green, outside * (1 + 0.25 * turbulence(rng, far * 0.3, 4)[:, None]))
            albedo[at] = 0.6 * bars
            glow[at] = view * (1 - bars)
        elif kind == "door":
            color = rng.uniform(0.15, 0.8) * tint(rng, 0.1)
            panel = (np.abs(np.abs(local[:, 1]) - 0.5) < 0.36) & (np.abs(local[:, 0]) < 0.7)
            rim = (np.abs(np.abs(local[:, 1]) - 0.5) < 0.38) & (np.abs(local[:, 0]) < 0.74) & ~panel
            shade = np.where(frame, 1.15, np.where(rim, 0.6, 1.0))
            shade[(np.abs(local[:, 0] - 0.85) < 0.05) & (np.abs(local[:, 1] + 0.02) < 0.03)] = 0.15
            albedo[at] = (color * shade[:, None]).clip(0.02, 0.9)
        else:
            paint = np.stack([turbulence(rng, local * rng.uniform(1, 4), 5) for _ in range(3)], -1)
            albedo[at] = np.where(frame[:, None], rng.choice([0.05, 0.3, 0.8]), (0.4 + 0.3 * paint.mean(axis=1, keepdims=True) + 0.12 * paint).clip(0.02, 0.9))


def _texture(rng, boxes: Boxes, index, position, normal, foot) -> np.ndarray:
    """Albedo [N, 3] of boxes number index [N]."""
    color = boxes.albedo[index].copy()
    kind, low, high = boxes.texture[index], boxes.low[index], boxes.high[index]
    across = np.where(np.abs(normal[:, 0]) > 0.5, position[:, 2], position[:, 0])
    side = np.abs(normal[:, 1]) < 0.5
    wood = kind == WOOD
    color[wood] *= (1 + 0.3 * turbulence(rng, position[wood] * [6, 40, 6], 3, foot[wood] * 30))[:, None]
    fabric = kind == FABRIC
    fold = 0.2 * turbulence(rng, position[fabric] * 4, 5, foot[fabric] * 4)
    seam = lines(across[fabric], 0.6, 0.015, foot[fabric])
    color[fabric] *= ((1 + fold) * (1 - 0.5 * seam))[:, None]
    leaf = kind == LEAVES
    color[leaf] *= (1 + 0.7 * turbulence(rng, position[leaf] * 14, 3))[:, None].clip(0.15)
    books = np.flatnonzero((kind == BOOKS) & side)
    board = lines((high - position)[books, 1], 0.34, 0.025, foot[books])
    level = np.floor((high - position)[books, 1] / 0.34)
    thick = 0.036
    spine = np.stack([np.floor(across[books] / thick) * 3.7, level * 11.3, level * 0], -1)
    hue = np.stack([noise(rng, spine + k * 31.0) for k in range(3)], -1)
    tall = ((high - position)[books, 1] % 0.34) / 0.34 > 0.18 + 0.12 * noise(rng, spine + 77.0)
    gap = lines(across[books], thick, 0.005, foot[books])
    cover = np.where(tall[:, None], (0.3 + 0.32 * hue).clip(0.03, 0.8) * (1 - 0.6 * gap)[:, None], 0.03)
    color[books] = cover + board[:, None] * (color[books] - cover)
    grid = np.flatnonzero((kind == GRID) & side)
    doors = np.maximum(lines(across[grid], 0.45, 0.012, foot[grid]), lines((high - position)[grid, 1], 0.4, 0.012, foot[grid]))
    color[grid] *= (1 - 0.75 * doors)[:, None]
    facade = np.flatnonzero((kind == FACADE) & side)
    color[facade] = _facade(rng, index[facade], across[facade], (position - low)[facade, 1], foot[facade], color[facade])
    return color.clip(0.005, 0.95)


def _facade(rng, index, across, up, foot, color) -> np.ndarray:
    """Storeys of windows, sills and stains of houses number index [N]."""
    houses = rng.uniform(size=(int(index.max(initial=0)) + 1, 4))[index]
    wide, tall = 1.6 + 2.2 * houses[:, 0], 2.8 + 0.8 * houses[:, 1]
    u, v = (across % wide) / wide, (up % tall) / tall
    glass = (np.abs(u - 0.5) < 0.16 + 0.2 * houses[:, 2]) & (np.abs(v - 0.55) < 0.26) & (up > 0.4)
    frame = (np.abs(u - 0.5) < 0.19 + 0.2 * houses[:, 2]) & (np.abs(v - 0.55) < 0.3) & ~glass & (up > 0.4)
    pane = np.stack([np.floor(across / wide) * 5.1, np.floor(up / tall) * 9.7, index * 3.3], -1)
    dark = (0.1 + 0.12 * noise(rng, pane))[:, None].clip(0.02)
    stain = 1 + 0.18 * turbulence(rng, np.stack([across * 0.7, up * 0.25, index * 5.0], -1), 4)
    course = 1 - 0.25 * (v < 0.05)
    shown = color * (stain * course)[:, None]
    shown = np.where(frame[:, None], color * 1.35, shown)
    shown = np.where(glass[:, None], dark * [0.9, 1.0, 1.15], shown)
    blur = np.clip(foot / 0.8 - 0.3, 0, 1)[:, None]  # far windows melt into their wall
    return shown + blur * (0.75 * color - shown)


def detailed_outdoor(rng: np.random.Generator, height: int) -> np.ndarray:
    """Out of doors: a street, a square, a park or open land under a clear, cloudy or overcast sky."""
    kind = rng.choice(["street", "square", "park", "land"])
    seed, eye = int(rng.integers(1 << 30)), np.zeros(3)
    ground = -rng.uniform(1.0, 1.7)
    sun = direction_at(rng.uniform(0, 6.28), np.radians(rng.uniform(8, 65)))
    cover = rng.choice([-0.7, -0.1, 0.15, 0.5, 1.6])
    boxes = _town(rng, kind, ground)
    trees = _trees(rng, kind, ground)
    ridge = rng.uniform(0.0, 0.16) if kind in ("park", "land") else rng.uniform(0.0, 0.04)
    albedo = GROUNDS[rng.choice([0, 0, 2, 3, 7] if kind in ("park", "land") else [4, 5, 5])]
    other = GROUNDS[rng.choice([1, 2, 3, 5])]
    turn = rotation_y(rng.uniform(0, 2 * np.pi))
    turbidity = rng.uniform(2.2, 6)
    hidden = np.clip(0.9 - 0.55 * max(cover, 0), 0.05, 1)  # of the sun's light, through the clouds
    scale = clear_sky(np.array([[0.0, 1.0, 0.0], [0.6, 0.8, 0.0]]), sun, turbidity).mean()

    def look(d: np.ndarray) -> np.ndarray:
        d = d @ turn
        rngs = [np.random.default_rng((seed, k)) for k in range(6)]
        sky = _sky(rngs[0], d, sun, turbidity, cover, hidden, scale)
        azimuth = np.stack([d[:, 0], d[:, 2], d[:, 1] * 0], -1) / np.maximum(np.hypot(d[:, 0], d[:, 2]), 1e-6)[:, None]
        result = sky
        for k, (far, haze) in enumerate(((1.0, 0.65), (0.6, 0.35))):
            line = ridge * far * (0.6 + turbulence(rngs[1], azimuth * (2.0 + 3 * k), 6))
            hill = d[:, 1] < line
            body = (0.5 * GROUNDS[1] + 0.5 * albedo) * (1 + 0.35 * turbulence(rngs[2], d * [30, 60, 30], 4))[:, None].clip(0.2)
            result = np.where(hill[:, None], haze * np.array([0.55, 0.65, 0.8]) * 0.9 + (1 - haze) * body, result)
        below = d[:, 1] < -1e-3
        distance = np.where(below, ground / np.minimum(d[:, 1], -1e-3), np.inf)
        hits = cast(boxes, eye, d)
        on_box = hits.distance < distance
        here = np.flatnonzero(below & ~on_box)
        spot = d[here] * distance[here][:, None]
        foot = distance[here] * np.pi / (height * SUPERSAMPLE)
        stretched = foot / np.maximum(-d[here, 1], 0.02)
        color = _land(rngs[3], kind, spot, stretched, albedo, other)
        shade = 0.35 + hidden * max(sun[1], 0.1) * visible(boxes, spot + [0, 2e-3, 0], sun * 1e4) * 1.1
        shade = shade * _tree_shade(spot, trees, sun, ground)
        fog = np.exp(-distance[here] / 220.0)[:, None]
        result[here] = color * np.asarray(shade)[..., None] * fog + (1 - fog) * 0.6
        house = np.flatnonzero(on_box)
        if len(house):
            position, normal = hits.position[house], hits.normal[house]
            foot = hits.distance[house] * np.pi / (height * SUPERSAMPLE)
            color = _texture(rngs[4], boxes, hits.index[house], position, normal, foot)
            lit = hidden * np.maximum(normal @ sun, 0.0) * visible(boxes, position + 0.02 * normal, sun * 1e4)
            result[house] = color * (0.38 + 0.1 * normal[:, 1] + 1.3 * lit)[:, None]
        reach = np.minimum(distance, hits.distance)
        return _leaf(rngs[5], d, trees, reach, result, sun, hidden)

    return panorama(look, height)


def _sky(rng, d, sun, turbidity, cover, hidden, scale) -> np.ndarray:
    """Clear sky, clouds of a layer and the sun, [N, 3]; about 0.7 at the zenith."""
    up = np.maximum(d[:, 1], 0.0)
    clear = clear_sky(d, sun, turbidity) / scale * 0.6
    layer = d / (up + 0.18)[:, None] * 1.3
    foot = 0.003 / (up + 0.03)
    bend = np.stack([turbulence(rng, layer + 9.0 * k, 2) for k in range(3)], -1)
    shape = turbulence(rng, layer + 0.5 * bend, 7, foot)
    density = np.clip((shape + cover) * 1.8, 0.0, 1.0)
    toward = np.clip(d @ sun, 0, 1)
    edge = 1.25 - 0.75 * density + 0.15 * turbulence(rng, layer * 1.7 + 31.0, 6, foot * 1.7)
    cloud = (0.55 + 0.5 * hidden) * edge * (0.9 + 1.2 * toward**8)
    sky = clear + density[:, None] * (cloud[:, None] * np.array([1.0, 1.0, 1.02]) - clear)
    disc = (toward > np.cos(np.radians(0.6))) * 2000.0 * hidden
    return sky + (disc * (1 - density))[:, None] * np.array([1.0, 0.93, 0.82])


def _town(rng, kind: str, ground: float) -> Boxes:
    """Houses, posts, benches and cars."""
    scene = Builder()
    rows = {"street": 2, "square": 4, "park": 1, "land": 0}[kind]
    width = rng.uniform(6, 11) if kind == "street" else rng.uniform(16, 40)
    for row in range(rows):
        axis, side, at = (0 if kind == "street" else row % 2 * 2), (1 if row % 2 else -1) if kind == "street" else (1 if row < 2 else -1), -90.0
        while at < 90:
            wide, tall, deep = rng.uniform(8, 22), rng.uniform(5, 10) + rng.exponential(5), rng.uniform(8, 14)
            if kind == "park" and rng.random() < 0.5:
                at += wide
                continue
            centre = np.array([0.0, ground + tall / 2, 0.0])
            centre[axis], centre[2 - axis] = side * (width + deep / 2 + rng.uniform(0, 0.8)), at + wide / 2
            size = [deep, tall, wide] if axis == 0 else [wide, tall, deep]
            color = WALLS[rng.integers(5)] * rng.uniform(0.35, 1.0) * tint(rng, 0.12)
            scene.add(centre, size, color, 0, FACADE)
            scene.add(centre + [0, tall / 2 + 0.2, 0], np.add(size, [0.5, -tall + 0.4, 0.5]), color * 0.5)
            at += wide * (1 if rng.random() < 0.8 else 1.3)
    for _ in range(rng.integers(4, 14) if rows else 2):
        a, r, tall = rng.uniform(0, 6.28), rng.uniform(4, 25), rng.uniform(1, 6)
        scene.add([r * np.sin(a), ground + tall / 2, r * np.cos(a)], [0.12, tall, 0.12], 0.06)
    for _ in range(rng.integers(3, 10) if rows > 1 else 1):
        a, r = rng.uniform(0, 6.28), rng.uniform(4.5, 20)
        at, color = np.array([r * np.sin(a), ground, r * np.cos(a)]), rng.choice([0.03, 0.2, 0.7]) * tint(rng, 0.25)
        scene.add(at + [0, 0.6, 0], [1.7, 0.7, 4.2], color)
        scene.add(at + [0, 1.15, 0.2], [1.5, 0.5, 2.2], 0.04)
    return scene.boxes()


def _trees(rng, kind: str, ground: float) -> list[tuple[np.ndarray, float, float, float]]:
    """Foot [3], height, radius of the crown, and a shade of each, the farthest first."""
    count = {"street": 6, "square": 8, "park": 38, "land": 14}[kind]
    found = []
    for _ in range(int(count * rng.uniform(0.4, 1.3))):
        a, r = rng.uniform(0, 6.28), rng.uniform(5, 12) + rng.exponential(18)
        tall = rng.uniform(4, 13)
        foot = np.array([r * np.sin(a), ground, r * np.cos(a)])
        found.append((foot, tall, tall * rng.uniform(0.25, 0.42), rng.uniform(0.5, 1.5)))
    return sorted(found, key=lambda tree: -np.linalg.norm(tree[0]))


def _leaf(rng, d, trees, reach, result, sun, hidden) -> np.ndarray:
    """Trees in front of result [N, 3]: crowns of noise around a trunk, as upright pictures that face the eye."""
    for number, (foot, tall, radius, shade) in enumerate(trees):
        distance = np.hypot(foot[0], foot[2])
        forward = np.array([foot[0], 0, foot[2]]) / distance
        right = np.array([-forward[2], 0, forward[0]])
        ahead = d @ forward
        near = np.flatnonzero((ahead > 0.2) & (np.abs(d @ right) * distance < 1.3 * radius * ahead) & (reach > distance))
        scale = distance / ahead[near]
        x, y = (d[near] @ right) * scale, d[near, 1] * scale - foot[1]
        own = np.random.default_rng((number, int(1e3 * tall)))
        local = np.stack([x, y, x * 0 + number * 7.0], -1)
        fray = turbulence(own, local / radius * 2.5, 6, 0.02 * distance / radius, 0.7)
        ball = np.hypot(x / radius, (y - tall + 1.1 * radius) / (1.15 * radius))
        crown = ball + 0.42 * fray < 0.9
        trunk = (np.abs(x) < 0.025 * tall * (1.3 - y / tall)) & (y > 0) & (y < tall - radius)
        bright = 0.5 + 0.4 * (y - tall + radius) / radius + 0.55 * hidden * (x / radius * np.sign(right @ sun)) + 0.5 * turbulence(own, local / radius * 6, 4, 0.05 * distance / radius)
        leaf = np.array([0.1, 0.15, 0.05]) * shade * bright.clip(0.15, 2.0)[:, None]
        result[near] = np.where(crown[:, None], leaf, np.where(trunk[:, None], [0.07, 0.055, 0.04], result[near]))
    return result


def _tree_shade(spot, trees, sun, ground) -> np.ndarray:
    """How much of the light trees leave on the ground, [N]."""
    left = np.ones(len(spot))
    for foot, tall, radius, _ in trees:
        away = spot + sun * ((tall - radius) / max(sun[1], 0.15)) - foot - [0, tall - radius, 0]
        left *= 1 - 0.55 * np.clip(1.6 - np.hypot(away[:, 0], away[:, 2]) / radius, 0, 1)
    return left


def _land(rng, kind: str, spot, foot, albedo, other) -> np.ndarray:
    """Grass, soil or paving at points of the ground [N, 3]."""
    patch = np.clip(0.5 + 1.2 * turbulence(rng, spot * 0.22, 4, foot * 0.22), 0, 1)[:, None]
    fine = 0.38 * turbulence(rng, spot * 9, 5, foot * 9, 0.7) + 0.2 * turbulence(rng, spot * 1.3, 4, foot * 1.3)
    if kind in ("park", "land"):
        color = albedo + 0.6 * patch * (other - albedo)
        path = np.abs(spot[:, 0] + 2.5 * np.sin(spot[:, 2] * 0.12) - 2.5) < 1.1
        color = np.where((path & (kind == "park"))[:, None], [0.42, 0.37, 0.3], color)
        return (color * (1 + fine)[:, None]).clip(0.02)
    size = rng.uniform(0.3, 0.9)
    seam = np.maximum(lines(spot[:, 0], size, 0.02, foot), lines(spot[:, 2], size, 0.02, foot))
    stone = 0.16 * noise(rng, np.floor(spot / size) * [3.1, 0, 7.7])
    color = albedo * ((1 + 0.5 * fine + stone) * (1 - 0.45 * seam))[:, None]
    if kind == "street":
        road = np.abs(spot[:, 0] - 1.0) < 3.6
        paint = (np.abs(spot[:, 0] - 1.0) < 0.07) & (spot[:, 2] % 6 < 3)
        tar = GROUNDS[4] * (1 + 0.6 * fine)[:, None]
        color = np.where(road[:, None], tar, color)
        color = np.where(paint[:, None], 0.6, color)
    return color.clip(0.02)

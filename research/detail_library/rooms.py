"""Rooms and studios with as much detail as a photo, for anyprobe.detail's library.

Metres; radiance has no scale. Light between the walls (dataset.room has it) is left out: an estimate replaces it.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe_train.dataset.sky import tint
from research.detail_library.box_textures import (
    BOOKS,
    CLOTHS,
    COVERS,
    FABRIC,
    GRID,
    LEAVES,
    PAINTS,
    PLAIN,
    WOOD,
    WOODS,
    floor,
    texture,
    wall,
)
from research.detail_library.boxes import SUPERSAMPLE, Boxes, Builder, cast, lines, panorama, turbulence, visible

USES = {
    "living": ["sofa", "sofa", "low table", "shelf", "cabinet", "chair", "plant"],
    "office": ["desk", "desk", "desk", "chair", "shelf", "cabinet", "plant"],
    "kitchen": ["counter", "counter", "table", "cabinet", "chair", "chair", "plant"],
    "bedroom": ["bed", "cabinet", "cabinet", "chair", "shelf", "plant"],
}
"""Furniture of rooms, as often as it is tried."""
LIGHT_POINTS = 2 * np.modf(np.arange(1, 10)[:, None] * [0.8192, 0.6710, 0.5497])[0] - 1
"""Points [9, 3] of a light of half size 1, spread evenly."""
SIZES = {  # depth, width [m]
    "table": (0.8, 1.5),
    "low table": (0.6, 1.1),
    "desk": (0.75, 1.5),
    "counter": (0.6, 2.4),
    "shelf": (0.35, 1.2),
    "sofa": (0.9, 2.0),
    "cabinet": (0.5, 1.3),
    "chair": (0.5, 0.5),
    "bed": (2.0, 1.5),
    "plant": (0.4, 0.4),
}


def detailed_room(rng: np.random.Generator, height: int) -> np.ndarray:
    """A furnished room, lit by its windows and lamps."""
    half = np.array([rng.uniform(1.7, 3.4), rng.uniform(1.15, 1.5), rng.uniform(1.7, 3.4)])
    eye = np.array([rng.uniform(-0.45, 0.45) * half[0], rng.uniform(-0.25, 0.25), rng.uniform(-0.45, 0.45) * half[2]])
    scene = Builder()
    wood = WOODS[rng.integers(5)] * rng.uniform(0.8, 1.2)
    use = rng.choice(["living", *USES])
    for _ in range(rng.integers(16, 26)):
        _furnish(rng, scene, half, eye, wood, rng.choice(USES[use]))
    if use != "kitchen":  # a rug
        wide, _, deep = rng.uniform(0.7, 1.1, 3) * half
        color = 1.1 * CLOTHS[rng.choice([0, 1, 3, 5])]
        scene.add([0, 0.006 - half[1], 0], [wide, 0.012, deep], color, 0, PLAIN, False)
    lamps = _lamps(rng, scene, half)
    openings = _openings(rng, half)
    paint = PAINTS[rng.integers(len(PAINTS))] * tint(rng, 0.015)
    return _interior(rng, scene.boxes(), half, eye, lamps, openings, paint, wood, height)


def detailed_studio(rng: np.random.Generator, height: int) -> np.ndarray:
    """A photographer's studio: soft boxes and panels on stands, a backdrop, dark walls or white ones."""
    half = np.array([rng.uniform(3, 5), rng.uniform(1.5, 2.2), rng.uniform(3, 5)])
    eye = rng.uniform(-0.2, 0.2, 3) * half * [1, 0.5, 1]
    scene, lamps = Builder(), []
    dark = np.full(3, rng.choice([0.04, 0.12, 0.5, 0.75])) * tint(rng, 0.03)
    for _ in range(rng.integers(3, 7)):
        a, r, size = (rng.uniform(0, 6.28), rng.uniform(1.8, 0.9 * half[[0, 2]].min()), rng.uniform(0.4, 1.3, 2))
        at = np.array([r * np.sin(a), rng.uniform(-0.2, 1.0), -r * np.cos(a)])
        lit = rng.random() < 0.6
        along = abs(np.sin(a)) > 0.7
        panel = [0.1, size[1], size[0]] if along else [size[0], size[1], 0.1]
        scene.add(at, panel, 0.8 if rng.random() < 0.7 else 0.12, rng.uniform(6, 25) if lit else 0.0, GRID)
        low, high = -half[1], at[1] - size[1] / 2
        scene.add([at[0], (low + high) / 2, at[2]], [0.04, high - low, 0.04], 0.03)
        for leg in (-0.3, 0.3):
            scene.add([at[0] + leg / 2, low + 0.03, at[2]], [0.35, 0.03, 0.03], 0.03)
            scene.add([at[0], low + 0.03, at[2] + leg / 2], [0.03, 0.03, 0.35], 0.03)
        if lit:
            lamps.append((at * 0.92, 4.0 * size.prod()))
    for x in np.arange(-half[0], half[0], rng.uniform(0.8, 1.6)):  # rails under the ceiling
        scene.add([x, half[1] - 0.25, 0], [0.06, 0.06, 2 * half[2] - 0.1], 0.05 + 0.5 * rng.random())
    scene.add(
        [0, -0.1, -half[2] + 0.15],
        [rng.uniform(1.5, 2.7), 2 * half[1] - 0.4, 0.05],
        rng.uniform(0.2, 0.85) * tint(rng, 0.06),
    )
    for _ in range(rng.integers(3, 8)):  # cases and apple boxes
        a, size = rng.uniform(0, 6.28), rng.uniform(0.2, 0.7, 3)
        spot = np.array([np.sin(a), 0, np.cos(a)]) * rng.uniform(0.6, 0.9) * half
        scene.add(
            [spot[0], -half[1] + size[1] / 2, spot[2]], size, rng.choice([0.05, 0.3, 0.6]), 0, rng.choice([PLAIN, WOOD])
        )
    if not lamps:
        lamps = [(np.array([0.5, half[1] - 0.3, 0.2]), 3.0)]
    return _interior(rng, scene.boxes(), half, eye, lamps, [], dark, WOODS[rng.integers(5)], height)


def _furnish(
    rng: np.random.Generator, scene: Builder, half: np.ndarray, eye: np.ndarray, wood: np.ndarray, kind: str
) -> None:
    """One piece of furniture against a wall or in the room, out of the eye's way."""
    base, (deep, wide) = -half[1], SIZES[kind]
    wide, turned = wide * rng.uniform(0.7, 1.4), rng.random() < 0.5
    x, z = (deep, wide) if turned else (wide, deep)
    side = rng.choice([-1, 1])
    gap = 0.06 if kind not in ("table", "low table", "chair") else rng.uniform(0.06, 1.2)
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
        scene.add(at + np.array([centre[0], base + centre[1], centre[2]]), size, albedo, 0.0, texture, shadow)

    color = CLOTHS[rng.integers(len(CLOTHS))] * tint(rng, 0.04)
    if rng.random() < 0.08:  # an accent
        color = np.array([[0.35, 0.16, 0.1], [0.14, 0.24, 0.26], [0.45, 0.34, 0.14]])[rng.integers(3)]
    if kind in ("table", "low table", "desk"):
        tall = 0.42 if kind == "low table" else 0.74
        put((0, tall - 0.02, 0), (x, 0.04, z), wood, WOOD)
        for i in (-1, 1):
            for j in (-1, 1):
                put((i * (x / 2 - 0.05), tall / 2 - 0.02, j * (z / 2 - 0.05)), (0.05, tall - 0.04, 0.05), wood)
        for _ in range(rng.integers(1, 5)):
            size = rng.uniform([0.06, 0.02, 0.06], [0.3, 0.2, 0.25])
            spot = rng.uniform(-0.4, 0.4, 2) * [x, z]
            put((spot[0], tall + size[1] / 2, spot[1]), size, COVERS[rng.integers(len(COVERS))])
        if kind == "desk":  # with a screen
            put((0, tall + 0.3, 0), (0.04, 0.34, 0.56) if turned else (0.56, 0.34, 0.04), 0.06)
            put((0, tall + 0.07, 0), (0.06, 0.14, 0.06), 0.2)
    elif kind == "counter":  # cupboards below a worktop and on the wall
        front = np.where(rng.random() < 0.6, 0.72, wood)
        put((0, 0.44, 0), (x, 0.88, z), front, GRID)
        put((0, 0.9, 0), (x + 0.02, 0.04, z + 0.02), rng.choice([0.15, 0.3, 0.6]))
        above = [0.0, 1.75, 0.0]
        above[axis] = side * (deep / 2 - 0.17)
        put(above, (0.34, 0.7, z) if turned else (x, 0.7, 0.34), front, GRID)
        for _ in range(rng.integers(2, 5)):
            size = rng.uniform([0.08, 0.1, 0.08], [0.25, 0.3, 0.25])
            spot = rng.uniform(-0.4, 0.4, 2) * [x, z]
            put((spot[0], 0.92 + size[1] / 2, spot[1]), size, COVERS[rng.integers(len(COVERS))])
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
        put((0, tall + 0.15, 0), (0.18, 0.3, 0.18), COVERS[rng.integers(len(COVERS))])
    elif kind == "chair":
        put((0, 0.45, 0), (0.45, 0.05, 0.45), color, FABRIC)
        put((0, 0.72, 0.2 * side), (0.42, 0.45, 0.04), wood, WOOD)
        for i in (-0.19, 0.19):
            for j in (-0.19, 0.19):
                put((i, 0.22, j), (0.04, 0.44, 0.04), wood)
    elif kind == "bed":
        put((0, 0.25, 0), (x, 0.4, z), color, FABRIC)
        put((0, 0.5, 0), (0.9 * x, 0.12, 0.9 * z), rng.uniform(0.55, 0.8) * tint(rng, 0.02), FABRIC)
    else:
        put((0, 0.18, 0), (0.35, 0.36, 0.35), rng.uniform(0.2, 0.7) * tint(rng, 0.04))
        for _ in range(24):
            size = rng.uniform(0.05, 0.16)
            put(
                rng.normal([0, 0.8, 0], [0.16, 0.22, 0.16]),
                (size, size * 0.8, size),
                np.array([0.06, 0.14, 0.04]) * rng.uniform(0.4, 1.8),
                LEAVES,
                False,
            )


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
        at = np.array(
            [rng.uniform(-0.4, 0.4) * half[0], half[1] - rng.uniform(0.5, 0.9), rng.uniform(0.3, 0.6) * half[2]]
        )
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
    """Windows, doors and pictures: kind, axis and side of the wall, centre [2] along it and up, half size [2]."""
    found = []
    for kind in ["window"] * rng.integers(1, 6) + ["door"] * rng.integers(1, 3) + ["picture"] * rng.integers(3, 10):
        axis, side = rng.choice([0, 2]), rng.choice([-1, 1])
        long = half[2 - axis]
        size = {
            "window": rng.uniform([0.4, 0.5], [1.3, 0.9]),
            "door": [0.45, 1.0],
            "picture": rng.uniform(0.12, 0.5, 2),
        }[kind]
        size = np.minimum(size, [0.8 * long, 0.9 * half[1]])
        up = {"window": rng.uniform(-0.1, 0.2), "door": size[1] - half[1], "picture": rng.uniform(0.0, 0.4)}[kind]
        centre = np.array([rng.uniform(-1, 1) * (long - size[0]) * 0.95, min(up, half[1] - size[1] - 0.05)])
        clash = any(a == axis and s == side and np.all(np.abs(centre - c) < size + e + 0.12) for _, a, s, c, e in found)
        if not clash:
            found.append((kind, axis, side, centre, size))
    return found


def _interior(rng, boxes: Boxes, half, eye, lamps, openings, paint, wood, height: int) -> np.ndarray:
    """The inside of a room with all that is in it."""
    seed, turn = int(rng.integers(1 << 30)), rotation_y(rng.uniform(0, 2 * np.pi))
    day = rng.random() < 0.95
    outside = np.array([0.55, 0.62, 0.7]) * (rng.uniform(3, 7) if day else 0.8)
    floor_kind, wall_kind = rng.choice([0, 0, 1, 2]), rng.choice([0, 0, 0, 0, 1, 2, 3])
    ceiling = rng.uniform(0.75, 0.85) if paint.mean() > 0.15 else paint.mean()
    lights = [(at, power, np.array([0.25, 0.05, 0.25])) for at, power in lamps]
    for kind, axis, side, centre, size in openings:
        if kind == "window":
            wide = np.array([0.1, size[1], size[0]] if axis == 0 else [size[0], size[1], 0.1])
            lights.append((_on_wall(half, axis, side, centre, 0.15), 4.5 * size.prod() * (1.0 if day else 0.1), wide))
    lights = lights or [(np.array([0.0, half[1] - 0.1, 0.0]), 1.0, half * [0.5, 0.05, 0.5])]

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
                    albedo[here] = floor(*args, floor_kind, wood) if side < 0 else ceiling
                else:
                    albedo[here] = wall(*args, surface, wall_kind, paint, half)
                    on = [one for one in openings if one[1] == surface and one[2] == side]
                    _lay(
                        np.random.default_rng((seed, 2)),
                        on,
                        position[here],
                        foot[here],
                        d[here],
                        here,
                        albedo,
                        glow,
                        outside,
                    )
        on_box = np.flatnonzero(~is_wall)
        index = hits.index[on_box]
        albedo[on_box] = texture(
            np.random.default_rng((seed, 3)), boxes, index, position[on_box], normal[on_box], foot[on_box]
        )
        glow[on_box] = boxes.emission[index]
        corners = np.arange(len(d)).reshape(-1, 2 * height * SUPERSAMPLE)[::SUPERSAMPLE, ::SUPERSAMPLE]
        light = _light(boxes, position[corners.ravel()], normal[corners.ravel()], lights).reshape(corners.shape)
        light = light.repeat(SUPERSAMPLE, axis=0).repeat(SUPERSAMPLE, axis=1).ravel()
        corner = sum(
            np.exp(-(half[k] - np.abs(position[:, k])) / 0.18) * (np.abs(normal[:, k]) < 0.5) for k in range(3)
        )
        ambient = 0.3 * (1.0 - 0.45 * np.minimum(corner, 1.5) / 1.5)
        return glow + albedo * (light + ambient)[:, None]

    return panorama(look, height)


def _on_wall(half: np.ndarray, axis: int, side: int, centre: np.ndarray, inside: float) -> np.ndarray:
    """A point [3] of a wall, so many metres before it."""
    at = np.empty(3)
    at[axis], at[2 - axis], at[1] = side * (half[axis] - inside), *centre
    return at


def _light(boxes: Boxes, position: np.ndarray, normal: np.ndarray, lights: list) -> np.ndarray:
    """Direct light of lights, each spread over LIGHT_POINTS, [N]; a ceiling is lit softly and without shadows."""
    total = np.zeros(len(position))
    start = position + 2e-3 * normal
    ceiling = normal[:, 1] < -0.5
    for at, power, spread in lights:
        for offset in LIGHT_POINTS:
            target = at + offset * spread
            way = target - position
            distance = np.linalg.norm(way, axis=1) + 0.4
            cosine = np.maximum((way * normal).sum(axis=1) / distance, 0.0)
            lit = np.zeros(len(position))
            lit[~ceiling] = visible(boxes, start[~ceiling], target)
            share = np.where(ceiling, 0.4 / (1.0 + distance**2), lit * cosine / distance**2)
            total += power / len(LIGHT_POINTS) * share
    return 2.0 * total / (2.0 + total)


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
            bars = np.minimum(
                lines(local[:, 0] * size[0] + 0.02, pane, 0.04, foot[inside])
                + lines(local[:, 1] * size[1] + 0.02, 1.2 * pane, 0.04, foot[inside]),
                1.0,
            )
            bars = np.where(frame, 1.0, bars)[:, None]
            far = d[inside] * 6
            leaves = np.array([0.3, 0.36, 0.22]) * (1 + 0.25 * turbulence(rng, far * 3, 5)[:, None])
            tree = d[inside][:, 1] - 0.1 * turbulence(rng, far, 4) - rng.uniform(-0.1, 0.15)
            tree = np.clip(0.5 - tree / 0.04, 0, 1)[:, None]
            view = outside * (1 + tree * (leaves - 1))
            albedo[at] = 0.6 * bars
            glow[at] = view * (1 - bars)
        elif kind == "door":
            color = rng.choice([0.35, 0.65, 0.75, 0.78]) * np.array([1.0, 0.97, 0.92])
            panel = (np.abs(np.abs(local[:, 1]) - 0.5) < 0.36) & (np.abs(local[:, 0]) < 0.7)
            rim = (np.abs(np.abs(local[:, 1]) - 0.5) < 0.38) & (np.abs(local[:, 0]) < 0.74) & ~panel
            shade = np.where(frame, 1.15, np.where(rim, 0.6, 1.0))
            shade[(np.abs(local[:, 0] - 0.85) < 0.05) & (np.abs(local[:, 1] + 0.02) < 0.03)] = 0.15
            albedo[at] = (color * shade[:, None]).clip(0.02, 0.9)
        else:
            paint = np.stack([turbulence(rng, local * rng.uniform(1, 4), 5) for _ in range(3)], -1)
            albedo[at] = np.where(
                frame[:, None],
                rng.choice([0.05, 0.3, 0.8]),
                (0.45 + 0.2 * paint.mean(axis=1, keepdims=True) + 0.06 * paint).clip(0.02, 0.9),
            )

"""Gardens, parks, open land and streets with as much detail as a photo, for anyprobe.detail's library.

Metres, the eye at the origin; radiance has no scale, about 0.7 at the zenith.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe_train.dataset.sky import GROUNDS, clear_sky, direction_at, tint
from research.detail_library.box_textures import FACADE, FACADES, land, texture
from research.detail_library.boxes import SUPERSAMPLE, Boxes, Builder, cast, panorama, turbulence, visible

KINDS = ("park", "land", "street")
HAZE = np.array([0.55, 0.63, 0.74])


def detailed_outdoor(rng: np.random.Generator, height: int, kind: str | None = None) -> np.ndarray:
    """Out of doors, one of KINDS (None: any): a park or garden, open land, or a street or square, under some sky."""
    kind = kind or rng.choice(KINDS)
    seed, eye = int(rng.integers(1 << 30)), np.zeros(3)
    ground = -rng.uniform(1.2, 1.7)
    sun = direction_at(rng.uniform(0, 6.28), np.radians(rng.uniform(15, 60)))
    cover = rng.choice([-1.2, -0.45, -0.3, -0.1, 2.5])
    hidden = np.clip(0.95 - 0.4 * max(cover, 0), 0.04, 1)  # of the sun's light, through the clouds
    square = rng.random() < 0.5  # of a street: whether it is one
    boxes = _buildings(rng, kind, square, ground)
    trees = _trees(rng, kind, ground)
    ridge = {"park": 0.03, "land": rng.uniform(0.03, 0.13), "street": 0.0}[kind]
    wood = {"park": (45.0, 7.0, 0.8), "land": (110.0, 9.0, 0.35), "street": (90.0, 6.0, 0.3)}[kind]
    albedo = GROUNDS[5 if kind == "street" else 0] * rng.uniform(0.75, 1.1) * tint(rng, 0.05)
    turn = rotation_y(rng.uniform(0, 2 * np.pi))
    turbidity = rng.uniform(2.2, 5)
    scale = clear_sky(np.array([[0.0, 1.0, 0.0], [0.6, 0.8, 0.0]]), sun, turbidity).mean()

    def look(d: np.ndarray) -> np.ndarray:
        d = d @ turn
        rngs = [np.random.default_rng((seed, k)) for k in range(7)]
        result = _sky(rngs[0], d, sun, turbidity, cover, hidden, scale)
        azimuth = np.stack([d[:, 0], d[:, 2], d[:, 1] * 0], -1) / np.maximum(np.hypot(d[:, 0], d[:, 2]), 1e-6)[:, None]
        for k, (far, haze) in enumerate(((1.0, 0.75), (0.6, 0.5))):
            line = ridge * far * (0.7 + 0.8 * turbulence(rngs[1], azimuth * (1.5 + 2 * k), 6, 0.0, 0.4))
            shade = 1 + 0.12 * turbulence(rngs[2], d * [20, 60, 20], 4)
            body = (0.7 * GROUNDS[1] + 0.3 * GROUNDS[0]) * shade[:, None]
            result = np.where((d[:, 1] < line)[:, None], haze * HAZE + (1 - haze) * body, result)
        below = d[:, 1] < -1e-3
        distance = np.where(below, ground / np.minimum(d[:, 1], -1e-3), np.inf)
        hits = cast(boxes, eye, d)
        on_box = hits.distance < distance
        here = np.flatnonzero(below & ~on_box)
        spot = d[here] * distance[here][:, None]
        foot = distance[here] * np.pi / (height * SUPERSAMPLE)
        stretched = foot / np.maximum(-d[here, 1], 0.02)
        color = land(rngs[3], kind, spot, stretched, albedo, kind == "street" and not square)
        shade = 0.75 - 0.3 * hidden + hidden * max(sun[1], 0.2) * visible(boxes, spot + [0, 2e-3, 0], sun * 1e4) * 1.1
        shade = shade * _tree_shade(spot, trees, sun, hidden)
        fog = np.exp(-distance[here] / 250.0)[:, None]
        result[here] = color * np.asarray(shade)[..., None] * fog + (1 - fog) * 0.6 * HAZE
        house = np.flatnonzero(on_box)
        if len(house):
            position, normal = hits.position[house], hits.normal[house]
            foot = hits.distance[house] * np.pi / (height * SUPERSAMPLE)
            color = texture(rngs[4], boxes, hits.index[house], position, normal, foot)
            lit = hidden * np.maximum(normal @ sun, 0.0) * visible(boxes, position + 0.02 * normal, sun * 1e4)
            result[house] = color * (0.75 - 0.25 * hidden + 0.1 * normal[:, 1] + 0.9 * lit)[:, None]
        reach = np.minimum(distance, hits.distance)
        result = _wood(rngs[6], d, azimuth, wood, reach, result)
        return _leaf(d, trees, reach, result, sun, hidden)

    return panorama(look, height)


def _sky(rng, d, sun, turbidity, cover, hidden, scale) -> np.ndarray:
    """Clear sky, soft clouds of a layer and the sun, [N, 3]; about 0.7 at the zenith."""
    up = np.maximum(d[:, 1], 0.0)
    clear = clear_sky(d, sun, turbidity) / scale * 0.6
    layer = d * [1, 0, 1] / (up + 0.25)[:, None] * 1.5
    shape = turbulence(rng, layer, 6, 0.004 / (up + 0.05), 0.5) + 0.5 * turbulence(rng, layer * 0.4, 2)
    density, core = (_ramp((shape + cover) / 0.9 - start) for start in (0.0, 0.4))
    grey = 1.0 - 0.22 * core + 0.06 * turbulence(rng, layer * 0.8, 3)
    toward = np.clip(d @ sun, 0, 1)
    cloud = (0.75 + 0.4 * hidden) * grey * (1.0 + 0.5 * hidden * toward**8)
    sky = clear + 0.95 * density[:, None] * (cloud[:, None] * np.array([0.98, 1.0, 1.03]) - clear)
    disc = (toward > np.cos(np.radians(0.6))) * 2000.0 * hidden
    return sky + (disc * (1 - density))[:, None] * np.array([1.0, 0.93, 0.82])


def _ramp(x: np.ndarray) -> np.ndarray:
    """0 below 0, 1 above 1, smooth between."""
    x = np.clip(x, 0.0, 1.0)
    return x * x * (3 - 2 * x)


def _buildings(rng, kind: str, square: bool, ground: float) -> Boxes:
    """Houses: on both sides of a street, around a square, or one behind a garden; lamp posts or a fence."""
    scene = Builder()
    sides = {"park": int(rng.random() < 0.4), "land": 0, "street": 4 if square else 2}[kind]
    width = {"park": 22, "land": 0, "street": rng.uniform(18, 30) if square else rng.uniform(8, 12)}[kind]
    for row in range(sides):
        axis, side = (row // 2 * 2, row % 2 * 2 - 1)
        at = rng.uniform(-12, 2) if kind == "park" else -90.0
        while at < (2 if kind == "park" else 90):
            wide, tall, deep = rng.uniform(9, 20), rng.uniform(7, 14), rng.uniform(8, 14)
            tall = tall * 0.6 if kind == "park" else tall
            centre = np.array([0.0, ground + tall / 2, 0.0])
            centre[axis], centre[2 - axis] = side * (width + deep / 2 + rng.uniform(0, 0.4)), at + wide / 2
            size = [deep, tall, wide] if axis == 0 else [wide, tall, deep]
            color = FACADES[rng.integers(len(FACADES))] * rng.uniform(0.75, 1.05) * tint(rng, 0.03)
            scene.add(centre, size, color, 0, FACADE)
            scene.add(centre + [0, tall / 2 + 0.2, 0], np.add(size, [0.6, -tall + 0.4, 0.6]), [0.22, 0.17, 0.15])
            at += wide * (1 if rng.random() < 0.8 else 1.3)
    if kind != "street":  # a fence
        z, left = rng.choice([-1, 1]) * rng.uniform(9, 16), rng.uniform(-40, -5)
        for x in np.arange(left, left + 30, 2.5):
            scene.add([x, ground + 0.55, z], [0.12, 1.1, 0.1], [0.2, 0.16, 0.12])
        for up in (0.4, 0.8):
            scene.add([left + 14, ground + up, z], [28, 0.1, 0.05], [0.24, 0.2, 0.16])
    for _ in range(rng.integers(4, 9) if kind == "street" else 0):
        x, z, tall = rng.choice([-1, 1]) * (6.5 if sides == 2 else rng.uniform(5, 15)), rng.uniform(-25, 25), 4.5
        scene.add([x, ground + tall / 2, z], [0.1, tall, 0.1], 0.1)
    return scene.boxes()


def _trees(rng, kind: str, ground: float) -> list[tuple[np.ndarray, float, float, float]]:
    """Trees, bushes and hedges: foot [3], height, radius of the crown, and a shade of each, the farthest first."""
    found = []

    def plant(x, z, tall, share):
        found.append((np.array([x, ground, z]), tall, tall * share, rng.uniform(0.8, 1.25)))

    trees, bushes, hedges = {"park": (22, 14, 3), "land": (6, 7, 0), "street": (8, 0, 0)}[kind]
    for _ in range(int(trees * rng.uniform(0.6, 1.3))):
        a, r = rng.uniform(0, 6.28), rng.uniform(9, 15) + rng.exponential(40 if kind == "land" else 12)
        x, z = (rng.choice([-6.3, 6.3]), rng.uniform(-40, 40)) if kind == "street" else (r * np.sin(a), r * np.cos(a))
        plant(x, z, rng.uniform(5, 11), rng.uniform(0.28, 0.4))
    for _ in range(int(bushes * rng.uniform(0.6, 1.3))):
        a, r = rng.uniform(0, 6.28), rng.uniform(5, 25)
        plant(r * np.sin(a), r * np.cos(a), rng.uniform(0.7, 2.2), rng.uniform(0.5, 0.65))
    for _ in range(hedges):
        a, r, tall, half = rng.uniform(0, 6.28), rng.uniform(8, 15), rng.uniform(1.1, 2.0), rng.uniform(3, 9)
        for along in np.arange(-half, half, 0.5 * tall):
            x, z = r * np.sin(a) + along * np.cos(a), r * np.cos(a) - along * np.sin(a)
            plant(x, z, tall * rng.uniform(0.92, 1.08), 0.6)
    return sorted(found, key=lambda tree: -np.linalg.norm(tree[0]))


def _wood(rng, d, azimuth, wood, reach, result) -> np.ndarray:
    """A line of trees before result [N, 3]: at a distance, so high [metres], more or less closed."""
    distance, tall, closed = wood
    crowns = 0.75 + 0.25 * turbulence(rng, azimuth * 9, 5, 0.0, 0.65)
    line = tall / distance * crowns * np.clip(closed + 1.6 * turbulence(rng, azimuth * 1.5, 3), 0.0, 1.0)
    elevation = d[:, 1] / np.maximum(np.hypot(d[:, 0], d[:, 2]), 1e-6)
    shown = np.flatnonzero((elevation < line) & (reach > distance) & (line > 0.01))
    spot = azimuth[shown] * distance + elevation[shown, None] * distance * [0, 0, 1]
    bright = 0.6 + 0.5 * np.clip(elevation[shown] / line[shown], 0, 1) + 0.3 * turbulence(rng, spot * 0.4, 4, 0.1, 0.7)
    haze = 1 - np.exp(-distance / 400)
    result[shown] = haze * HAZE + (1 - haze) * np.array([0.09, 0.13, 0.05]) * bright[:, None].clip(0.2)
    return result


def _leaf(d, trees, reach, result, sun, hidden) -> np.ndarray:
    """Trees in front of result [N, 3]: crowns of noise around a trunk, as upright pictures that face the eye."""
    for number, (foot, tall, radius, shade) in enumerate(trees):
        distance = np.hypot(foot[0], foot[2])
        forward = np.array([foot[0], 0, foot[2]]) / distance
        right = np.array([-forward[2], 0, forward[0]])
        ahead = d @ forward
        near = np.flatnonzero(
            (ahead > 0.2) & (np.abs(d @ right) * distance < 1.3 * radius * ahead) & (reach > distance)
        )
        scale = distance / ahead[near]
        x, y = (d[near] @ right) * scale, d[near, 1] * scale - foot[1]
        own = np.random.default_rng((number, int(1e3 * tall)))
        local = np.stack([x, y, x * 0 + number * 7.0], -1) / radius
        pixel = 0.004 * distance / radius
        fray = turbulence(own, local * 2.5, 6, 2.5 * pixel, 0.65)
        ball = np.hypot(x / radius, (y - tall + 1.1 * radius) / (1.15 * radius))
        crown = (ball + 0.35 * fray < 0.9) & (y > 0)
        trunk = (np.abs(x) < 0.02 * tall * (1.3 - y / tall)) & (y > 0) & (y < tall - radius)
        bright = (
            0.75
            + 0.3 * (y - tall + radius) / radius
            + 0.35 * hidden * (x / radius * np.sign(right @ sun))
            + 0.3 * turbulence(own, local * 4, 6, 4 * pixel, 0.75)
        )
        leaf = np.array([0.1, 0.14, 0.05]) * shade * (1.25 - 0.25 * hidden) * bright.clip(0.2, 1.8)[:, None]
        result[near] = np.where(crown[:, None], leaf, np.where(trunk[:, None], [0.09, 0.07, 0.055], result[near]))
    return result


def _tree_shade(spot, trees, sun, hidden) -> np.ndarray:
    """How much of the light trees leave on the ground, [N]."""
    left = np.ones(len(spot))
    for foot, tall, radius, _ in trees:
        middle = max(tall - radius, 0.3 * tall)
        away = spot + sun * (middle / max(sun[1], 0.2)) - foot - [0, middle, 0]
        shadow = np.clip(1.5 - np.hypot(away[:, 0], away[:, 2]) / radius, 0, 1)
        left = np.minimum(left, 1 - (0.15 + 0.4 * hidden) * shadow * shadow * (3 - 2 * shadow))
    return left

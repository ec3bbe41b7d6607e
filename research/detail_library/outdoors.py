"""Streets, squares, parks and open land with as much detail as a photo, for anyprobe.detail's library.

Metres, the eye at the origin; radiance has no scale, about 0.7 at the zenith.
"""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe.learning.dataset.sky import GROUNDS, clear_sky, direction_at, tint
from research.detail_library.box_textures import FACADE, WALLS, land, texture
from research.detail_library.boxes import SUPERSAMPLE, Boxes, Builder, cast, panorama, turbulence, visible


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
            body = (0.5 * GROUNDS[1] + 0.5 * albedo) * (1 + 0.35 * turbulence(rngs[2], d * [30, 60, 30], 4))[
                :, None
            ].clip(0.2)
            result = np.where(hill[:, None], haze * np.array([0.55, 0.65, 0.8]) * 0.9 + (1 - haze) * body, result)
        below = d[:, 1] < -1e-3
        distance = np.where(below, ground / np.minimum(d[:, 1], -1e-3), np.inf)
        hits = cast(boxes, eye, d)
        on_box = hits.distance < distance
        here = np.flatnonzero(below & ~on_box)
        spot = d[here] * distance[here][:, None]
        foot = distance[here] * np.pi / (height * SUPERSAMPLE)
        stretched = foot / np.maximum(-d[here, 1], 0.02)
        color = land(rngs[3], kind, spot, stretched, albedo, other)
        shade = 0.35 + hidden * max(sun[1], 0.1) * visible(boxes, spot + [0, 2e-3, 0], sun * 1e4) * 1.1
        shade = shade * _tree_shade(spot, trees, sun, ground)
        fog = np.exp(-distance[here] / 220.0)[:, None]
        result[here] = color * np.asarray(shade)[..., None] * fog + (1 - fog) * 0.6
        house = np.flatnonzero(on_box)
        if len(house):
            position, normal = hits.position[house], hits.normal[house]
            foot = hits.distance[house] * np.pi / (height * SUPERSAMPLE)
            color = texture(rngs[4], boxes, hits.index[house], position, normal, foot)
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
        axis, side, at = (
            (0 if kind == "street" else row % 2 * 2),
            (1 if row % 2 else -1) if kind == "street" else (1 if row < 2 else -1),
            -90.0,
        )
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
        at, color = (np.array([r * np.sin(a), ground, r * np.cos(a)]), rng.choice([0.03, 0.2, 0.7]) * tint(rng, 0.25))
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
        near = np.flatnonzero(
            (ahead > 0.2) & (np.abs(d @ right) * distance < 1.3 * radius * ahead) & (reach > distance)
        )
        scale = distance / ahead[near]
        x, y = (d[near] @ right) * scale, d[near, 1] * scale - foot[1]
        own = np.random.default_rng((number, int(1e3 * tall)))
        local = np.stack([x, y, x * 0 + number * 7.0], -1)
        fray = turbulence(own, local / radius * 2.5, 6, 0.02 * distance / radius, 0.7)
        ball = np.hypot(x / radius, (y - tall + 1.1 * radius) / (1.15 * radius))
        crown = ball + 0.42 * fray < 0.9
        trunk = (np.abs(x) < 0.025 * tall * (1.3 - y / tall)) & (y > 0) & (y < tall - radius)
        bright = (
            0.5
            + 0.4 * (y - tall + radius) / radius
            + 0.55 * hidden * (x / radius * np.sign(right @ sun))
            + 0.5 * turbulence(own, local / radius * 6, 4, 0.05 * distance / radius)
        )
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

"""Albedo of what scenes of boxes are made of: planks, tiles, bricks, books, cloth, facades, grass and paving.

Every function draws the same numbers from its generator whatever it is asked for, so that a panorama may be made in
bands. A footprint is the width of a pixel on the surface [metres]: what is finer fades out.
"""

from __future__ import annotations

import numpy as np

from anyprobe_train.dataset.sky import tint
from research.detail_library.boxes import Boxes, lines, noise, turbulence

PLAIN, WOOD, BOOKS, FABRIC, FACADE, LEAVES, GRID = range(7)
"""Textures of boxes."""
WOODS = np.array([[0.42, 0.29, 0.18], [0.27, 0.18, 0.12], [0.58, 0.46, 0.33], [0.36, 0.29, 0.23], [0.5, 0.45, 0.39]])
PAINTS = np.array([[0.8, 0.79, 0.76], [0.76, 0.72, 0.65], [0.66, 0.66, 0.65], [0.66, 0.61, 0.54], [0.6, 0.63, 0.64]])
"""Of walls indoors."""
CLOTHS = np.array(
    [[0.55, 0.52, 0.47], [0.36, 0.35, 0.34], [0.2, 0.2, 0.21], [0.42, 0.34, 0.26], [0.2, 0.23, 0.28], [0.7, 0.68, 0.64]]
)
COVERS = np.array(
    [
        [0.62, 0.58, 0.5],
        [0.24, 0.17, 0.12],
        [0.13, 0.15, 0.2],
        [0.4, 0.39, 0.37],
        [0.72, 0.71, 0.68],
        [0.3, 0.13, 0.1],
        [0.2, 0.21, 0.15],
        [0.08, 0.08, 0.09],
    ]
)
"""Of books."""
FACADES = np.array([[0.7, 0.67, 0.6], [0.62, 0.56, 0.46], [0.55, 0.54, 0.52], [0.5, 0.36, 0.28], [0.74, 0.73, 0.7]])


def floor(rng, position, foot, kind: int, wood) -> np.ndarray:
    """Planks, tiles or carpet."""
    x, z = position[:, 0], position[:, 2]
    if kind == 0:
        row = np.floor(x / 0.14)
        plank = noise(rng, np.stack([row * 7.3, np.floor((z + row * 0.77) / 1.1), row * 0], -1))
        grain = 0.07 * turbulence(rng, position * [40, 1, 3], 3, foot * 20)
        seam = np.maximum(lines(x, 0.14, 0.004, foot), lines(z + row * 0.77, 1.1, 0.004, foot))
        return wood * ((1 + 0.12 * plank + grain) * (1 - 0.4 * seam))[:, None]
    if kind == 1:
        seam = np.maximum(lines(x, 0.45, 0.006, foot), lines(z, 0.45, 0.006, foot))[:, None]
        tile = (0.5 + 0.02 * turbulence(rng, position * 5, 4, foot * 5))[:, None] * tint(rng, 0.02)
        return tile + seam * (0.6 - tile)
    pile = 0.06 * turbulence(rng, position * 50, 3, foot * 50, 0.8) + 0.02 * turbulence(rng, position * 1.5, 2)
    return CLOTHS[rng.integers(2)] * (0.85 + pile)[:, None] * tint(rng, 0.03)


def wall(rng, position, foot, surface: int, kind: int, paint, half) -> np.ndarray:
    """Plaster, bricks, panels or paper, and a skirting board."""
    u, y = position[:, 2 - surface], position[:, 1]
    shade = 1.0 + 0.02 * turbulence(rng, position * 2, 5, foot * 2)
    if kind == 1:
        row = np.floor(y / 0.075)
        u2 = u + 0.11 * (row % 2)
        joint = np.maximum(lines(y, 0.075, 0.01, foot), lines(u2, 0.22, 0.01, foot))
        brick = 0.12 * noise(rng, np.stack([row * 3.1, np.floor(u2 / 0.22) * 5.7, row * 0], -1))
        shade = (shade + brick) * (1 - 0.2 * joint)
    elif kind == 2:
        seam = lines(u, rng.uniform(0.5, 1.2), 0.012, foot)
        low = y < -half[1] + 1.0
        shade = np.where(low, 0.88, 1.0) * shade * (1 - 0.3 * seam * low)
    elif kind == 3:
        shade = shade * (1 - 0.05 * lines(u, 0.12, 0.06, foot))
    color = paint * shade[:, None]
    board = y < -half[1] + 0.09
    color[board] = 0.7
    return color.clip(0.01, 0.92)


def texture(rng, boxes: Boxes, index, position, normal, foot) -> np.ndarray:
    """Albedo [N, 3] of boxes number index [N]."""
    color = boxes.albedo[index].copy()
    kind, low, high = boxes.texture[index], boxes.low[index], boxes.high[index]
    across = np.where(np.abs(normal[:, 0]) > 0.5, position[:, 2], position[:, 0])
    side = np.abs(normal[:, 1]) < 0.5
    wood = kind == WOOD
    color[wood] *= (1 + 0.1 * turbulence(rng, position[wood] * [6, 40, 6], 3, foot[wood] * 30))[:, None]
    fabric = kind == FABRIC
    fold = 0.08 * turbulence(rng, position[fabric] * 4, 5, foot[fabric] * 4)
    seam = lines(across[fabric], 0.6, 0.015, foot[fabric])
    color[fabric] *= ((1 + fold) * (1 - 0.3 * seam))[:, None]
    leaf = kind == LEAVES
    color[leaf] *= (1 + 0.7 * turbulence(rng, position[leaf] * 14, 3, foot[leaf] * 14))[:, None].clip(0.15)
    books = np.flatnonzero((kind == BOOKS) & side)
    board = lines((high - position)[books, 1], 0.34, 0.025, foot[books])
    level = np.floor((high - position)[books, 1] / 0.34)
    thick = 0.036
    spine = np.stack([np.floor(across[books] / thick) * 3.7, level * 11.3, level * 0], -1)
    title = (noise(rng, np.round(spine)) * 500).astype(int) % len(COVERS)
    tall = ((high - position)[books, 1] % 0.34) / 0.34 > 0.18 + 0.12 * noise(rng, spine + 77.0)
    gap = lines(across[books], thick, 0.005, foot[books])
    cover = np.where(tall[:, None], COVERS[title] * (1 - 0.5 * gap)[:, None], 0.05)
    color[books] = cover + board[:, None] * (color[books] - cover)
    grid = np.flatnonzero((kind == GRID) & side)
    doors = np.maximum(
        lines(across[grid], 0.45, 0.012, foot[grid]), lines((high - position)[grid, 1], 0.4, 0.012, foot[grid])
    )
    color[grid] *= (1 - 0.5 * doors)[:, None]
    facade = np.flatnonzero((kind == FACADE) & side)
    color[facade] = _facade(
        rng, len(boxes.low), index[facade], across[facade], (position - low)[facade, 1], foot[facade], color[facade]
    )
    return color.clip(0.005, 0.95)


def _facade(rng, count, index, across, up, foot, color) -> np.ndarray:
    """Storeys of windows, sills and stains of houses number index [N]."""
    houses = rng.uniform(size=(count, 4))[index]
    wide, tall = 1.6 + 2.2 * houses[:, 0], 2.8 + 0.8 * houses[:, 1]
    u, v = (across % wide) / wide, (up % tall) / tall
    glass = (np.abs(u - 0.5) < 0.16 + 0.2 * houses[:, 2]) & (np.abs(v - 0.55) < 0.26) & (up > 0.4)
    frame = (np.abs(u - 0.5) < 0.19 + 0.2 * houses[:, 2]) & (np.abs(v - 0.55) < 0.3) & ~glass & (up > 0.4)
    pane = np.stack([np.floor(across / wide) * 5.1, np.floor(up / tall) * 9.7, index * 3.3], -1)
    dark = (0.16 + 0.08 * noise(rng, pane))[:, None].clip(0.05)
    stain = 1 + 0.06 * turbulence(rng, np.stack([across * 0.7, up * 0.25, index * 5.0], -1), 4)
    course = 1 - 0.25 * (v < 0.05)
    shown = color * (stain * course)[:, None]
    shown = np.where(frame[:, None], color * 1.15, shown)
    shown = np.where(glass[:, None], dark * [0.9, 1.0, 1.15], shown)
    blur = np.clip(foot / 0.8 - 0.3, 0, 1)[:, None]  # far windows melt into their wall
    return shown + blur * (0.75 * color - shown)


def land(rng, kind: str, spot, foot, albedo, has_road: bool) -> np.ndarray:
    """Lawn, meadow or paving, with a road or not, at points of the ground [N, 3]."""
    fine = turbulence(rng, spot * 14, 4, foot * 14, 0.85)
    broad = turbulence(rng, spot * 0.15, 3, foot * 0.15)
    if kind in ("park", "land"):
        dry = np.clip((0.12 if kind == "park" else 0.3) * (1 + broad), 0, 1)[:, None]
        color = (albedo + dry * ([0.27, 0.25, 0.14] - albedo)) * (1 + 0.1 * fine)[:, None]
        away = np.abs(spot[:, 0] + 2.5 * np.sin(spot[:, 2] * 0.1) - 3.5)
        path = np.clip((1.2 - away + 0.1 * fine) / 0.2, 0, 1)[:, None] * (kind == "park")
        return color + path * ([0.4, 0.36, 0.3] * (1 + 0.06 * fine)[:, None] - color)
    size = rng.uniform(0.4, 0.9)
    seam = np.maximum(lines(spot[:, 0], size, 0.015, foot), lines(spot[:, 2], size, 0.015, foot))
    stone = 0.06 * noise(rng, np.floor(spot / size) * [3.1, 0, 7.7]) * np.clip(1.5 - foot / size, 0, 1)
    color = albedo * ((1 + 0.05 * fine + 0.04 * broad + stone) * (1 - 0.2 * seam))[:, None]
    if not has_road:
        return color
    away = np.abs(spot[:, 0] - 1.0)
    tar = [0.17, 0.17, 0.175] * (1 + 0.06 * fine + 0.05 * broad)[:, None]
    paint = 0.7 * np.clip((0.07 - away) / foot + 0.5, 0, 1)[:, None] * (spot[:, 2:] % 6 < 3)
    road = np.clip((3.6 - away) / foot + 0.5, 0, 1)[:, None]
    return color + road * (tar + paint * (0.55 - tar) - color)

"""Albedo of what scenes of boxes are made of: planks, tiles, bricks, books, cloth, facades, grass and paving.

Every function draws the same numbers from its generator whatever it is asked for, so that a panorama may be made in
bands. A footprint is the width of a pixel on the surface [metres]: what is finer fades out.
"""

from __future__ import annotations

import numpy as np

from anyprobe.learning.dataset.sky import GROUNDS, tint
from research.detail_library.boxes import Boxes, lines, noise, turbulence

PLAIN, WOOD, BOOKS, FABRIC, FACADE, LEAVES, GRID = range(7)
"""Textures of boxes."""
WOODS = np.array([[0.42, 0.27, 0.15], [0.25, 0.14, 0.07], [0.6, 0.46, 0.3], [0.33, 0.25, 0.19], [0.5, 0.5, 0.48]])
WALLS = np.array([[0.8, 0.78, 0.74], [0.72, 0.7, 0.62], [0.55, 0.6, 0.62], [0.7, 0.55, 0.45], [0.4, 0.45, 0.4]])


def floor(rng, position, foot, kind: int, wood) -> np.ndarray:
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


def wall(rng, position, foot, surface: int, kind: int, wall, half) -> np.ndarray:
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


def texture(rng, boxes: Boxes, index, position, normal, foot) -> np.ndarray:
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
    doors = np.maximum(
        lines(across[grid], 0.45, 0.012, foot[grid]), lines((high - position)[grid, 1], 0.4, 0.012, foot[grid])
    )
    color[grid] *= (1 - 0.75 * doors)[:, None]
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
    dark = (0.1 + 0.12 * noise(rng, pane))[:, None].clip(0.02)
    stain = 1 + 0.18 * turbulence(rng, np.stack([across * 0.7, up * 0.25, index * 5.0], -1), 4)
    course = 1 - 0.25 * (v < 0.05)
    shown = color * (stain * course)[:, None]
    shown = np.where(frame[:, None], color * 1.35, shown)
    shown = np.where(glass[:, None], dark * [0.9, 1.0, 1.15], shown)
    blur = np.clip(foot / 0.8 - 0.3, 0, 1)[:, None]  # far windows melt into their wall
    return shown + blur * (0.75 * color - shown)


def land(rng, kind: str, spot, foot, albedo, other) -> np.ndarray:
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

"""Layout of a photo: floor, walls, other objects and near lamps of one photo, by families."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe_train.dataset.sky import lamp_direction, tint
from anyprobe_train.world import scene
from anyprobe_train.world.lights import LIGHT_ROWS, Light, with_lamp
from anyprobe_train.world.maps import Maps
from anyprobe_train.world.scene import TracedScene
from anyprobe_train.world.views import CELLS

GROUND_HALF = 9.0
"""Half the side of a map's own ground that shadows fall on, in radii of the object."""
COAT_F0 = 0.04
SPREAD = 1.6
"""Spread of the grids of light: half of their points lie within so many radii of their middle."""


Lamp = tuple[np.ndarray, float, np.ndarray]
"""A glowing ball: centre [3], radius, radiance [3]."""


@dataclass(kw_only=True, slots=True)
class Panel:
    """One rectangle; see scene.Panels."""

    origin: np.ndarray
    right: np.ndarray
    up: np.ndarray
    half: tuple[float, float]
    albedo: np.ndarray
    side: float
    alpha: float
    f0: float = COAT_F0
    ground: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class Standing:
    """Another object: its view, turned about +Y by an angle, scaled, at a place on the floor."""

    view: np.void
    turn: float
    scale: float
    place: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Layout:
    """Panels, others, near lamps and the light from far away."""

    panels: list[Panel]
    others: list[Standing]
    lamps: list[Lamp]
    light: Light


def draw_layout(
    rng: np.random.Generator, family: str, view: np.void, light: Light, maps: Maps, others: list[np.void]
) -> Layout:
    """Draw what is around the object of a view. others: views of the same pitch that may stand beside it."""
    eye = view["eye"].astype(float)
    toward = eye * [1, 0, 1] / np.linalg.norm(eye[[0, 2]])
    panels: list[Panel] = []
    standing: list[Standing] = []
    lamps: list[Lamp] = []
    if family == "ground":
        floor = _floor(0.0, GROUND_HALF, GROUND_HALF, 0.0, (np.ones((2, 2, 3)), 1.0, 1.0))
        floor.f0, floor.ground = 0.0, True
        panels.append(floor)
    elif family in ("table", "procedural"):
        panels.append(_drawn_floor(rng, _cover(rng, maps)))
        if rng.random() < 0.3:
            panels.append(_wall(rng, view, toward, float(rng.uniform(1.5, 8.0)), _cover(rng, maps, 0.7)))
        if others and rng.random() < 0.2:
            standing.append(stand_beside(rng, others[0], view, toward))
    elif family == "things":
        kind = ("wall", "corner", "sweep", "window", "clutter", "plinth")[rng.integers(6)]
        plain = _cover(rng, maps, 1.0)
        if kind == "sweep":
            panels += _sweep(rng, view, toward, plain)
        elif kind == "plinth":
            panels += _plinth(rng, view, _cover(rng, maps))
            panels.append(_drawn_floor(rng, _cover(rng, maps), -float(rng.uniform(2.0, 4.0))))
            if rng.random() < 0.6:
                panels.append(_wall(rng, view, toward, float(rng.uniform(2.0, 8.0)), plain))
        else:
            panels.append(_drawn_floor(rng, _cover(rng, maps)))
            if kind == "window":
                panels += _window(rng, view, toward, plain)
            else:
                panels.append(_wall(rng, view, toward, float(rng.uniform(1.2, 4.0)), plain))
        if kind == "corner":
            side = rotation_y(float(rng.choice([-1, 1])) * rng.uniform(1.2, 1.6)) @ toward
            wall = _wall(rng, view, side, float(rng.uniform(1.5, 4.0)), plain, 0.0)
            if np.dot(eye - wall.origin, side) > 0.1:
                panels.append(wall)
        if kind == "clutter":
            standing += [stand_beside(rng, one, view, toward) for one in others]
    elif family == "dark":
        light, lamps = _in_the_dark(rng, view, light, eye)
        cloth = _cloth(rng)
        if rng.random() < 0.75:
            panels.append(_drawn_floor(rng, cloth))
        if rng.random() < 0.6:
            panels.append(_wall(rng, view, toward, float(rng.uniform(1.5, 5.0)), cloth))
    if family in ("table", "things", "procedural") and rng.random() < 0.15:
        lamps += _near_lamp(rng, view, eye, float(rng.uniform(0.3, 3.0)))
    return Layout(panels=panels, others=standing, lamps=lamps, light=light)


def build_scene(view: np.void | None, eye: np.ndarray, layout: Layout, glow: np.ndarray) -> TracedScene:
    """Return a layout as arrays; the grids of its panels are still empty. view: None without the object; glow: [3] its
    mean radiance, a guess."""
    here = [] if view is None else [Standing(view=view, turn=0.0, scale=1.0, place=np.zeros(3))]
    bodies = here + layout.others
    far = layout.light
    side = max([len(one.albedo) for one in layout.panels] or [2])
    panels, hiding, pictures = [], [], []
    for one in layout.panels:
        offset = np.array([0.0, 0.0 if abs(one.up[1]) < 0.5 else 0.6, 0.0]) - one.origin  # the object's, before it
        middle = [np.clip(offset @ axis, -half, half) for axis, half in zip((one.right, one.up), one.half, strict=True)]
        frame = *one.origin, *one.right, *one.up, *np.cross(one.right, one.up), *one.half
        own = one.side, one.f0, one.alpha, *middle, SPREAD, *one.albedo.mean(axis=(0, 1)), one.ground
        panels.append((*frame, *own))
        times = side // len(one.albedo)
        pictures.append(one.albedo.repeat(times, 0).repeat(times, 1))
    for body in bodies:
        linear = rotation_y(body.turn).T / body.scale
        low, cell = body.view["low"].astype(float), body.view["cell"].astype(float)
        middle = body.place + np.linalg.solve(linear, low + CELLS / 2 * cell)
        matrix = np.column_stack([linear, -linear @ body.place - low]) / cell[:, None]
        hiding.append((*middle, (body.scale * CELLS / 2) ** 2 * (cell @ cell), *matrix.ravel(), *glow))
    sources = [(0.0, *one) for one in np.column_stack([far.direction, np.tan(far.radius), far.power])]
    sources += [(1.0, *place, radius, *radiance) for place, radius, radiance in layout.lamps]
    grids = np.zeros(len(panels) * 3 * scene.GRID_POINTS**2 * 3)
    parts = [[*eye, *falling(far)], *(np.ravel(one) for one in (panels, hiding, sources)), grids, np.ravel(pictures)]
    numbers, ends = np.concatenate(parts, dtype=np.float32), np.cumsum([len(one) for one in parts])
    words = np.array([one.view["words"] for one in bodies], np.uint64).reshape(-1, CELLS, CELLS)
    counts = len(panels), len(bodies), len(sources)
    places = np.array([*counts, *ends[:5], side, len(far.sky) // 2, LIGHT_ROWS], np.int64)
    return TracedScene(numbers=numbers, places=places, words=words, sky=far.sky)


def falling(light: Light) -> np.ndarray:
    """Return irradiance [3] on level ground."""
    rows = 8
    texels = light.sky[-2 * rows * rows :].reshape(rows, 2 * rows, 3)[: rows // 2]
    edges = np.cos(np.linspace(0.0, np.pi / 2, rows // 2 + 1)) ** 2
    soft = (texels.mean(axis=1) * (edges[:-1] - edges[1:])[:, None]).sum(axis=0) * np.pi
    tangent = np.tan(light.radius)
    x = np.clip(light.direction[:, 1] / tangent, -1.0, 1.0)  # a disc's height over its radius
    part = tangent / np.pi * ((2 + x**2) * np.sqrt(1 - x**2) / 3 + x * (np.pi / 2 + np.arcsin(x)))
    cosine = np.where(np.abs(x) < 1, part, np.maximum(light.direction[:, 1], 0.0))
    return np.maximum(soft + cosine @ light.power, 1e-6).astype(np.float32)


Cover = tuple[np.ndarray, float, float]


def _cover(rng: np.random.Generator, maps: Maps, plain: float = 0.25) -> Cover:
    """Draw albedo [T, T, 3], alpha and side of a cover, plain ones in a share."""
    known = maps.covers
    number = int(rng.choice(np.flatnonzero(known["plain"] if rng.random() < plain else ~known["plain"])))
    picture = known["albedo"][number] * np.exp(rng.normal(0.0, 0.25)) * np.exp(rng.normal(0.0, 0.06, 3))
    side = float(known["side"][number]) * float(np.exp(rng.normal(0.0, 0.3)))
    return np.clip(picture, 0.005, 0.9).astype(np.float32), float(known["alpha"][number]), side


def _cloth(rng: np.random.Generator) -> Cover:
    """Draw black cloth or grey paper."""
    value = rng.uniform(0.004, 0.04) if rng.random() < 0.6 else np.exp(rng.uniform(np.log(0.04), np.log(0.5)))
    return np.full((2, 2, 3), value, np.float32) * tint(rng, 0.05).astype(np.float32), 1.0, 4.0


def _panel(origin: np.ndarray, right: np.ndarray, up: np.ndarray, half: tuple[float, float], cover: Cover) -> Panel:
    albedo, alpha, side = cover
    return Panel(origin=origin, right=right, up=up, half=half, albedo=albedo, alpha=alpha, side=side)


def _floor(height: float, half_x: float, half_z: float, turn: float, cover: Cover) -> Panel:
    right, up = (rotation_y(turn) @ axis for axis in ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]))
    return _panel(np.array([0.0, height - 1e-3, 0.0]), right, up, (half_x, half_z), cover)


def _drawn_floor(rng: np.random.Generator, cover: Cover, height: float = 0.0) -> Panel:
    """Draw a floor without an end, or a table's top."""
    half = (60.0, 60.0) if rng.random() < 0.5 else tuple(np.exp(rng.uniform(np.log(2.0), np.log(10.0), 2)))
    floor = _floor(height, half[0], half[1], float(rng.uniform(0, 2 * np.pi)), cover)
    free = np.maximum(np.minimum(half, 10.0) - 1.5, 0.0) * rng.uniform(-1, 1, 2)
    floor.origin = floor.origin + free[0] * floor.right + free[1] * floor.up
    return floor


def _behind(view: np.void, front: np.ndarray) -> float:
    """Return how far the object reaches against a level direction."""
    reach = np.maximum(np.abs(view["low"]), np.abs(view["low"] + CELLS * view["cell"]))
    return float(np.sqrt(reach[0] ** 2 * front[0] ** 2 + reach[2] ** 2 * front[2] ** 2)) + 0.1


def _upright(front: np.ndarray, at: np.ndarray, half: tuple[float, float], cover: Cover) -> Panel:
    up = np.array([0.0, 1.0, 0.0])
    return _panel(at, np.cross(up, front), up, half, cover)


def _wall(
    rng: np.random.Generator, view: np.void, toward: np.ndarray, distance: float, cover: Cover, turned: float = 0.6
) -> Panel:
    """Draw a wall behind the object that faces `toward`, turned a little."""
    front = rotation_y(rng.uniform(-turned, turned) if turned else 0.0) @ toward
    distance = max(distance, _behind(view, front))
    return _upright(front, -front * distance + [0.0, 7.0, 0.0], (float(rng.uniform(6, 20)), 8.0), cover)


def _window(rng: np.random.Generator, view: np.void, toward: np.ndarray, cover: Cover) -> list[Panel]:
    """Draw the four parts of a wall around an opening behind the object."""
    front = rotation_y(rng.uniform(-0.4, 0.4)) @ toward
    distance = max(float(rng.uniform(1.5, 5.0)), _behind(view, front))
    width, height = float(rng.uniform(0.8, 3.0)), float(rng.uniform(0.8, 2.5))
    sill, aside = float(rng.uniform(0.0, 1.5)), float(rng.normal(0.0, 1.0))
    across, middle = np.cross([0.0, 1.0, 0.0], front), -front * distance
    parts = (
        (aside - 10.0 - width, 0.0, 10.0, 16.0),
        (aside + 10.0 + width, 0.0, 10.0, 16.0),
        (aside, sill - 16.0, width, 16.0),
        (aside, sill + 2 * height + 8.0, width, 8.0),
    )
    return [_upright(front, middle + across * x + [0.0, y, 0.0], (w, h), cover) for x, y, w, h in parts]


def _sweep(rng: np.random.Generator, view: np.void, toward: np.ndarray, cover: Cover) -> list[Panel]:
    """Draw a sheet of paper that bends up behind the object, in facets."""
    back = max(float(rng.uniform(1.2, 3.0)), _behind(view, toward))
    radius, half = float(rng.uniform(0.8, 2.5)), float(rng.uniform(3.0, 8.0))
    turn = rotation_y(np.arctan2(toward[0], toward[2]))  # +Z to the camera
    points = [np.array([6.0, 0.0]), np.array([-back, 0.0])]
    for angle in np.linspace(0, np.pi / 2, 6)[1:]:
        points.append(np.array([-back - radius * np.sin(angle), radius * (1 - np.cos(angle))]))
    points.append(points[-1] + [0.0, 8.0])
    panels, sheet = [], (cover[0], max(cover[1], 0.5), cover[2])
    for a, b in pairwise(points):
        along = b - a
        length = float(np.linalg.norm(along))
        middle = turn @ np.array([0.0, (a[1] + b[1]) / 2 - 1e-3, (a[0] + b[0]) / 2])
        up = turn @ (np.array([0.0, along[1], along[0]]) / length)
        panels.append(_panel(middle, turn @ np.array([1.0, 0.0, 0.0]), up, (half, length / 2 + 0.01), sheet))
    return panels


def _plinth(rng: np.random.Generator, view: np.void, cover: Cover) -> list[Panel]:
    """Draw the top and the sides of a block under the object."""
    reach = max(_behind(view, np.array([1.0, 0, 0])), _behind(view, np.array([0, 0, 1.0]))) - 0.1
    half, height = reach * float(rng.uniform(0.9, 1.6)), float(rng.uniform(0.5, 4.0))
    panels = [_floor(0.0, half, half, 0.0, cover)]
    for k in range(4):
        front = rotation_y(k * np.pi / 2) @ np.array([0.0, 0.0, 1.0])
        panels.append(_upright(front, front * half - [0.0, height / 2 + 1e-3, 0.0], (half, height / 2), cover))
    return panels


def stand_beside(rng: np.random.Generator, other: np.void, view: np.void, toward: np.ndarray) -> Standing:
    """Place another object beside or behind the first, clear of it, turned as it was seen."""

    def reach(one: np.void) -> float:
        low, high = one["low"], one["low"] + CELLS * one["cell"]
        return float(np.hypot(max(-low[0], high[0]), max(-low[2], high[2])))

    size = float(rng.uniform(0.5, 1.1))
    away = reach(view) + size * reach(other) + rng.uniform(0.1, 1.5)
    place = rotation_y(rng.uniform(np.pi / 2, np.pi) * rng.choice([-1, 1])) @ toward * away
    wanted, own = view["eye"] - place, other["eye"]
    turn = np.arctan2(wanted[0], wanted[2]) - np.arctan2(own[0], own[2])
    return Standing(view=other, turn=float(turn), scale=size, place=place)


def _in_the_dark(rng: np.random.Generator, view: np.void, light: Light, eye: np.ndarray) -> tuple[Light, list[Lamp]]:
    """Draw one to three lamps anywhere, also near the object or beside the lens."""
    center = np.array([0.0, float(view["top"]) / 2, 0.0])
    ahead = eye - center
    lamps = []
    for number in range(rng.choice([1, 1, 1, 2, 3])):
        if rng.random() < 0.25:  # a flash, or a lamp that the photographer holds
            way = ahead / np.linalg.norm(ahead) + rng.normal(0.0, 0.15, 3)
        else:
            way = lamp_direction(rng)
            if number == 0 and rng.random() < 0.6 and way @ ahead < 0:  # most stand before the object
                way = way * [-1, 1, -1]
        way = way / np.linalg.norm(way)
        color, power = tint(rng, 0.2), np.exp(rng.uniform(np.log(0.15), 0.0)) if number else 1.0
        if rng.random() < 0.4:
            distance, radius = (float(np.exp(rng.uniform(*np.log(b)))) for b in ((3.0, 9.0), (0.1, 0.8)))
            place = center + distance * way
            if place[1] > radius + 0.1 and not _before(place, radius, center, eye):
                lamps.append((place, radius, 4.0 * power / (radius / distance) ** 2 * color))
                continue
        radius = float(np.radians(np.exp(rng.uniform(np.log(1.5), np.log(18.0)))))
        light = with_lamp(rng, light, way, radius, 4.0 * np.pi * power * color)
    return light, lamps


def _near_lamp(rng: np.random.Generator, view: np.void, eye: np.ndarray, power: float) -> list[Lamp]:
    """Draw a lamp within a few radii, as strong as `power` times a mean sky."""
    distance, radius = (float(np.exp(rng.uniform(*np.log(b)))) for b in ((2.5, 9.0), (0.1, 0.8)))
    place = np.array([0.0, float(view["top"]) / 2, 0.0]) + distance * lamp_direction(rng)
    if place[1] < radius + 0.1 or _before(place, radius, np.array([0.0, float(view["top"]) / 2, 0.0]), eye):
        return []
    return [(place, radius, 4.0 * power / (radius / distance) ** 2 * tint(rng, 0.3))]


def _before(place: np.ndarray, radius: float, center: np.ndarray, eye: np.ndarray) -> bool:
    """Return whether a lamp is at the eye, or between it and the object, which is always drawn in front."""
    lamp, ahead = place - eye, center - eye
    away, far = np.linalg.norm(lamp), np.linalg.norm(ahead)
    beside = np.arccos(np.clip(lamp @ ahead / (away * far), -1.0, 1.0))
    return bool(away < radius + 0.5 or (away < far and beside < (1.2 + radius) / far + 0.1))

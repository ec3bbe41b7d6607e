"""Scenes by families: which object stands where on what, under which light, and the camera that looks at it.

World: +Y up, the object stands on y = 0 over the origin, its bounding sphere's radius is 1.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import irradiance_map
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.sky import direction_at, tint
from anyprobe_train.world.covers import Cover, draw_cover
from research.painted import painted
from research.scenes.drawn_light import add_lamp, draw_place, draw_procedural_light, draw_real_light, with_lamps
from research.scenes.parts import VariedStore
from research.world.whole_scenes import Panel, Phone, Thing, _draw_second, _placed, _standing

FAMILIES = ("ground", "table", "things", "dark", "procedural")
SHARES = (0.36, 0.26, 0.17, 0.11, 0.1)
"""Shares of the families among the scenes."""
SEED = 3107

OBJECT_PX = 100
"""Longer side of the object's box in the picture, where the picture's own side allows it."""
MOST_PX = 480
"""Longer side of the picture at most."""
FOV_DEG = (15.0, 80.0)
"""Field of view of the longer side; even in its tangent."""
ASPECTS = (1.0, 4 / 3, 3 / 2, 16 / 9)
OFF_CENTER = 0.07
"""Standard deviation of the box's centre from the photo's, of each side."""
ROLL_DEG = 2.0
TRIES = 60
EYE_HEIGHT = 1.0
"""The least height of a camera over the ground, in radii of the object, where a map's own ground is seen."""
GROUND_HALF, GROUND_PX = 9.0, 288
"""Half the side of the traced part of a map's own ground, in radii of the object, and pixels of its albedo."""
ALBEDO_RANGE = (0.03, 0.8)


@dataclass(frozen=True, kw_only=True, slots=True)
class Lamp:
    """A glowing ball near the object: centre [3], radius, radiance [3]."""

    center: np.ndarray
    radius: float
    radiance: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Layout:
    """A scene of one family.

    light: [H, 2H, 3] in the world's frame. on_map: whether the picture beside object and shadow is the light itself,
    and ground_level the luminance that the unshadowed ground reflects at albedo 1. center: [3], where the probe is.
    """

    family: str
    thing: Thing
    others: tuple[Thing, ...]
    panels: tuple[Panel, ...]
    lamps: tuple[Lamp, ...]
    light: np.ndarray
    phone: Phone
    center: np.ndarray
    map_name: str
    shape_name: str
    on_map: bool = False
    ground_radiance: np.ndarray | None = None


def draw_layout(family: str, part: str, index: int, store: AssetStore) -> Layout:
    """Return scene number `index` of a family and a part: the same for the same assets."""
    rng = np.random.default_rng((SEED, zlib.crc32(part.encode()), FAMILIES.index(family), index))
    return _DRAWN[family](rng, store)


def draw_family(part: str, index: int) -> str:
    """Return the family of scene number `index` of a part that has all of them in their shares."""
    rng = np.random.default_rng((SEED, zlib.crc32(part.encode()), index))
    return FAMILIES[rng.choice(len(FAMILIES), p=SHARES)]


# families


def _on_map_ground(rng: np.random.Generator, store: AssetStore) -> Layout:
    """Draw an object on the ground of a map itself (Debevec 1998): all but object and shadow is the real place."""
    name, place = _place(rng, store)
    mesh, material, shape = _object(rng, store)
    phone = _camera(rng, mesh, pitch_deg=(6.0, 55.0))
    falling = _falling(place)
    cover = _own_ground(place, falling, phone.position)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_x(-np.pi / 2) @ np.diag([GROUND_HALF, GROUND_HALF, 1.0])
    matrix[1, 3] = -1e-3
    ground = Panel(world_from_panel=matrix, half=(GROUND_HALF, GROUND_HALF), cover=cover)
    return Layout(
        family="ground",
        thing=Thing(mesh=mesh, material=material),
        others=(),
        panels=(ground,),
        lamps=(),
        light=place,
        phone=phone,
        center=_center(mesh),
        map_name=name,
        shape_name=shape,
        on_map=True,
        ground_radiance=falling / np.pi,
    )


def _on_table(rng: np.random.Generator, store: AssetStore, light: tuple[str, np.ndarray] | None = None) -> Layout:
    """Draw an object on a table or a floor, some before a wall or beside others."""
    name, radiance = light or _real_light(rng, store)
    mesh, material, shape = _object(rng, store)
    phone = _camera(rng, mesh)
    toward = _toward(phone)
    panels = [_floor(rng, draw_cover(rng))]
    if rng.random() < 0.25:
        panels.append(_wall(rng, toward, float(rng.uniform(1.5, 8.0))))
    others = (_draw_second(rng, store, toward, mesh),) if rng.random() < 0.25 else ()
    return Layout(
        family="table",
        thing=Thing(mesh=mesh, material=material),
        others=others,
        panels=tuple(panels),
        lamps=(),
        light=radiance,
        phone=phone,
        center=_center(mesh),
        map_name=name,
        shape_name=shape,
    )


def _procedural(rng: np.random.Generator, store: AssetStore) -> Layout:
    """Draw the same under a procedural room, day or studio."""
    return replace(_on_table(rng, store, ("procedural", draw_procedural_light(rng))), family="procedural")


def _before_things(rng: np.random.Generator, store: AssetStore) -> Layout:
    """Draw an object before a wall, in a corner, on a plinth, a shelf or a turntable, on a sweep of paper, before a
    window, or among others."""
    kind = ("wall", "corner", "plinth", "shelf", "sweep", "turntable", "window", "clutter")[rng.integers(8)]
    name, radiance = _real_light(rng, store) if rng.random() < 0.7 else ("procedural", draw_procedural_light(rng))
    mesh, material, shape = _object(rng, store)
    phone = _camera(rng, mesh, pitch_deg=(0.0, 40.0))
    toward, panels, others = _toward(phone), [], []
    plain = draw_cover(rng, "plain")
    if kind in ("wall", "corner", "clutter"):
        panels += [_floor(rng, draw_cover(rng)), _wall(rng, toward, float(rng.uniform(1.2, 4.0)))]
    if kind == "corner":
        side = rotation_y(float(rng.choice([-1, 1])) * rng.uniform(1.2, 1.6)) @ toward
        panels.append(_wall(rng, side, float(rng.uniform(1.5, 4.0)), 0.0))
    if kind == "clutter":
        others += [_draw_second(rng, store, toward, mesh) for _ in range(rng.integers(2, 5))]
    if kind == "plinth":
        half = _reach(mesh) * rng.uniform(0.8, 1.6)
        panels += [*_box(half, float(rng.uniform(0.5, 4.0)), draw_cover(rng))]
        panels.append(_floor(rng, draw_cover(rng), height=-float(rng.uniform(3.0, 5.0))))
        if rng.random() < 0.6:
            panels.append(_wall(rng, toward, float(rng.uniform(2.0, 8.0))))
    if kind == "shelf":
        board = draw_cover(rng, "wood" if rng.random() < 0.6 else "plain")
        panels += [_floor(rng, board, half=(9.0, 2.0), turn=np.arctan2(toward[0], toward[2]))]
        panels.append(_wall(rng, toward, float(rng.uniform(1.3, 2.0)), 0.0))
        above = _floor(rng, board, half=(9.0, 2.0), turn=np.arctan2(toward[0], toward[2]))
        panels.append(_moved(above, np.array([0.0, rng.uniform(2.2, 3.5), 0.0]), flipped=True))
    if kind == "sweep":
        panels += _sweep(rng, toward, plain)
    if kind == "turntable":
        panels.append(_floor(rng, draw_cover(rng), height=-float(rng.uniform(0.05, 0.4))))
        others.append(_turntable(rng, mesh))
        if rng.random() < 0.5:
            panels.append(_wall(rng, toward, float(rng.uniform(2.0, 6.0))))
    if kind == "window":
        panels += [_floor(rng, draw_cover(rng)), *_window(rng, toward, plain)]
        if rng.random() < 0.6:
            panels.append(_wall(rng, -toward, float(rng.uniform(6.0, 12.0)), 0.0))
    return Layout(
        family="things",
        thing=Thing(mesh=mesh, material=material),
        others=tuple(others),
        panels=tuple(panels),
        lamps=(),
        light=radiance,
        phone=phone,
        center=_center(mesh),
        map_name=name,
        shape_name=shape,
    )


def _in_the_dark(rng: np.random.Generator, store: AssetStore) -> Layout:
    """Draw an object in a dark room or a studio: one to three lamps anywhere, also near it or beside the lens."""
    mesh, material, shape = _object(rng, store)
    phone = _camera(rng, mesh, pitch_deg=(0.0, 40.0), tight=rng.random() < 0.6)
    toward, center = _toward(phone), _center(mesh)
    name, room = _real_light(rng, store)
    ambient = room * np.exp(rng.uniform(np.log(1e-4), np.log(0.08)))
    lamps, light = [], np.maximum(ambient, 1e-6)
    for number in range(rng.choice([1, 1, 1, 2, 3])):
        at_lens = rng.random() < 0.25
        ahead = phone.position - center
        if at_lens:  # a flash, or a lamp that the photographer holds
            way = ahead / np.linalg.norm(ahead) + rng.normal(0.0, 0.15, 3)
        else:
            way = direction_at(rng.uniform(0, 2 * np.pi), np.arcsin(rng.uniform(-0.2, 0.98)))
            if number == 0 and rng.random() < 0.6 and way @ ahead < 0:  # most stand before the object
                way = way * [-1, 1, -1]
        way = way / np.linalg.norm(way)
        color, power = tint(rng, 0.2), np.exp(rng.uniform(np.log(0.15), 0.0)) if number else 1.0
        if rng.random() < 0.4:
            distance = float(np.exp(rng.uniform(np.log(3.0), np.log(9.0))))
            radius = float(np.exp(rng.uniform(np.log(0.1), np.log(0.8))))
            place = center + distance * way
            if place[1] > radius + 0.1 and np.linalg.norm(place - phone.position) > radius + 0.5:
                sent = 4.0 * np.pi * power / (np.pi * (radius / distance) ** 2)  # as bright as a distant one
                lamps.append(Lamp(center=place, radius=radius, radiance=sent * color))
                continue
        radius = max(np.radians(np.exp(rng.uniform(np.log(1.5), np.log(18.0)))), 1.5 * np.pi / len(light))
        light = add_lamp(light, way, radius, 4.0 * np.pi * power * color, float(rng.uniform(0.1, 1.0)))
    black = rng.random() < 0.6
    panels = []
    if rng.random() < 0.75:
        panels.append(_floor(rng, _cloth(rng, black)))
    if rng.random() < 0.6:
        panels.append(_wall(rng, toward, float(rng.uniform(1.5, 5.0)), cover=_cloth(rng, black)))
    others = (_turntable(rng, mesh),) if panels and rng.random() < 0.25 else ()
    if others:
        panels[0] = _moved(panels[0], np.array([0.0, -0.3, 0.0]))
    return Layout(
        family="dark",
        thing=Thing(mesh=mesh, material=material),
        others=others,
        panels=tuple(panels),
        lamps=tuple(lamps),
        light=light.astype(np.float32),
        phone=phone,
        center=center,
        map_name=name,
        shape_name=shape,
    )


_DRAWN: dict[str, Callable[[np.random.Generator, AssetStore], Layout]] = {
    "ground": _on_map_ground,
    "table": _on_table,
    "things": _before_things,
    "dark": _in_the_dark,
    "procedural": _procedural,
}


# light


def _names(store: AssetStore) -> list[str]:
    return sorted(store.maps)


def _place(rng: np.random.Generator, store: AssetStore) -> tuple[str, np.ndarray]:
    """Draw a place's name and its light; a tenth are procedural, a quarter have a lamp more."""
    if isinstance(store, VariedStore):
        return store.light(rng, "ground")
    if rng.random() < 0.1:
        return "procedural", draw_procedural_light(rng)
    asset = store.map(_names(store)[rng.integers(len(store.maps))])
    light = draw_place(rng, [asset.radiance])
    return asset.name, normalize_map(with_lamps(rng, light, 1)) if rng.random() < 0.25 else light


def _real_light(rng: np.random.Generator, store: AssetStore) -> tuple[str, np.ndarray]:
    """Draw a light of real maps, named by the first of them."""
    if isinstance(store, VariedStore):
        return store.light(rng, "real")
    names = _names(store)
    first = store.map(names[rng.integers(len(names))])
    second = store.map(names[rng.integers(len(names))])
    return first.name, draw_real_light(rng, [first.radiance, second.radiance][: 1 + int(rng.random() < 0.3)])


def _falling(radiance: np.ndarray) -> np.ndarray:
    """Return irradiance [3] on level ground."""
    above = reduced(radiance, 32).copy()
    above[16:] = 0.0
    return np.maximum(irradiance_map(above)[0].mean(axis=0), 1e-6).astype(np.float64)


def _own_ground(place: np.ndarray, falling: np.ndarray, eye: np.ndarray) -> Cover:
    """Return the albedo by which unshadowed ground looks from the eye as the map does."""
    step = (np.arange(GROUND_PX) + 0.5) / GROUND_PX * 2 - 1
    x, up = np.meshgrid(step * GROUND_HALF, -step * GROUND_HALF)  # rows from the panel's top, which is -Z
    points = np.stack([x, np.zeros_like(x), -up], axis=-1)
    d = points - eye
    d = d / np.linalg.norm(d, axis=-1, keepdims=True)
    seen = bilinear(place, direction_to_uv(d).astype(np.float32))
    albedo = np.clip(seen * np.pi / falling, *ALBEDO_RANGE)
    return Cover(kind="ground", albedo=albedo.astype(np.float32), alpha=1.0, side=2 * GROUND_HALF)


# objects and cameras


def _object(rng: np.random.Generator, store: AssetStore) -> tuple[Mesh, Material, str]:
    """Draw a standing shape and its material; some are a little textured."""
    kind = int(distributions.draw_kinds(rng, 1)[0])
    alpha = float(distributions.draw_alphas(rng, np.array([kind]))[0])
    material = distributions.draw_one(rng, kind, alpha)
    keys = sorted(store.shapes)
    asset = store.shape(keys[rng.integers(len(keys))])
    if rng.random() < (0.5 if distributions.KINDS[kind] == "painted" else 0.1):
        material = painted(material, asset.mesh, rng)
    return _standing(asset.mesh, rng), material, asset.name


def _center(mesh: Mesh) -> np.ndarray:
    return (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2


def _reach(mesh: Mesh) -> float:
    return float(np.abs(mesh.positions[:, [0, 2]]).max())


def _toward(phone: Phone) -> np.ndarray:
    """Return the level direction from the object to the camera [3]."""
    flat = phone.position * [1, 0, 1]
    return flat / np.linalg.norm(flat)


def _camera(
    rng: np.random.Generator, mesh: Mesh, pitch_deg: tuple[float, float] = (3.0, 55.0), tight: bool = False
) -> Phone:
    """Draw a camera over the ground with the whole object in its picture, of any lens, size and aspect."""
    aspect = ASPECTS[rng.integers(len(ASPECTS))]
    portrait = rng.random() < 0.45
    for _ in range(TRIES):
        fov = 2 * np.arctan(rng.uniform(*np.tan(np.radians(FOV_DEG) / 2)))
        share = float(rng.uniform(0.85, 1.0) if tight else rng.choice([rng.uniform(0.15, 0.5), rng.uniform(0.4, 1.0)]))
        short = min(OBJECT_PX / share, MOST_PX / aspect)
        long = short * aspect
        width, height = (round(short), round(long)) if portrait else (round(long), round(short))
        pitch, roll = float(rng.uniform(*pitch_deg)), float(rng.normal(0.0, ROLL_DEG))
        spread = 0.02 if tight else OFF_CENTER
        at = np.array([width, height]) * (0.5 + rng.normal(0.0, spread, 2))
        turn = rotation_x(-np.radians(pitch)) @ rotation_z(np.radians(roll))
        phone = _placed(mesh, turn, at, share * short, float(long / 2 / np.tan(fov / 2)), (width, height), pitch, roll)
        box = phone.pixels(mesh.positions)
        low, high = box.min(axis=0), box.max(axis=0)
        edge = 0.01 * np.array([width, height])
        nearest = (mesh.positions - phone.position).dot(-phone.world_from_camera[:, 2]).min()
        inside = (low > edge).all() and (high < [width, height] - edge).all()
        if inside and phone.position[1] > 0.25 and nearest > 0.3:
            break
    return phone


# what stands around


def _floor(
    rng: np.random.Generator,
    cover: Cover,
    height: float = 0.0,
    half: tuple[float, float] | None = None,
    turn: float | None = None,
) -> Panel:
    """Draw a floor or a table's top."""
    if half is None:
        half = (60.0, 60.0) if rng.random() < 0.5 else tuple(np.exp(rng.uniform(np.log(2.0), np.log(10.0), 2)))
    turn = rng.uniform(0, 2 * np.pi) if turn is None else turn
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_y(turn) @ rotation_x(-np.pi / 2) @ np.diag([*half, 1.0])
    matrix[1, 3] = height - 1e-3
    return Panel(world_from_panel=matrix, half=half, cover=cover)


def _wall(
    rng: np.random.Generator, toward: np.ndarray, distance: float, turned: float = 0.6, cover: Cover | None = None
) -> Panel:
    """Draw a wall that faces `toward`, turned by at most `turned` radians."""
    cover = cover or draw_cover(rng, "plain" if rng.random() < 0.7 else None)
    front = rotation_y(rng.uniform(-turned, turned) if turned else 0.0) @ toward
    half = (float(rng.uniform(6, 20)), 8.0)
    return _facing(front, -front * distance + [0.0, 7.0, 0.0], half, cover)


def _facing(front: np.ndarray, at: np.ndarray, half: tuple[float, float], cover: Cover) -> Panel:
    """Return an upright panel around a point."""
    across = np.cross([0.0, 1.0, 0.0], front)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([across * half[0], np.array([0, half[1], 0]), front], axis=1)
    matrix[:3, 3] = at
    return Panel(world_from_panel=matrix, half=half, cover=cover)


def _moved(panel: Panel, by: np.ndarray, flipped: bool = False) -> Panel:
    """Return the panel moved, or turned over too, so that it faces down."""
    matrix = panel.world_from_panel.copy()
    matrix[:3, 3] += by
    if flipped:
        matrix[:3, 1:3] *= -1
    return replace(panel, world_from_panel=matrix)


def _box(half: float, height: float, cover: Cover) -> list[Panel]:
    """Return top and sides of a plinth whose top is the ground."""
    top = np.eye(4)
    top[:3, :3] = rotation_x(-np.pi / 2) @ np.diag([half, half, 1.0])
    top[1, 3] = -1e-3
    panels = [Panel(world_from_panel=top, half=(half, half), cover=cover)]
    for k in range(4):
        front = rotation_y(k * np.pi / 2) @ np.array([0.0, 0.0, 1.0])
        panels.append(_facing(front, front * half - [0.0, height / 2, 0.0], (half, height / 2), cover))
    return panels


def _sweep(rng: np.random.Generator, toward: np.ndarray, cover: Cover) -> list[Panel]:
    """Return a sheet of paper that bends up behind the object, in facets."""
    back, radius, half = float(rng.uniform(1.2, 3.0)), float(rng.uniform(0.8, 2.5)), float(rng.uniform(3.0, 8.0))
    turn = rotation_y(np.arctan2(toward[0], toward[2]))  # +Z to the camera
    points = [np.array([6.0, 0.0]), np.array([-back, 0.0])]
    for angle in np.linspace(0, np.pi / 2, 6)[1:]:
        points.append(np.array([-back - radius * np.sin(angle), radius * (1 - np.cos(angle))]))
    points.append(points[-1] + [0.0, 8.0])
    panels = []
    for a, b in zip(points[:-1], points[1:], strict=True):
        along = b - a
        length = float(np.linalg.norm(along))
        up = np.array([0.0, along[1], along[0]]) / length  # y, z of the facet's own y
        across = np.array([1.0, 0.0, 0.0])
        matrix = np.eye(4)
        matrix[:3, :3] = turn @ np.stack([across * half, up * length / 2, np.cross(across, up)], axis=1)
        matrix[:3, 3] = turn @ np.array([0.0, (a[1] + b[1]) / 2 - 1e-3, (a[0] + b[0]) / 2])
        panels.append(Panel(world_from_panel=matrix, half=(half, length / 2), cover=cover))
    return panels


def _window(rng: np.random.Generator, toward: np.ndarray, cover: Cover) -> list[Panel]:
    """Return the four parts of a wall around an opening behind the object."""
    distance, width, height = float(rng.uniform(1.5, 5.0)), float(rng.uniform(0.8, 3.0)), float(rng.uniform(0.8, 2.5))
    sill, aside = float(rng.uniform(0.0, 1.5)), float(rng.normal(0.0, 1.0))
    front = rotation_y(rng.uniform(-0.4, 0.4)) @ toward
    across, middle = np.cross([0.0, 1.0, 0.0], front), -front * distance
    parts = (
        (aside - 10.0 - width, 0.0, 10.0, 16.0),
        (aside + 10.0 + width, 0.0, 10.0, 16.0),
        (aside, sill - 16.0, width, 16.0),
        (aside, sill + 2 * height + 8.0, width, 8.0),
    )
    return [_facing(front, middle + across * x + [0.0, y, 0.0], (w, h), cover) for x, y, w, h in parts]


def _turntable(rng: np.random.Generator, mesh: Mesh) -> Thing:
    """Return a round plate under the object."""
    rows, radius, high = 24, _reach(mesh) * float(rng.uniform(0.9, 1.8)), float(rng.uniform(0.05, 0.3))
    ball = sphere(rows)
    flat = ball.positions.copy()
    flat[:, 1] = np.clip(flat[:, 1] * 6.0, -1.0, 1.0)
    reach = np.linalg.norm(flat[:, [0, 2]], axis=1)
    flat[:, [0, 2]] *= (np.minimum(6.0 * reach, 1.0) / np.maximum(reach, 1e-3))[:, None]
    positions = flat * [radius, high / 2, radius] - [0.0, high / 2 + 2e-3, 0.0]
    faces = ball.faces
    a, b, c = (positions[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    corner = np.repeat(normal[:, None], 3, axis=1)
    kind = int(distributions.draw_kinds(rng, 1)[0])
    alpha = float(distributions.draw_alphas(rng, np.array([kind]))[0])
    made = replace(ball, positions=positions.astype(np.float32), normals=corner.astype(np.float32))
    return Thing(mesh=made, material=distributions.draw_one(rng, kind, max(alpha, 0.1)))


def _cloth(rng: np.random.Generator, black: bool) -> Cover:
    """Return black cloth, or grey paper."""
    value = rng.uniform(0.004, 0.04) if black else np.exp(rng.uniform(np.log(0.04), np.log(0.5)))
    albedo = np.full((4, 4, 3), value, np.float32) * tint(rng, 0.05).astype(np.float32)
    return Cover(kind="cloth", albedo=albedo, alpha=1.0, side=4.0)

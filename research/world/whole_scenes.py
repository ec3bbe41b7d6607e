"""Scenes of whole photos: what stands where on which table, and the phone that looks at it. All drawn from a recipe.

World: +Y up, the table's top y = 0, the object stands in the middle, its bounding sphere's radius is 1.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.render.mesh import Mesh
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.recipe import Recipe
from anyprobe_train.world.covers import Cover, draw_cover
from research.painted import is_painted, painted

LONG_PX, SHORT_PX = 480, 360
PITCH_DEG = (5.0, 50.0)
ROLL_DEG = 1.5
"""Standard deviation: hands hold phones nearly level."""
LONG_FOV_DEG = (50.0, 75.0)
"""28 to 45 mm equivalent, the main cameras of phones and a little zoom."""
PORTRAIT = 0.4
SIZES, SIZE_RANKS = (0.4, 0.6, 0.75, 0.88, 1.0), (0.0, 0.25, 0.5, 0.75, 1.0)
"""Quantiles of the longer side of the object's box over the photo's shorter side: a little smaller than in photos of
single objects (.63 .77 .85 1.0 1.06 at 10 25 50 75 90 % of 33), which are cropped."""
OFF_CENTER = 0.05
"""Standard deviation of the box's centre from the photo's, of the longer side."""
FLOOR, TABLE = 60.0, (3.0, 10.0)
"""Half the side of what is a floor, and bounds of what is a table."""
FLOORS, WALLS, SECONDS, CUT_OUTS = 0.5, 0.2, 0.25, 0.2
"""Shares of the scenes."""
BORDER = 0.02
"""Of the photo's sides, that the object keeps off its border."""
TRIES = 200


@dataclass(frozen=True, kw_only=True, slots=True)
class Thing:
    """A mesh in the world, and its material: albedo [3], or [F, 3, 3] at the corners of the faces."""

    mesh: Mesh
    material: Material


@dataclass(frozen=True, kw_only=True, slots=True)
class Panel:
    """A rectangle: world_from_panel [4, 4] takes [-1, 1]^2 in x and y to it, +Z is its front; half: of its sides."""

    world_from_panel: np.ndarray
    half: tuple[float, float]
    cover: Cover


@dataclass(frozen=True, kw_only=True, slots=True)
class Phone:
    """A pinhole photo: world_from_camera [3, 3], position [3], focal [px], width, height [px]."""

    world_from_camera: np.ndarray
    position: np.ndarray
    focal: float
    width: int
    height: int
    pitch_deg: float
    roll_deg: float

    @property
    def long_fov_deg(self) -> float:
        """Field of view of the longer side."""
        return float(np.degrees(2 * np.arctan(max(self.width, self.height) / 2 / self.focal)))

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """World points [..., 3] to x, y [px]."""
        seen = (points - self.position) @ self.world_from_camera
        depth = np.maximum(-seen[..., 2], 1e-6)
        return np.stack(
            [self.width / 2 + self.focal * seen[..., 0] / depth, self.height / 2 - self.focal * seen[..., 1] / depth],
            axis=-1,
        )

    def rays(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """World directions [..., 3], unit, through points of the photo."""
        seen = np.stack([(x - self.width / 2) / self.focal, (self.height / 2 - y) / self.focal, -np.ones_like(x)], -1)
        return seen / np.linalg.norm(seen, axis=-1, keepdims=True) @ self.world_from_camera.T


@dataclass(frozen=True, kw_only=True, slots=True)
class Scene:
    """What Mitsuba is given. center: [3], the object's, where the probe is. cut_out: "", "alpha" or "plain"."""

    thing: Thing
    others: tuple[Thing, ...]
    panels: tuple[Panel, ...]
    center: np.ndarray
    map_yaw: float
    phone: Phone
    cut_out: str


def draw_scene(recipe: Recipe, store: AssetStore) -> Scene:
    """Return the scene of a recipe: the same for the same recipe and assets."""
    rng = recipe.rng()
    kind, brighter = recipe.material % 4, recipe.material // 4
    alpha = float(distributions.draw_alphas(rng, np.array([kind]))[0])
    material = distributions.draw_one(rng, kind, alpha, (brighter + rng.random()) / 2)
    shape = store.shape(recipe.shape_id).mesh
    if is_painted(recipe):
        material = painted(material, shape, rng.spawn(1)[0])
    thing = Thing(mesh=_standing(shape, rng), material=material)
    map_yaw = float(rng.uniform(0, 2 * np.pi))
    center = (thing.mesh.positions.min(axis=0) + thing.mesh.positions.max(axis=0)) / 2
    phone = _draw_phone(rng, thing.mesh)
    toward = phone.position * [1, 0, 1]
    toward = toward / np.linalg.norm(toward)
    panels = [_draw_table(rng)]
    if rng.random() < WALLS:
        panels.append(_draw_wall(rng, toward))
    others = ()
    if rng.random() < SECONDS:
        others = (_draw_second(rng, store, toward, thing.mesh),)
    cut_out = ("alpha" if rng.random() < 0.5 else "plain") if rng.random() < CUT_OUTS else ""
    return Scene(
        thing=thing, others=others, panels=tuple(panels), center=center, map_yaw=map_yaw, phone=phone, cut_out=cut_out
    )


def _standing(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """Turned about +Y, its lowest point on the table and its middle over the origin."""
    turn = rotation_y(rng.uniform(0, 2 * np.pi))
    positions = mesh.positions @ turn.T
    low, high = positions.min(axis=0), positions.max(axis=0)
    foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return replace(
        mesh, positions=(positions - foot).astype(np.float32), normals=(mesh.normals @ turn.T).astype(np.float32)
    )


def _draw_phone(rng: np.random.Generator, mesh: Mesh) -> Phone:
    """Over the table, the whole object in its photo."""
    portrait = rng.random() < PORTRAIT
    width, height = (SHORT_PX, LONG_PX) if portrait else (LONG_PX, SHORT_PX)
    focal = LONG_PX / 2 / np.tan(np.radians(rng.uniform(*LONG_FOV_DEG)) / 2)
    pitch_deg = float(rng.uniform(*PITCH_DEG))
    for _ in range(TRIES):
        size = float(np.interp(rng.random(), SIZE_RANKS, SIZES)) * SHORT_PX
        x, y = np.array([width, height]) / 2 + rng.normal(0.0, OFF_CENTER * LONG_PX, 2)
        roll_deg = float(rng.normal(0.0, ROLL_DEG))
        turn = rotation_x(-np.radians(pitch_deg)) @ rotation_z(np.radians(roll_deg))
        phone = _placed(mesh, turn, (x, y), size, float(focal), (width, height), pitch_deg, roll_deg)
        box = phone.pixels(mesh.positions)
        low, high = box.min(axis=0), box.max(axis=0)
        edge = BORDER * np.array([width, height])
        nearest = (mesh.positions - phone.position).dot(-phone.world_from_camera[:, 2]).min()
        if (low > edge).all() and (high < [width, height] - edge).all() and phone.position[1] > 0.2 and nearest > 0.3:
            break
    return phone


def _placed(mesh, turn, at, size, focal, sides, pitch_deg, roll_deg) -> Phone:
    """At the distance where the object's box has its longer side and its centre there."""
    center = (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2
    distance, aim = 2.0 * focal / size, np.array(at, float)
    for _ in range(6):
        ray = np.array([(aim[0] - sides[0] / 2) / focal, (sides[1] / 2 - aim[1]) / focal, -1.0])
        phone = Phone(
            world_from_camera=turn,
            position=center - distance * (turn @ (ray / np.linalg.norm(ray))),
            focal=focal,
            width=sides[0],
            height=sides[1],
            pitch_deg=pitch_deg,
            roll_deg=roll_deg,
        )
        box = phone.pixels(mesh.positions)
        low, high = box.min(axis=0), box.max(axis=0)
        aim += at - (low + high) / 2
        distance = max(distance * float((high - low).max()) / size, 1.6)
    return phone


def _draw_table(rng: np.random.Generator) -> Panel:
    half = (FLOOR, FLOOR) if rng.random() < FLOORS else tuple(np.exp(rng.uniform(*np.log(TABLE), 2)))
    matrix = np.eye(4)
    turned = rotation_y(rng.uniform(0, 2 * np.pi)) @ rotation_x(-np.pi / 2)
    matrix[:3, :3] = turned @ np.diag([*half, 1.0])
    matrix[1, 3] = -1e-3
    return Panel(world_from_panel=matrix, half=half, cover=draw_cover(rng))


def _draw_wall(rng: np.random.Generator, toward: np.ndarray) -> Panel:
    """Behind the object as the camera (towards which it is, [3]) sees it, turned a little."""
    front = rotation_y(rng.uniform(-0.5, 0.5)) @ toward
    half = (float(rng.uniform(8, 20)), 8.0)
    across = np.cross([0.0, 1.0, 0.0], front)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([across * half[0], np.array([0, half[1], 0]), front], axis=1)
    matrix[:3, 3] = -front * rng.uniform(2.0, 7.0) + [0.0, half[1] - 0.5, 0.0]
    return Panel(world_from_panel=matrix, half=half, cover=draw_cover(rng, "plain" if rng.random() < 0.7 else None))


def _draw_second(rng: np.random.Generator, store: AssetStore, toward: np.ndarray, first: Mesh) -> Thing:
    """Another object beside or behind the first, clear of it."""
    keys = sorted(store.shapes)
    mesh = _standing(store.shapes[keys[rng.integers(len(keys))]].mesh, rng)
    size = float(rng.uniform(0.5, 1.1))
    reach = np.linalg.norm(first.positions[:, [0, 2]], axis=1).max() + size + rng.uniform(0.1, 1.5)
    angle = rng.uniform(np.pi / 2, np.pi) * rng.choice([-1, 1])
    place = rotation_y(angle) @ toward * reach
    kind = int(distributions.draw_kinds(rng, 1)[0])
    material = distributions.draw_one(rng, kind, float(distributions.draw_alphas(rng, np.array([kind]))[0]))
    return Thing(mesh=replace(mesh, positions=(mesh.positions * size + place).astype(np.float32)), material=material)

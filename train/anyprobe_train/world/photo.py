"""One photo of a scene: the object lit and seen, the picture around it, the camera, the mask, and what is true."""

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.textured import lay
from anyprobe_train.world.kernels import light_panels
from anyprobe_train.world.layout import Layout, Standing, build_scene
from anyprobe_train.world.maps import Maps
from anyprobe_train.world.scene import BODY, BODY_SIZE, EYE, GLOW, SKY_ROWS, TEXELS, TracedScene
from anyprobe_train.world.shading import cell_of, received, seen_along, shade_object
from anyprobe_train.world.views import COARSE, SEEN_PX, VIEW_AZIMUTHS, VIEW_RINGS, cell_middles, view_points
from anyprobe_train.world.windows import Window, warped

SQUARE_PX = 96
"""Side of the context and of the crop."""
FOV_DEG, COMMON_DEG, COMMON = (15.0, 80.0), (45.0, 76.0), 0.65
"""Field of view of the longer side, even in its tangent; and in a share of the photos that of phones' main cameras."""
ASPECTS = (1.0, 4 / 3, 3 / 2, 16 / 9)
OBJECT_SHARE = (0.1, 1.0)
"""Bounds of the object's longer side over the photo's shorter one."""
OFF_CENTER, ROLL_DEG, STRONG_ROLL_DEG = 0.09, 2.0, 12.0
CELL_ROWS = 16
RAYS = 3
"""Rays to a source from each point of the object."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Frame:
    """A photo's camera: world_from_camera [3, 3], tangents of half its width and height, up [3] in its frame."""

    camera: np.ndarray
    tangents: tuple[float, float]
    roll_deg: float

    @property
    def most(self) -> float:
        """Tangent of half the longer side."""
        return max(self.tangents)

    @property
    def square(self) -> Window:
        """The window of the context: the least square around the photo."""
        return -self.most, self.most, self.most, -self.most

    @property
    def up(self) -> np.ndarray:
        """Up in the camera's frame."""
        return self.camera.T @ [0.0, 1.0, 0.0]


@dataclass(frozen=True, kw_only=True, slots=True)
class Seen:
    """The object as a view shows it, in the scene's units.

    radiance: [SEEN_PX, SEEN_PX, 3]; cover: [SEEN_PX, SEEN_PX] in [0, 1]; camera, tangent: of the view, as the photo's
    eye sees it.
    """

    radiance: np.ndarray
    cover: np.ndarray
    camera: np.ndarray
    tangent: float


def draw_photo_frame(rng: np.random.Generator, view: np.void) -> Frame:
    """Draw a photo around the object of a view, seen from the view's eye."""
    own, aspect, portrait = float(view["tangent"]), ASPECTS[rng.integers(len(ASPECTS))], rng.random() < 0.45
    low, high = np.tan(np.radians(FOV_DEG) / 2)
    for _ in range(30):
        most = float(own / np.exp(rng.uniform(*np.log(OBJECT_SHARE))) * aspect)
        common = COMMON_DEG[0] < 2 * np.degrees(np.arctan(most)) < COMMON_DEG[1]
        if low < most < high and rng.random() < (1.0 if common else 1 - COMMON):
            break
    most = float(np.clip(most, max(low, own * 1.02), max(high, own * 1.02)))
    tangents = (most / aspect, most) if portrait else (most, most / aspect)
    roll = float(rng.normal(0.0, STRONG_ROLL_DEG if rng.random() < 0.08 else ROLL_DEG))
    room = np.maximum(np.array(tangents) - own * rng.choice([1.0, 1.0, 1.0, 0.7]), 0.0)
    at = np.clip(rng.normal(0.0, 2 * OFF_CENTER * min(tangents), 2), -room, room)
    if rng.random() < 0.15:  # anywhere
        at = room * rng.uniform(-1, 1, 2)
    return Frame(camera=aimed(-view["camera"][:, 2], at, roll), tangents=tangents, roll_deg=roll)


def aimed(direction: np.ndarray, at: np.ndarray, roll_deg: float) -> np.ndarray:
    """Return world_from_camera [3, 3] of a camera rolled so much that shows a direction at tangents `at` [2]."""
    turn = rotation_z(np.radians(roll_deg))
    x, y, z = turn @ (np.array([*at, -1.0]) / math.sqrt(1 + at @ at))
    height = math.hypot(y, z)
    pitch = math.asin(min(max(float(direction[1]) / height, -1.0), 1.0)) - math.atan2(y, -z)
    level = rotation_x(pitch) @ [x, y, z]
    yaw = math.atan2(-direction[0], -direction[2]) - math.atan2(-level[0], -level[2])
    return rotation_y(yaw) @ rotation_x(pitch) @ turn


def pick_material(rng: np.random.Generator) -> tuple[Material, bool]:
    """Draw a material, and whether it is metal."""
    (kind,) = distributions.draw_kinds(rng, 1).tolist()
    alpha = float(distributions.draw_alphas(rng, np.array([kind]))[0])
    return distributions.draw_one(rng, kind, alpha), kind == 0


def painted(
    rng: np.random.Generator, maps: Maps, material: Material, points: np.ndarray, normals: np.ndarray, share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return albedo and f0 [N, 3] at points of an object; a share of them has a texture."""
    albedo, f0 = (np.tile(np.asarray(one, np.float32), (len(points), 1)) for one in (material.albedo, material.f0))
    if rng.random() < share and len(points):
        picture = np.asarray(maps.covers["albedo"][int(rng.integers(len(maps.covers["albedo"])))])
        factor = lay(picture / picture.mean(axis=(0, 1)), points, normals, rng) ** float(rng.uniform(0.4, 1.6))
        factor /= np.maximum(factor.mean(axis=0), 1e-6)
        albedo, f0 = np.clip(albedo * factor, 0.0, 0.92), np.where(f0 > 0.2, np.clip(f0 * factor**0.3, 0.2, 1.0), f0)
    return albedo.astype(np.float32), f0.astype(np.float32)


def see_object(
    scene: TracedScene,
    standing: Standing,
    surface: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    material: Material,
    colors: tuple[np.ndarray, np.ndarray],
    seed: int,
) -> Seen:
    """Shade body 0 of the scene as its view shows it, and keep its mean radiance as its glow. surface: of
    standing_points; colors: albedo and f0 [N, 3] there."""
    view = standing.view
    rows, columns, points, normals = surface
    directions, weights = _turned_cells(standing.turn)
    center = standing.place + [0.0, standing.scale * float(view["top"]) / 2, 0.0]
    numbers, places, _, texels = scene
    start = places[TEXELS] + 8 * (places[SKY_ROWS] ** 2 - CELL_ROWS**2) // 3
    sky = weights @ texels[start : start + 2 * CELL_ROWS**2]
    seen = seen_along(numbers, places, texels, directions, tuple(center), sky)
    half = SEEN_PX // COARSE
    place, first, which = np.unique((rows // half) * COARSE + columns // half, return_index=True, return_inverse=True)
    ratio = np.zeros((len(first), 3), np.float32)
    bits = view["hidden"].reshape(-1, 2)[place]
    received(*scene, points[first], normals[first], bits, directions, sky, seen, ratio)
    soft = np.maximum(normals @ directions.T, 0.0) @ seen * np.float32(4 * np.pi / len(directions))
    soft *= _between(ratio, place, rows, columns)
    radiance = np.zeros((len(points), 3), np.float32)
    samples = math.ceil((8 if material.f0.max() > 0.2 else 4) * min(max(material.alpha / 0.2, 0.25), 1.0))
    near = _near(bits, standing.turn)
    shade_object(*scene, points, normals, soft, *colors, material.alpha, samples, RAYS, near, which, seed, radiance)
    shown = np.zeros((SEEN_PX, SEEN_PX, 3), np.float32)
    shown[rows, columns] = radiance
    cover = view["cover"].astype(np.float32) / 255
    glow = places[BODY] + GLOW
    numbers[glow : glow + 3] = (shown * cover[..., None]).sum(axis=(0, 1)) / max(float(cover.sum()), 1e-6)
    camera, tangent = view["camera"].astype(np.float64), float(view["tangent"])
    if standing.place.any():  # seen from the photo's eye as its own camera saw it
        toward = center - scene.numbers[EYE : EYE + 3]
        away = float(np.linalg.norm(toward))
        camera = aimed(toward / away, np.zeros(2), 0.0)
        own = float(np.linalg.norm(view["eye"] - [0.0, float(view["top"]) / 2, 0.0]))
        tangent *= own * standing.scale / away
    return Seen(radiance=shown, cover=cover, camera=camera, tangent=tangent)


def _near(bits: np.ndarray, turn: float) -> np.ndarray:
    """Return whether each cell of the world or one beside it is among bits [N, 2] uint64 of a turned object's, [N,
    cells]."""
    each = (bits[:, :, None] >> np.arange(64, dtype=np.uint64)) & np.uint64(1)
    hidden = each.reshape(-1, VIEW_RINGS, VIEW_AZIMUTHS) > 0
    hidden[:, [0, -1]] = hidden[:, [0, -1]].any(axis=2, keepdims=True)  # about a pole all are beside each other
    hidden = hidden | np.roll(hidden, 1, axis=2) | np.roll(hidden, -1, axis=2)
    near = hidden.copy()
    near[:, 1:] |= hidden[:, :-1]
    near[:, :-1] |= hidden[:, 1:]
    return np.roll(near, -_azimuths(turn), axis=2).reshape(len(bits), -1)


def _azimuths(turn: float) -> int:
    """Return the whole number of cells that is nearest to a turn about +Y."""
    return round(turn * VIEW_AZIMUTHS / (2 * np.pi))


def standing_points(standing: Standing) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return `view_points` of an object where it stands."""
    rows, columns, points, normals = view_points(standing.view)
    turn = rotation_y(standing.turn).T.astype(np.float32)
    place = standing.place.astype(np.float32)
    return rows, columns, standing.scale * (points @ turn) + place, normals @ turn


def see_other(scene: TracedScene, layout: Layout, number: int, rng: np.random.Generator) -> Seen:
    """Shade body `number` of a scene, one of the others, of a drawn material; the scene keeps its mean radiance."""
    numbers, (_, count, *_), begin = scene.numbers.copy(), scene.places, scene.places[BODY]
    order = np.arange(count)
    order[[0, number]] = order[[number, 0]]
    bodies = numbers[begin : begin + count * BODY_SIZE].reshape(count, BODY_SIZE)
    bodies[:] = bodies[order]
    first = scene._replace(numbers=numbers, words=np.ascontiguousarray(scene.words[order]))
    material, _ = pick_material(rng)
    standing = layout.others[number - (count - len(layout.others))]
    surface = standing_points(standing)
    shape = len(surface[0]), 1
    colors = tuple(np.tile(np.asarray(one, np.float32), shape) for one in (material.albedo, material.f0))
    seen = see_object(first, standing, surface, material, colors, int(rng.integers(2**31)))
    glow = begin + number * BODY_SIZE + GLOW
    scene.numbers[glow : glow + 3] = bodies[0, GLOW : GLOW + 3]
    return seen


def _turned_cells(turn: float) -> tuple[np.ndarray, np.ndarray]:
    """Return middles and weights of an object's own cells in the world, to the nearest azimuth of its turn."""
    of_rings = (one.reshape(VIEW_RINGS, VIEW_AZIMUTHS, -1) for one in (cell_middles(), _cell_weights()))
    middles, weights = (np.roll(one, _azimuths(turn), axis=1).reshape(-1, one.shape[2]) for one in of_rings)
    return middles, weights


@lru_cache(maxsize=1)
def _cell_weights() -> np.ndarray:
    """Return the weights of a map's pixels in the mean over each cell, [cells, CELL_ROWS * 2 CELL_ROWS] float32."""
    times = 8
    d = pixel_directions(CELL_ROWS * times)
    weights = np.zeros((VIEW_RINGS * VIEW_AZIMUTHS, CELL_ROWS * 2 * CELL_ROWS), np.float64)
    row, column = (one // times for one in np.mgrid[: CELL_ROWS * times, : 2 * CELL_ROWS * times])
    solid = np.broadcast_to(pixel_solid_angles(CELL_ROWS * times), row.shape)
    np.add.at(
        weights,
        (np.array([cell_of(tuple(one)) for one in d.reshape(-1, 3)]), (row * 2 * CELL_ROWS + column).ravel()),
        solid.ravel(),
    )
    return (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)


def _between(ratio: np.ndarray, place: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return values [K, 3] of coarse pixels `place` between these, at pixels of the view [N]."""
    known = np.zeros((COARSE * COARSE, 4), np.float32)
    known[place] = np.column_stack([ratio, np.ones(len(ratio), np.float32)])
    total = cv2.resize(known.reshape(COARSE, COARSE, 4), (SEEN_PX, SEEN_PX))[rows, columns]
    return total[:, :3] / np.maximum(total[:, 3:], 1e-6)


def over_window(values: np.ndarray, seen: Seen, frame: Frame, window: Window, size: int) -> np.ndarray:
    """Return values [SEEN_PX, SEEN_PX, C] of an object's view over a window of the photo's plane, [size, size, C], zero
    beyond the view."""
    low, high = plane_box(seen, frame)
    at = np.array([window[0], window[2]])
    step = np.array([window[1] - window[0], window[3] - window[2]]) / size
    ends = (np.array([[low[0], high[1]], [high[0], low[1]]]) - at) / step
    (left, first), (right, last) = (np.clip(one, 0, size).astype(int) for one in (ends[0] - 1, ends[1] + 2))
    out = np.zeros((size, size, values.shape[2]), np.float32)
    if left < right and first < last:
        samples = int(np.clip(np.ceil(step[0] / (2 * seen.tangent / SEEN_PX)), 1, 6))
        ray = np.array([[step[0], 0, at[0] + left * step[0]], [0, step[1], at[1] + first * step[1]], [0, 0, -1.0]])
        half = SEEN_PX / 2
        pixel = np.array([[half / seen.tangent, 0, -half], [0, -half / seen.tangent, -half], [0, 0, -1.0]])
        matrix = pixel @ seen.camera.T @ frame.camera @ ray
        out[first:last, left:right] = warped(values, matrix, last - first, right - left, samples, cv2.BORDER_CONSTANT)
    return out


def plane_box(seen: Seen, frame: Frame) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest x, y [2] of a view on the photo's plane."""
    side = (-1.0, 0.0, 1.0)
    corners = np.array([(x, y, -1.0) for x in side for y in side]) * [seen.tangent, seen.tangent, 1.0]
    d = corners @ (seen.camera.T @ frame.camera)
    plane = d[:, :2] / np.maximum(-d[:, 2:], 1e-2)
    return plane.min(axis=0), plane.max(axis=0)


def object_over(seen: Seen, frame: Frame, window: Window, size: int) -> np.ndarray:
    """Return premultiplied radiance and cover of the object over a window of the photo's plane, [size, size, 4]."""
    covered = np.dstack([seen.radiance * seen.cover[..., None], seen.cover])
    return over_window(covered, seen, frame, window, size)


def share_in_photo(frame: Frame, window: Window, size: int = SQUARE_PX) -> np.ndarray:
    """Return the share of each pixel of a window that lies in the photo, [size, size]."""

    def along(first: float, last: float, most: float) -> np.ndarray:
        edges = np.linspace(first, last, size + 1)
        low, high = np.minimum(edges[:-1], edges[1:]), np.maximum(edges[:-1], edges[1:])
        return np.clip((np.minimum(high, most) - np.maximum(low, -most)) / (high - low), 0.0, 1.0)

    x, y = along(*window[:2], frame.tangents[0]), along(*window[2:], frame.tangents[1])
    return (y[:, None] * x[None]).astype(np.float32)


def lit_scene(view: np.void | None, eye: np.ndarray, layout: Layout, material: Material, seed: int) -> TracedScene:
    """Return a layout's arrays with the light on its panels; material: of the object, for its glow, in which coats
    mirror no sources: few of its points show them."""
    full, rest = (part[-128:].mean(axis=0) for part in np.split(layout.light.sky, 2))
    glow = 0.5 * (material.f0 * rest + (1 - material.f0) * material.albedo * full)
    scene = build_scene(view, eye, layout, glow)
    light_panels(*scene, seed)
    return scene

"""Rooms: a box of diffuse walls lit by windows, light fixtures and the sun, with the light between the walls.

The walls are cut into patches; exact form factors carry light between them (Cohen and Wallace,
"Radiosity and Realistic Image Synthesis", 1993, chapter 4):

    L = e + rho F e + rho F rho F e + ...

A wall is 2 axis + side: x-, x+, y- (floor), y+ (ceiling), z-, z+.
Radiance is in kcd/m^2 as in anyprobe_train.dataset.sky, which is what the windows show.
"""

from dataclasses import dataclass
from functools import reduce

import numpy as np

from anyprobe.core.frames import rotation_y
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe_train.dataset.catalog import normalize_map
from anyprobe_train.dataset.sky import Day, draw_day, tint

_PATCHES = 12
"""Patches along each side of each wall: 864 in all."""

WARM = np.array([1.15, 1.0, 0.75])
WOOD = np.array([1.3, 1.0, 0.65])

BOUNCES = 4
"""Number of bounces of light; the first is the direct light."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Rectangle:
    """Rectangle on a wall: centre [2] and half size [2] in metres, along the wall's two axes in ascending order."""

    wall: int
    centre: np.ndarray
    extent: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Points:
    """Points on walls: wall [N], position [N, 3], and side [N, 2] of the square that each stands for."""

    wall: np.ndarray
    position: np.ndarray
    side: np.ndarray


def _along(wall: int) -> tuple[int, int]:
    """Return the two axes that a wall runs along."""
    return [(1, 2), (0, 2), (0, 1)][wall // 2]


def _corner_sum(g: np.ndarray) -> np.ndarray:
    """Sum a function over the corners of every pair of rectangles with alternating signs, [n, n, n, n]."""
    return reduce(lambda array, axis: np.diff(array, axis=axis), range(4), g)


def _parallel(a: np.ndarray, b: np.ndarray, gap: float) -> np.ndarray:
    """Return a F of every pair of rectangles of two equal facing grids with lines a and b, [n, n, n, n].

    Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", C-13.
    """
    x = a[:, None, None, None] - a[None, None, :, None]
    y = b[None, :, None, None] - b[None, None, None, :]
    u, v = np.sqrt(x * x + gap * gap), np.sqrt(y * y + gap * gap)
    g = y * u * np.arctan(y / u) + x * v * np.arctan(x / v) - gap * gap / 2 * np.log(u * u + y * y)
    return _corner_sum(g) / (2 * np.pi)


def _perpendicular(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    """Return a F of pairs of rectangles on two walls that share an edge: a and c are the lines' distances from
    it on the one and the other, b the lines across it. [n(a), n(b), n(c), n(b)]; Howell's C-17.
    """
    x, z = a[:, None, None, None], c[None, None, :, None]
    y = b[None, :, None, None] - b[None, None, None, :]
    s = x * x + z * z
    root = np.sqrt(s)
    with np.errstate(divide="ignore", invalid="ignore"):
        bend = y * root * np.arctan(np.where(s > 0, y / root, 0.0))
        log = np.where(s + y * y > 0, (s - y * y) * np.log(s + y * y), 0.0)
    return _corner_sum(bend - log / 4) / (2 * np.pi)


def form_factors(half: np.ndarray, patches: int = _PATCHES) -> np.ndarray:
    """Compute F [6 n^2, 6 n^2] of a box with half sizes [3]: F_ij is the share of i's light that reaches j.

    Patches go wall by wall, in each by the first of its axes, then the second.
    """
    n = patches
    lines = [np.linspace(-h, h, n + 1) for h in half]
    exchange = np.zeros((6, n, n, 6, n, n))  # A_i F_ij, symmetric
    for wall in range(6):
        for other_wall in range(wall + 1, 6):
            p, q = wall // 2, other_wall // 2
            if p == q:
                u, v = _along(wall)
                block = _parallel(lines[u], lines[v], 2 * half[p])
            else:
                shared = 3 - p - q
                here = np.abs(lines[q] - half[q] * (2 * (other_wall % 2) - 1))
                there = np.abs(lines[p] - half[p] * (2 * (wall % 2) - 1))
                block = np.abs(_perpendicular(here, lines[shared], there))
                if shared < q:  # to the order of this wall's axes, then of the other's
                    block = block.swapaxes(0, 1)
                if shared < p:
                    block = block.swapaxes(2, 3)
            exchange[wall, :, :, other_wall] = block
            exchange[other_wall, :, :, wall] = block.transpose(2, 3, 0, 1)
    areas = patch_areas(half, n)
    return exchange.reshape(len(areas), len(areas)) / areas[:, None]


def patch_areas(half: np.ndarray, patches: int = _PATCHES) -> np.ndarray:
    """Compute the area of every patch, [6 n^2], in form_factors' order."""
    sides = [4 * half[u] * half[v] / patches**2 for u, v in map(_along, range(6))]
    return np.repeat(sides, patches**2)


def patch_points(half: np.ndarray, patches: int = _PATCHES) -> Points:
    """Return the middles of all patches, in form_factors' order."""
    middle = (np.arange(patches) + 0.5) / patches * 2 - 1
    position, side = np.empty((6, patches, patches, 3)), np.empty((6, patches, patches, 2))
    for wall in range(6):
        u, v = _along(wall)
        position[wall, ..., wall // 2] = half[wall // 2] * (2 * (wall % 2) - 1)
        position[wall, ..., u], position[wall, ..., v] = np.meshgrid(middle * half[u], middle * half[v], indexing="ij")
        side[wall] = 2 * half[[u, v]] / patches
    walls = np.repeat(np.arange(6), patches**2)
    return Points(wall=walls, position=position.reshape(-1, 3), side=side.reshape(-1, 2))


def seen_points(half: np.ndarray, eye: np.ndarray, d: np.ndarray, texel: float) -> Points:
    """Return the points that an eye inside the box sees along directions d [N, 3]; texel: its width [radians]."""
    with np.errstate(divide="ignore"):
        t = np.where(d > 0, (half - eye) / d, (-half - eye) / d)
    axis = np.argmin(t, axis=-1)
    distance = np.take_along_axis(t, axis[:, None], axis=-1)
    wall = axis * 2 + (np.take_along_axis(d, axis[:, None], axis=-1)[:, 0] > 0)
    return Points(wall=wall, position=eye + d * distance, side=np.repeat(distance * texel, 2, axis=1))


def reflected(factors: np.ndarray, albedo: np.ndarray, source: np.ndarray, bounces: int = BOUNCES) -> np.ndarray:
    """Compute the radiance [K, 3] that patches of albedo [K, 3] send back under source [K, 3].

    back_k = albedo F back_(k-1) from back_0 = source; the sum over k = 1 .. bounces.
    """
    total, back = np.zeros_like(source), source
    for _ in range(bounces):
        back = albedo * (factors @ back)
        total = total + back
    return total


def coverage(rectangle: Rectangle, xy: np.ndarray, side: np.ndarray) -> np.ndarray:
    """Return the share of each square (middle xy [N, 2], side [N, 2]) that the rectangle covers, [N, 1]."""
    low = np.maximum(xy - side / 2, rectangle.centre - rectangle.extent)
    high = np.minimum(xy + side / 2, rectangle.centre + rectangle.extent)
    return np.clip((high - low) / side, 0.0, 1.0).prod(axis=-1, keepdims=True)


def paint_rectangle(color: np.ndarray, rectangle: Rectangle, value: np.ndarray, points: Points) -> np.ndarray:
    """Lay a rectangle over the points' color [N, 3]; value [3], or one for each point [N, 3]."""
    here = np.flatnonzero(points.wall == rectangle.wall)
    share = coverage(rectangle, points.position[here][:, _along(rectangle.wall)], points.side[here])
    laid = color.copy()
    laid[here] += share * (np.broadcast_to(value, color.shape)[here] - color[here])
    return laid


def sunlit(points: Points, half: np.ndarray, window: Rectangle, sun: np.ndarray) -> np.ndarray:
    """Compute the cosine of the sun on each point, times the share of it that comes through the window, [N, 1]."""
    axis, sign = window.wall // 2, 2 * (window.wall % 2) - 1
    outward = sign * sun[axis]
    if outward <= 1e-3:
        return np.zeros((len(points.wall), 1))
    inside = np.eye(3)[points.wall // 2] * (1 - 2 * (points.wall % 2))[:, None]
    cosine = np.maximum(inside @ sun, 0.0)[:, None]
    t = (sign * half[axis] - points.position[:, axis]) / sun[axis]
    through = points.position + t[:, None] * sun
    side = points.side + 0.0093 * t[:, None]  # the sun is 0.53 degrees wide
    return cosine * coverage(window, through[:, _along(window.wall)], side)


def _spot(rng: np.random.Generator, half: np.ndarray, wall: int, size: np.ndarray) -> Rectangle:
    """Return a rectangle of the given half size [2] somewhere on a wall, cut down to fit it."""
    room = half[list(_along(wall))]
    extent = np.minimum(size, 0.9 * room)
    return Rectangle(wall=wall, centre=rng.uniform(-1, 1, size=2) * (0.95 * room - extent), extent=extent)


def _bars(window: Rectangle, rng: np.random.Generator) -> list[Rectangle]:
    """Return the crossbars of a window."""
    found = []
    for k in range(2):
        for at in np.linspace(-1, 1, rng.integers(2, 5))[1:-1]:
            centre, extent = window.centre.copy(), window.extent.copy()
            centre[k] += at * window.extent[k]
            extent[k] = 0.03
            found.append(Rectangle(wall=window.wall, centre=centre, extent=extent))
    return found


def _behind_window(day: Day, wall: int, turn: np.ndarray) -> np.ndarray:
    """Return the mean radiance [3] that comes in through a wall's window, without the sun's beam."""
    height = day.radiance.shape[0]
    outward = turn @ (np.eye(3)[wall // 2] * (2 * (wall % 2) - 1))
    cosine = np.maximum(pixel_directions(height) @ outward, 0.0) * pixel_solid_angles(height)
    return np.einsum("hwc,hw->c", day.radiance, cosine) / np.pi


def room(rng: np.random.Generator, height: int = 256) -> np.ndarray:
    """Render the inside of a box with furniture, pictures, windows and light fixtures; mean luminance 1."""
    half = rng.uniform([1.5, 1.15, 1.5], [5.0, 1.9, 5.0])
    eye = rng.uniform(-0.5, 0.5, size=3) * half * np.array([1, 0.6, 1])
    turn = rotation_y(rng.uniform(0, 2 * np.pi))  # the map's frame from the walls'
    d = pixel_directions(height).astype(np.float64).reshape(-1, 3)
    seen = seen_points(half, eye, d @ turn, np.pi / height)
    patches = patch_points(half)
    day = draw_day(rng, 128)
    dim = 1.0 if rng.random() < 0.7 else np.exp(rng.uniform(np.log(1e-4), np.log(1e-2)))
    sun, beam = day.sun @ turn, day.beam * dim * 0.8
    view = bilinear((day.radiance + day.disc) * dim * 0.8, direction_to_uv(d))

    walls = np.tile(rng.uniform(0.3, 0.85) * WARM ** rng.uniform(-0.3, 1.0) * tint(rng, 0.06), (6, 1))
    walls *= np.where(rng.random((6, 1)) < 0.25, rng.uniform(0.3, 1.1, size=(6, 1)) * tint(rng, 0.3), 1.0)
    walls[2] = rng.uniform(0.08, 0.45) * WOOD ** rng.uniform(0.0, 1.5) * tint(rng, 0.1)
    walls[3] = rng.uniform(0.6, 0.85)
    walls = np.clip(walls, 0.02, 0.9)
    look = {"seen": [seen, walls[seen.wall]], "patches": [patches, walls[patches.wall]]}
    glow = {name: np.zeros_like(color) for name, (_, color) in look.items()}
    sunny = {name: np.zeros((len(points.wall), 1)) for name, (points, _) in look.items()}

    def lay(rectangle, albedo, emission, emission_seen=None):
        for name, (points, color) in look.items():
            look[name][1] = paint_rectangle(color, rectangle, albedo, points)
            value = emission if name == "patches" or emission_seen is None else emission_seen
            glow[name] = paint_rectangle(glow[name], rectangle, value, points)

    for _ in range(rng.integers(5, 18)):  # furniture, pictures, doors, carpets
        where = rng.choice([0, 1, 2, 4, 5])
        spot = _spot(rng, half, where, np.exp(rng.uniform(np.log(0.12), np.log(1.2), size=2)))
        lay(spot, rng.uniform(0.03, 0.85) * np.minimum(tint(rng, 0.4), 1.15), 0.0)
    windows = rng.integers(0, 4)
    for _ in range(windows):
        where = rng.choice([0, 1, 4, 5])
        window = _spot(rng, half, where, rng.uniform(0.4, [1.6, 1.0] if where < 2 else [1.0, 1.6])[::-1])
        mean = _behind_window(day, where, turn) * dim * 0.8
        if rng.random() < 0.25:  # curtains
            lay(window, 0.5, mean * rng.uniform(0.15, 0.5) * tint(rng, 0.15))
            continue
        lay(window, 0.05, mean, view)
        for name, (points, _) in look.items():
            sunny[name] = sunny[name] + sunlit(points, half, window, sun)
        for bar in _bars(window, rng):
            lay(bar, 0.6, 0.0)
    warm = WARM ** rng.uniform(0.0, 2.5)
    for _ in range(rng.integers(0 if windows and dim == 1.0 else 1, 6)):
        where = rng.choice([3, 3, 3, 0, 1, 4, 5])
        small = rng.random() < 0.4
        size = rng.uniform(0.05, 0.12) if small else rng.uniform(0.15, 0.6)
        power = np.exp(rng.uniform(np.log(30.0), np.log(200.0)) if small else rng.uniform(0.7, 3.2))
        lay(_spot(rng, half, where, size * rng.uniform(0.5, 1.0, size=2)), 0.5, power * warm * tint(rng, 0.05))

    albedo, source = look["patches"][1], glow["patches"]
    source = source + albedo * sunny["patches"] * beam / np.pi
    factors = form_factors(half)
    falling = factors @ (source + reflected(factors, albedo, source, BOUNCES - 1))  # E / pi on each patch
    onto = between_patches(falling, half, seen) + sunny["seen"] * beam / np.pi
    radiance = glow["seen"] + look["seen"][1] * onto
    balance = (onto.mean() / onto.mean(axis=0)) ** rng.uniform(0.3, 1.0)  # the camera's white
    return normalize_map((radiance * balance).reshape(height, 2 * height, 3))


def between_patches(values: np.ndarray, half: np.ndarray, points: Points) -> np.ndarray:
    """Interpolate values [6 n^2, C] of the patches at points, bilinearly on each wall."""
    grid = values.reshape(6, _PATCHES, _PATCHES, -1)
    along = np.array([_along(wall) for wall in range(6)])[points.wall]
    xy = np.take_along_axis(points.position, along, axis=1) / half[along]
    xy = np.clip((xy + 1) / 2 * _PATCHES - 0.5, 0.0, _PATCHES - 1.0)
    low = np.minimum(xy.astype(np.int64), _PATCHES - 2)
    x, y = np.moveaxis(xy - low, 1, 0)[..., None]
    i, j = low.T
    near = grid[points.wall, i, j] * (1 - y) + grid[points.wall, i, j + 1] * y
    far = grid[points.wall, i + 1, j] * (1 - y) + grid[points.wall, i + 1, j + 1] * y
    return near * (1 - x) + far * x

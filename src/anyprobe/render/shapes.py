"""Procedural shapes: closed surfaces over a latitude-longitude grid.

Each function takes its randomness as an argument and returns a Mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np

from anyprobe.core.frames import normalize, rotation_x, rotation_y, rotation_z
from anyprobe.render.mesh import Mesh, make_mesh, put_together

GOLDEN = (1 + 5**0.5) / 2


def _grid_mesh(positions: np.ndarray, crease_deg: float, poles: np.ndarray | None = None) -> Mesh:
    """Close a [R, C, 3] grid (rows pole to pole, columns around +Y) into a mesh.

    poles: [2, 3]; by default the middles of the outer rows.
    """
    if poles is None:
        poles = np.stack([positions[0].mean(axis=0), positions[-1].mean(axis=0)])
    return make_mesh(*_closed(positions, poles), crease_deg=crease_deg)


def _sphere_grid(rows: int, columns: int) -> np.ndarray:
    theta = (np.arange(rows) + 0.5) * np.pi / rows
    phi = np.arange(columns) * 2 * np.pi / columns
    t, p = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], axis=-1)


def sphere(rows: int = 64) -> Mesh:
    """Return the unit sphere."""
    return _grid_mesh(_sphere_grid(rows, 2 * rows), crease_deg=180.0)


def superquadric(rng: np.random.Generator, rows: int = 56) -> Mesh:
    """Draw a solid between box, cylinder, sphere and octahedron (Barr 1981), stretched and turned about +Y."""
    d = _sphere_grid(rows, 2 * rows)
    east, north = rng.uniform(0.25, 1.6, size=2)
    t = np.arccos(np.clip(d[..., 1], -1, 1)) - np.pi / 2
    p = np.arctan2(d[..., 0], d[..., 2])

    def power(x, e):
        return np.sign(x) * np.abs(x) ** e

    x = power(np.cos(t), north) * power(np.sin(p), east)
    y = -power(np.sin(t), north)
    z = power(np.cos(t), north) * power(np.cos(p), east)
    stretch = np.exp(rng.uniform(-0.5, 0.5, size=3))
    return _grid_mesh(np.stack([x, y, z], -1) * stretch, crease_deg=45.0)


def blob(rng: np.random.Generator, rows: int = 64) -> Mesh:
    """Draw a sphere pushed in and out by a few smooth waves."""
    d = _sphere_grid(rows, 2 * rows)
    radius = np.ones(d.shape[:2])
    for _ in range(rng.integers(3, 9)):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        frequency = rng.uniform(1.0, 5.0)
        radius += rng.uniform(0.04, 0.2) / frequency**0.5 * np.sin(frequency * (d @ axis) + rng.uniform(0, 6.28))
    stretch = np.exp(rng.uniform(-0.3, 0.3, size=3))
    return _grid_mesh(d * np.maximum(radius, 0.25)[..., None] * stretch, crease_deg=180.0)


def lathe(rng: np.random.Generator, rows: int = 72) -> Mesh:
    """Draw a turned vase, bottle or chess piece: a smooth random profile about +Y."""
    knots = rng.integers(4, 8)
    profile = rng.uniform(0.2, 0.9, size=knots)
    s = np.linspace(0, 1, rows)
    smooth = np.interp(s, np.linspace(0, 1, knots), profile)
    kernel = np.hanning(max(5, int(rows // knots)))
    smooth = np.convolve(np.pad(smooth, rows, mode="edge"), kernel / kernel.sum(), mode="same")[rows:-rows]
    rounding = rng.uniform(0.02, 0.2)
    smooth = smooth * np.clip(np.minimum(s, 1 - s) / rounding, 0.0, 1.0) ** 0.5
    smooth = np.maximum(smooth, 0.01)
    height = rng.uniform(0.8, 2.6)
    phi = np.arange(2 * rows) * 2 * np.pi / (2 * rows)
    y = (0.5 - s) * height
    grid = np.stack(
        [smooth[:, None] * np.sin(phi), np.repeat(y[:, None], len(phi), axis=1), smooth[:, None] * np.cos(phi)], axis=-1
    )
    return _grid_mesh(grid, crease_deg=50.0)


def _solid(rng: np.random.Generator) -> np.ndarray:
    """Draw planes [K, 3] of a random solid around the origin as n / distance; inside, planes @ x <= 1."""
    cube = np.concatenate([np.eye(3), -np.eye(3)])
    corners = normalize(np.array(list(product((-1.0, 1.0), repeat=3))))
    sides = np.array([(0.0, a, b * GOLDEN) for a in (-1, 1) for b in (-1, 1)])
    dodecahedron = normalize(np.concatenate([np.roll(sides, k, axis=1) for k in range(3)]))
    kind = rng.integers(6)
    if kind == 0:  # a box, stretched
        planes = cube * np.exp(rng.uniform(-0.6, 0.6, size=(3, 1)))[[0, 1, 2, 0, 1, 2]]
    elif kind == 1:  # an octahedron, with its corners cut off or not
        planes = np.concatenate([corners, cube / rng.uniform(0.9, 1.8)])
    elif kind == 2:
        planes = dodecahedron
    elif kind == 3:  # a prism or a pyramid's stump over 3 to 8 sides
        count = int(rng.integers(3, 9))
        turn = np.arange(count) * 2 * np.pi / count
        side = np.stack([np.sin(turn), np.full(len(turn), rng.uniform(0.0, 0.6)), np.cos(turn)], axis=-1)
        planes = np.concatenate([normalize(side), cube[[1, 4]] / rng.uniform(0.6, 1.8)])
    else:  # a pebble of random cuts; the box keeps it closed
        cuts = normalize(rng.normal(size=(rng.integers(5, 20), 3)))
        planes = np.concatenate([cuts / rng.uniform(0.6, 1.0, size=(len(cuts), 1)), cube / 1.1])
    if kind < 4 and rng.random() < 0.4:  # a piece knocked off
        cuts = normalize(rng.normal(size=(rng.integers(1, 5), 3)))
        planes = np.concatenate([planes, cuts / rng.uniform(0.7, 1.0, size=(len(cuts), 1))])
    if rng.random() < 0.5:  # lying as it fell, else upright
        turned, upper = np.linalg.qr(rng.normal(size=(3, 3)))
        planes = planes @ (turned * np.sign(np.diag(upper)))
    return planes @ rotation_y(rng.uniform(0, 2 * np.pi))


def _gauge(planes: np.ndarray, x: np.ndarray, power: float) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate g(x) = (sum of max(m_k . x, 0)^p)^(1/p) over planes m [K, 3], and its gradient: [...], [..., 3].

    The largest m_k . x is 1 on the solid's faces; the p-norm in its place rounds the edges. g is
    homogeneous and convex: the solid g <= 1 is convex, its radius along d is 1 / g(d), and the
    gradient along d is its outward normal there.
    """
    height = np.maximum(x @ planes.T, 0.0)
    largest = height.max(axis=-1, keepdims=True)
    share = height / largest  # powers of numbers up to 1 do not overflow
    g = largest[..., 0] * (share**power).sum(axis=-1) ** (1 / power)
    return g, share ** (power - 1) @ planes


def rounded_polyhedron(rng: np.random.Generator, rows: int = 80) -> Mesh:
    """Draw a convex solid of flat faces (box, prism, platonic, random cuts) with rounded edges."""
    planes, power = _solid(rng), np.exp(rng.uniform(np.log(8.0), np.log(40.0)))
    d = _sphere_grid(rows, 2 * rows)
    poles = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    g, normals = _gauge(planes, np.concatenate([d.reshape(-1, 3), poles]), power)
    mesh = _grid_mesh(d / g[:-2].reshape(d.shape[:2])[..., None], 180.0, poles / g[-2:, None])
    return replace(mesh, normals=normalize(normals)[mesh.faces].astype(np.float32))


def figure(rng: np.random.Generator) -> Mesh:
    """Draw a creature, a statue or a toy: a body with pieces on its surface and pieces on theirs.

    The pieces are closed and overlap; parts inside another are never seen. Half of all figures are mirror-symmetric,
    as most such things are.
    """
    both_sides = rng.random() < 0.5
    sizes, centers = [np.exp(rng.uniform(-0.5, 0.3, size=3))], [np.zeros(3)]
    pieces = [_piece(rng, sizes[0], centers[0])]
    for _ in range(rng.integers(2, 8)):
        host = rng.integers(len(sizes)) if rng.random() < 0.4 else 0
        size = sizes[host].min() * rng.uniform(0.25, 0.8) * np.exp(rng.normal(0.0, 0.45, size=3))
        center = centers[host] + normalize(rng.normal(size=3)) * sizes[host] * rng.uniform(0.7, 1.1)
        sizes.append(size)
        centers.append(center)
        positions, faces = _piece(rng, size, center)
        pieces.append((positions, faces))
        if both_sides:
            pieces.append((positions * (-1.0, 1.0, 1.0), faces[:, ::-1]))
    return make_mesh(*put_together(pieces))


def _piece(rng: np.random.Generator, size: np.ndarray, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw a blob, superquadric or turned shape of half extents size [3], tilted at random: positions and faces."""
    mesh = [blob, superquadric, blob, lathe][rng.integers(4)](rng, rows=28)
    half = np.abs(mesh.positions).max(axis=0)
    x, y, z = rng.normal(0.0, 0.35, size=3)
    lean = rotation_x(x) @ rotation_y(y) @ rotation_z(z)
    return mesh.positions / half * size @ lean.T + center, mesh.faces


def draw_shape(rng: np.random.Generator) -> Mesh:
    """Draw a shape of one of the families above."""
    return [superquadric, blob, lathe, blob, rounded_polyhedron][rng.integers(5)](rng)


COLUMNS = 72
"""Directions around a piece's axis, besides those of its corners."""
CREASE_DEG = 30.0
"""Angle [degrees] of a crease: round walls turn by 5 from a column to the next, roundings by 23 from a row to the
next."""


def part(rng: np.random.Generator) -> Mesh:
    """Draw one to five pieces joined at right angles, some of them rings; parts inside another are never seen."""
    half, center = np.exp(rng.uniform(-0.6, 0.3, size=3)), np.zeros(3)
    hosts, pieces = [(half, center)], [_placed(rng, half, center)]
    for _ in range(rng.integers(0, 5)):
        host_half, host_center = hosts[rng.integers(len(hosts))]
        half = host_half * rng.uniform(0.25, 0.9, size=3)
        axis = rng.integers(3)
        offset = rng.uniform(-0.8, 0.8, size=3) * (rng.random(3) < 0.5)
        offset[axis] = rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.3)
        center = host_center + offset * host_half
        hosts.append((half, center))
        positions, faces = _placed(rng, half, center)
        copies = rng.integers(2, 7) if rng.random() < 0.3 else 1
        for k in range(copies):
            turn = rotation_y(2 * np.pi * k / copies)
            pieces.append((positions @ turn.T, faces))
    return make_mesh(*put_together(pieces), crease_deg=CREASE_DEG)


def _placed(rng: np.random.Generator, half: np.ndarray, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Draw a piece of half extents [3] around center, its axis along one of the three, sometimes askew."""
    positions, faces = extruded(rng)
    quarter = np.pi / 2
    turn = [np.eye(3), rotation_x(quarter), rotation_z(quarter)][rng.integers(3)]
    if rng.random() < 0.15:
        turn = rotation_x(rng.normal(0.0, 0.4)) @ rotation_z(rng.normal(0.0, 0.4)) @ turn
    positions = positions @ turn.T
    return positions / np.abs(positions).max(axis=0) * half + center, faces


def extruded(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Draw a closed piece along +Y: an extruded outline, with a hole or none; positions [V, 3] and faces [F, 3]."""
    outline, corners = _outline(rng)
    angles = [np.arange(COLUMNS) * 2 * np.pi / COLUMNS, corners]
    hole = None
    if rng.random() < 0.4:
        hole, more = _outline(rng)
        angles.append(more)
    phi = np.sort(np.concatenate(angles) % (2 * np.pi))
    phi = phi[np.diff(phi, append=phi[0] + 2 * np.pi) > 1e-3]
    circle = np.stack([np.sin(phi), np.zeros_like(phi), np.cos(phi)], axis=-1)
    rows = _profile(rng)
    outer = circle * outline(phi)[:, None]
    grid = rows[:, 1, None, None] * outer + rows[:, 0, None, None] * [0.0, 1.0, 0.0]
    if hole is None:
        return _closed(grid, np.stack([grid[0].mean(axis=0), grid[-1].mean(axis=0)]) * [0, 1, 0])
    inner = circle * (hole(phi) * rng.uniform(0.3, 0.85))[:, None]
    wall = (np.linalg.norm(outer, axis=1) / np.linalg.norm(inner, axis=1)).min()
    inner *= min(1.0, 0.9 * rows[[0, -1], 1].min() * wall)
    ends = inner + rows[[-1, 0], 0][:, None, None] * [0.0, 1.0, 0.0]
    return _ring(np.concatenate([grid, ends]))


def _outline(rng: np.random.Generator) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """Draw a star-shaped outline around the origin: radius by angle from +Z towards +X, and its corners' angles."""
    kind = rng.integers(5)
    if kind == 0:
        return (lambda phi: np.ones_like(phi)), np.zeros(0)
    if kind == 1:  # a gear or a flower's: teeth with flat tops
        teeth, depth = rng.integers(3, 13), rng.uniform(0.6, 0.92)
        edges = (np.arange(2 * teeth) + 0.5) * np.pi / teeth
        corners = np.concatenate([edges - 2e-3, edges + 2e-3])
        return (lambda phi: np.where(np.cos(teeth * phi) > 0, 1.0, depth)), corners
    if kind == 2:  # a regular polygon
        sides, turn = rng.integers(3, 9), rng.uniform(0, 2 * np.pi)
        boxes = [(np.arange(sides) * 2 * np.pi / sides + turn, np.ones(sides))]
    else:  # a rectangle, or two or three that overlap: an L, a T, a cross
        boxes = []
        for _ in range(1 if kind == 3 else rng.integers(2, 4)):
            boxes.append((np.arange(4) * np.pi / 2, rng.uniform(0.15, 1.0, size=4)))
    return (lambda phi: np.max([_radius(phi, *box) for box in boxes], axis=0)), _corners(boxes)


def _radius(phi: np.ndarray, sides: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """Return the radius at angles phi of a convex polygon with sides facing `sides` at `distances`."""
    toward = np.cos(phi[:, None] - sides) / distances
    return 1 / np.maximum(toward.max(axis=1), 1e-6)


def _corners(boxes: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Return the angles of corners in the outline of a union of polygons: their own, and where two outlines cross."""
    phi = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    side = np.stack([np.cos(phi[:, None] - sides) / distances for sides, distances in boxes])  # [B, P, K]
    radius = 1 / side.max(axis=2)
    which = radius.argmax(axis=0)
    of = which * 100 + side.argmax(axis=2)[which, np.arange(len(phi))]
    changes = np.nonzero(of != np.roll(of, -1))[0]
    step = phi[1]
    return np.concatenate([phi[changes], phi[changes] + step])


def _profile(rng: np.random.Generator) -> np.ndarray:
    """Draw rows of (height, scale) from top to bottom: straight, tapered, bevelled, rounded or domed."""
    kind = rng.integers(5)
    if kind == 0:
        return np.array([(1.0, 1.0), (-1.0, 1.0)])
    if kind == 1:
        return np.array([(1.0, rng.uniform(0.3, 1.0)), (-1.0, 1.0)])
    edge = rng.uniform(0.05, 0.4)
    if kind == 2:
        return np.array([(1.0, 1 - edge), (1 - edge, 1.0), (-1 + edge, 1.0), (-1.0, 1 - edge)])
    turn = np.linspace(0, np.pi / 2, 5)
    if kind == 3:
        rounded = np.stack([1 - edge * (1 - np.cos(turn)), 1 - edge * (1 - np.sin(turn))], axis=1)
        return np.concatenate([rounded, rounded[::-1] * (-1.0, 1.0)])
    dome = np.linspace(0.1, np.pi / 2, 8)
    return np.concatenate([np.stack([np.cos(dome), np.sin(dome)], axis=1), [(-1.0, 1.0)]])


def _quads(index: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return triangles between rows of vertices [R, C] and those below them; columns wrap around."""
    a, b, c, d = index, np.roll(index, -1, axis=1), np.roll(below, -1, axis=1), below
    return np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)


def _closed(grid: np.ndarray, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Close rows [R, C, 3], top to bottom, by two lids around the poles [2, 3], which become the last two vertices."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    top, bottom = index[0], index[-1]
    lids = [
        np.stack([np.full(columns, index.size), top, np.roll(top, -1)], -1),
        np.stack([np.full(columns, index.size + 1), np.roll(bottom, -1), bottom], -1),
    ]
    faces = np.concatenate([_quads(index[:-1], index[1:]), *lids])
    return np.concatenate([grid.reshape(-1, 3), poles]), faces


def _ring(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Connect rows [R, C, 3] into a ring: the last row to the first."""
    index = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    return grid.reshape(-1, 3), _quads(index, np.roll(index, -1, axis=0))

"""Parts (nouns): machined things of flat faces, edges and holes, as tools, fittings and toys' wheels are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y, rotation_z
from anyprobe.render.mesh import Mesh, make_mesh, put_together

COLUMNS = 72
"""Directions around a piece's axis, besides those of its corners."""
CREASE_DEG = 30.0
"""Round walls turn by 5 degrees from a column to the next, roundings by 23 from a row to the next."""


def part(rng: np.random.Generator) -> Mesh:
    """One to five pieces grown together at right angles, some of them in rings; what lies inside is never seen."""
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
        around = rng.integers(2, 7) if rng.random() < 0.3 else 1
        for k in range(around):
            turn = rotation_y(2 * np.pi * k / around)
            pieces.append((positions @ turn.T, faces))
    return make_mesh(*put_together(pieces), crease_deg=CREASE_DEG)


def _placed(rng: np.random.Generator, half: np.ndarray, center: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A piece of half extents [3] around center, its axis along one of the three, now and then askew."""
    positions, faces = extruded(rng)
    quarter = np.pi / 2
    turn = [np.eye(3), rotation_x(quarter), rotation_z(quarter)][rng.integers(3)]
    if rng.random() < 0.15:
        turn = rotation_x(rng.normal(0.0, 0.4)) @ rotation_z(rng.normal(0.0, 0.4)) @ turn
    positions = positions @ turn.T
    return positions / np.abs(positions).max(axis=0) * half + center, faces


def extruded(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A closed piece along +Y: an outline, drawn out, with a hole or none; positions [V, 3] and faces [F, 3]."""
    outline, corners = _outline(rng)
    angles = [np.arange(COLUMNS) * 2 * np.pi / COLUMNS, corners]
    hole = None
    if rng.random() < 0.4:
        hole, more = _outline(rng)
        angles.append(more)
    phi = np.sort(np.concatenate(angles) % (2 * np.pi))
    phi = phi[np.diff(phi, append=phi[0] + 2 * np.pi) > 1e-3]
    around = np.stack([np.sin(phi), np.zeros_like(phi), np.cos(phi)], axis=-1)
    rows = _profile(rng)
    outer = around * outline(phi)[:, None]
    grid = rows[:, 1, None, None] * outer + rows[:, 0, None, None] * [0.0, 1.0, 0.0]
    if hole is None:
        return _closed(grid)
    inner = around * (hole(phi) * rng.uniform(0.3, 0.85))[:, None]
    wall = (np.linalg.norm(outer, axis=1) / np.linalg.norm(inner, axis=1)).min()
    inner *= min(1.0, 0.9 * rows[[0, -1], 1].min() * wall)
    ends = inner + rows[[-1, 0], 0][:, None, None] * [0.0, 1.0, 0.0]
    return _ring(np.concatenate([grid, ends]))


def _outline(rng: np.random.Generator) -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray]:
    """A star-shaped outline around the origin: its radius by angle from +Z towards +X, and its corners' angles."""
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
    """How far a convex polygon reaches, whose sides face the angles and are so far away."""
    toward = np.cos(phi[:, None] - sides) / distances
    return 1 / np.maximum(toward.max(axis=1), 1e-6)


def _corners(boxes: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Angles at which the outline of polygons' union bends: where one ends, or passes into another."""
    phi = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    side = np.stack([np.cos(phi[:, None] - sides) / distances for sides, distances in boxes])  # [B, P, K]
    radius = 1 / side.max(axis=2)
    which = radius.argmax(axis=0)
    of = which * 100 + side.argmax(axis=2)[which, np.arange(len(phi))]
    changes = np.nonzero(of != np.roll(of, -1))[0]
    step = phi[1]
    return np.concatenate([phi[changes], phi[changes] + step])


def _profile(rng: np.random.Generator) -> np.ndarray:
    """Rows of (height, scale) from top to bottom: straight, tapered, bevelled, rounded or domed."""
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
    """Triangles between rows of vertices [R, C] and those below them; columns go around."""
    a, b, c, d = index, np.roll(index, -1, axis=1), np.roll(below, -1, axis=1), below
    return np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)


def _closed(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows [R, C, 3] from top to bottom, closed by two lids."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    middle = np.stack([grid[0].mean(axis=0) * [0, 1, 0], grid[-1].mean(axis=0) * [0, 1, 0]])
    top, bottom = index[0], index[-1]
    lids = [
        np.stack([np.full(columns, index.size), top, np.roll(top, -1)], -1),
        np.stack([np.full(columns, index.size + 1), np.roll(bottom, -1), bottom], -1),
    ]
    return np.concatenate([grid.reshape(-1, 3), middle]), np.concatenate(
        [_quads(index[:-1], index[1:]), *lids]
    )


def _ring(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows [R, C, 3] that come back to the first."""
    index = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    return grid.reshape(-1, 3), _quads(index, np.roll(index, -1, axis=0))

"""Shapes that are only learned from: figures, machined parts, a draw of all families, and meshes bent into others."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.frames import normalize, rotation_x, rotation_y, rotation_z
from anyprobe.render.mesh import Mesh, make_mesh, put_together
from anyprobe.render.shapes import closed, quads
from anyprobe_train.dataset.random_shapes import blob, lathe, rounded_polyhedron, superquadric

if TYPE_CHECKING:
    from jaxtyping import Float


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
        return closed(grid, np.stack([grid[0].mean(axis=0), grid[-1].mean(axis=0)]) * [0, 1, 0])
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


def _ring(grid: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Connect rows [R, C, 3] into a ring: the last row to the first."""
    index = np.arange(grid.shape[0] * grid.shape[1]).reshape(grid.shape[:2])
    return grid.reshape(-1, 3), quads(index, np.roll(index, -1, axis=0))


def stretched(spread: float, rng: np.random.Generator) -> np.ndarray:
    """Draw a matrix that stretches along three random directions; spread: standard deviation of ln of its factors."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    return (axes * np.exp(rng.normal(0.0, spread, 3))) @ axes.T


def transformed(mesh: Mesh, matrix: np.ndarray) -> Mesh:
    """Apply a linear map [3, 3] of positive determinant to a mesh and scale it back into the unit sphere."""
    return _moved(
        mesh, mesh.positions.astype(np.float64) @ matrix.T, mesh.normals.astype(np.float64) @ np.linalg.inv(matrix)
    )


def waved(
    mesh: Mesh, pushes: Float[np.ndarray, "K 3"], waves: Float[np.ndarray, "K 3"], phases: Float[np.ndarray, " K"]
) -> Mesh:
    """Displace every point by x -> x + sum of pushes sin(waves . x + phases), and scale back into the unit sphere.

    Args:
        pushes, waves: [K, 3]; phases: [K]. Where the |push| |wave| sum to less than one nothing is turned
            inside out: the map's Jacobian I + push wave^T cos(...) can always be inverted.
    """
    x = mesh.positions.astype(np.float64)
    angles = x @ waves.T + phases  # [V, K]
    jacobians = np.eye(3) + np.einsum("vk,ki,kj->vij", np.cos(angles), pushes, waves)
    turned = np.linalg.inv(jacobians)[mesh.faces]  # [F, 3, 3, 3]
    return _moved(mesh, x + np.sin(angles) @ pushes, np.einsum("fci,fcij->fcj", mesh.normals, turned))


def _moved(mesh: Mesh, positions: np.ndarray, normals: np.ndarray) -> Mesh:
    """Return the mesh with vertices at `positions`, scaled into the unit sphere.

    normals: of any length, by the inverse transpose of the map that moved the vertices.
    """
    positions = positions - (positions.max(axis=0) + positions.min(axis=0)) / 2
    positions /= np.linalg.norm(positions, axis=1).max()
    normals = normals / np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-12)
    return Mesh(positions=positions.astype(np.float32), faces=mesh.faces, normals=normals.astype(np.float32))

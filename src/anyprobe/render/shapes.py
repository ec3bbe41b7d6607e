"""Closed surfaces over a latitude-longitude grid; the sphere."""

import numpy as np

from anyprobe.render.mesh import Mesh, make_mesh


def grid_mesh(positions: np.ndarray, crease_deg: float, poles: np.ndarray | None = None) -> Mesh:
    """Close a [R, C, 3] grid (rows pole to pole, columns around +Y) into a mesh.

    poles: [2, 3]; by default the middles of the outer rows.
    """
    if poles is None:
        poles = np.stack([positions[0].mean(axis=0), positions[-1].mean(axis=0)])
    return make_mesh(*closed(positions, poles), crease_deg=crease_deg)


def sphere_grid(rows: int, columns: int) -> np.ndarray:
    """Return unit directions [R, C, 3], rows pole to pole, columns around +Y."""
    theta = (np.arange(rows) + 0.5) * np.pi / rows
    phi = np.arange(columns) * 2 * np.pi / columns
    t, p = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], axis=-1)


def sphere(rows: int = 64) -> Mesh:
    """Return the unit sphere."""
    return grid_mesh(sphere_grid(rows, 2 * rows), crease_deg=180.0)


def quads(index: np.ndarray, below: np.ndarray) -> np.ndarray:
    """Return triangles between rows of vertices [R, C] and those below them; columns wrap around."""
    a, b, c, d = index, np.roll(index, -1, axis=1), np.roll(below, -1, axis=1), below
    return np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)


def closed(grid: np.ndarray, poles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Close rows [R, C, 3], top to bottom, by two lids around the poles [2, 3], which become the last two vertices."""
    rows, columns = grid.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    top, bottom = index[0], index[-1]
    lids = [
        np.stack([np.full(columns, index.size), top, np.roll(top, -1)], -1),
        np.stack([np.full(columns, index.size + 1), np.roll(bottom, -1), bottom], -1),
    ]
    faces = np.concatenate([quads(index[:-1], index[1:]), *lids])
    return np.concatenate([grid.reshape(-1, 3), poles]), faces

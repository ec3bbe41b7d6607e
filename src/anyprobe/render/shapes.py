"""Shapes the project makes itself: closed surfaces over a latitude-longitude grid.

Each function takes its randomness as an argument and returns a Mesh.
"""

from __future__ import annotations

import numpy as np

from anyprobe.render.mesh import Mesh, make_mesh


def _grid_mesh(positions: np.ndarray, crease_deg: float) -> Mesh:
    """Close a [R, C, 3] grid (rows pole to pole, columns around +Y) into a mesh."""
    rows, columns = positions.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    right = np.roll(index, -1, axis=1)
    a, b, c, d = index[:-1], right[:-1], right[1:], index[1:]
    faces = np.concatenate([np.stack([a, d, c], -1), np.stack([a, c, b], -1)]).reshape(-1, 3)
    vertices = positions.reshape(-1, 3)
    top, bottom = vertices[:columns].mean(axis=0), vertices[-columns:].mean(axis=0)
    vertices = np.concatenate([vertices, [top, bottom]])
    first, last = index[0], index[-1]
    cap_top = np.stack([np.full(columns, len(vertices) - 2), first, np.roll(first, -1)], -1)
    cap_bottom = np.stack([np.full(columns, len(vertices) - 1), np.roll(last, -1), last], -1)
    return make_mesh(vertices, np.concatenate([faces, cap_top, cap_bottom]), crease_deg=crease_deg)


def _sphere_grid(rows: int, columns: int) -> np.ndarray:
    theta = (np.arange(rows) + 0.5) * np.pi / rows
    phi = np.arange(columns) * 2 * np.pi / columns
    t, p = np.meshgrid(theta, phi, indexing="ij")
    return np.stack([np.sin(t) * np.sin(p), np.cos(t), np.sin(t) * np.cos(p)], axis=-1)


def sphere(rows: int = 64) -> Mesh:
    """The unit sphere."""
    return _grid_mesh(_sphere_grid(rows, 2 * rows), crease_deg=180.0)


def superquadric(rng: np.random.Generator, rows: int = 56) -> Mesh:
    """Between box, cylinder, ball and octahedron (Barr 1981), stretched and turned about +Y."""
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
    """A ball pushed in and out by a few smooth waves."""
    d = _sphere_grid(rows, 2 * rows)
    radius = np.ones(d.shape[:2])
    for _ in range(rng.integers(3, 9)):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        frequency = rng.uniform(1.0, 5.0)
        radius += (
            rng.uniform(0.04, 0.2) / frequency**0.5 * np.sin(frequency * (d @ axis) + rng.uniform(0, 6.28))
        )
    stretch = np.exp(rng.uniform(-0.3, 0.3, size=3))
    return _grid_mesh(d * np.maximum(radius, 0.25)[..., None] * stretch, crease_deg=180.0)


def lathe(rng: np.random.Generator, rows: int = 72) -> Mesh:
    """A turned vase, bottle or chess piece: a smooth random profile about +Y."""
    knots = rng.integers(4, 8)
    profile = rng.uniform(0.2, 0.9, size=knots)
    s = np.linspace(0, 1, rows)
    smooth = np.interp(s, np.linspace(0, 1, knots), profile)
    kernel = np.hanning(max(5, rows // knots))
    smooth = np.convolve(np.pad(smooth, rows, mode="edge"), kernel / kernel.sum(), mode="same")[rows:-rows]
    rounding = rng.uniform(0.02, 0.2)
    smooth = smooth * np.clip(np.minimum(s, 1 - s) / rounding, 0.0, 1.0) ** 0.5
    smooth = np.maximum(smooth, 0.01)
    height = rng.uniform(0.8, 2.6)
    phi = np.arange(2 * rows) * 2 * np.pi / (2 * rows)
    y = (0.5 - s) * height
    grid = np.stack(
        [
            smooth[:, None] * np.sin(phi),
            np.repeat(y[:, None], len(phi), axis=1),
            smooth[:, None] * np.cos(phi),
        ],
        axis=-1,
    )
    return _grid_mesh(grid, crease_deg=50.0)


def draw_shape(rng: np.random.Generator) -> Mesh:
    """One of the families above."""
    return [superquadric, blob, lathe, blob][rng.integers(4)](rng)

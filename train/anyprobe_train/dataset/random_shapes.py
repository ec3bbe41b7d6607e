"""Families of random shapes, each a closed surface over a latitude-longitude grid."""

from dataclasses import replace
from itertools import product

import numpy as np

from anyprobe.core.frames import normalize, rotation_y
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import grid_mesh, sphere_grid

GOLDEN = (1 + 5**0.5) / 2


def superquadric(rng: np.random.Generator, rows: int = 56) -> Mesh:
    """Draw a solid between box, cylinder, sphere and octahedron (Barr 1981), stretched and turned about +Y."""
    d = sphere_grid(rows, 2 * rows)
    east, north = rng.uniform(0.25, 1.6, size=2)
    t = np.arccos(np.clip(d[..., 1], -1, 1)) - np.pi / 2
    p = np.arctan2(d[..., 0], d[..., 2])

    def power(x, e):
        return np.sign(x) * np.abs(x) ** e

    x = power(np.cos(t), north) * power(np.sin(p), east)
    y = -power(np.sin(t), north)
    z = power(np.cos(t), north) * power(np.cos(p), east)
    stretch = np.exp(rng.uniform(-0.5, 0.5, size=3))
    return grid_mesh(np.stack([x, y, z], -1) * stretch, crease_deg=45.0)


def blob(rng: np.random.Generator, rows: int = 64) -> Mesh:
    """Draw a sphere pushed in and out by a few smooth waves."""
    d = sphere_grid(rows, 2 * rows)
    radius = np.ones(d.shape[:2])
    for _ in range(rng.integers(3, 9)):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        frequency = rng.uniform(1.0, 5.0)
        radius += rng.uniform(0.04, 0.2) / frequency**0.5 * np.sin(frequency * (d @ axis) + rng.uniform(0, 6.28))
    stretch = np.exp(rng.uniform(-0.3, 0.3, size=3))
    return grid_mesh(d * np.maximum(radius, 0.25)[..., None] * stretch, crease_deg=180.0)


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
    return grid_mesh(grid, crease_deg=50.0)


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
    d = sphere_grid(rows, 2 * rows)
    poles = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    g, normals = _gauge(planes, np.concatenate([d.reshape(-1, 3), poles]), power)
    mesh = grid_mesh(d / g[:-2].reshape(d.shape[:2])[..., None], 180.0, poles / g[-2:, None])
    return replace(mesh, normals=normalize(normals)[mesh.faces].astype(np.float32))

"""A screened Poisson equation on the sphere, solved by conjugate gradients from coarse to fine.

Sought is x with the least

    sum over pixels of a w (x - t)^2 + integral of (reach_phi dx/dphi)^2 + (reach_theta dx/dtheta)^2

t are values, w their weights and a solid angles. Where w is 0, x is stretched between its neighbours like a membrane;
where w is 1 and t is 0, it fades out over its reach. The normal equations are (w a + K) x = w a t with the five-point
Laplacian K of the sphere: columns wrap, and no flux crosses a pole, where a row's edge has no length.
"""

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import enlarged_map, reduced

COARSEST = 16
"""Rows at which the solution begins."""
STEPS = 48
"""Steps on each grid: a change crosses a quarter of the map's width, and the coarser grids have seen to the rest."""
LEAST_WEIGHT, TINY = 1e-9, 1e-30
"""Divisors where there is nothing."""


def screened(values: np.ndarray, weight: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Solve for x [R, 2R, C], float32.

    Args:
        values: t [R, 2R, C]. weight: w [R, 2R].
        reach: [2] angles [radians] along azimuth and elevation.
    """
    rows = len(values)
    grid, found = min(COARSEST, rows), None
    while True:
        w = reduced(weight[..., None], grid)
        t = reduced(values * weight[..., None], grid) / np.maximum(w, LEAST_WEIGHT)
        start = np.zeros_like(t) if found is None else enlarged_map(found, grid)
        found = _solve(start, t, w * pixel_solid_angles(grid)[..., None], reach)
        if grid == rows:
            return found
        grid = min(2 * grid, rows)


def _solve(x: np.ndarray, t: np.ndarray, w: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Return x after conjugate gradients, scaled by the diagonal, on one grid; all [R, 2R, C] but reach."""
    rows, step = len(x), np.pi / len(x)
    x, t, w = (np.ascontiguousarray(np.moveaxis(one, -1, 0), np.float32) for one in (x, t, w))
    edges = np.sin(np.arange(1, rows) * step)  # length of each edge between rows
    across = (reach[0] ** 2 * np.sin((np.arange(rows) + 0.5) * step)).astype(np.float32)[:, None]
    down = (reach[1] ** 2 * edges).astype(np.float32)[:, None]
    diagonal = w + 2 * across
    diagonal[:, :-1] += down
    diagonal[:, 1:] += down

    def applied(x: np.ndarray) -> np.ndarray:
        beside = np.empty_like(x)
        beside[..., 1:-1] = x[..., :-2] + x[..., 2:]
        beside[..., 0], beside[..., -1] = x[..., -1] + x[..., 1], x[..., -2] + x[..., 0]
        beside *= across
        beside[:, :-1] += down * x[:, 1:]
        beside[:, 1:] += down * x[:, :-1]
        return diagonal * x - beside

    rest = w * t - applied(x)
    scaled = rest / diagonal
    way, left = scaled, _dot(rest, scaled)
    for _ in range(STEPS):
        moved = applied(way)
        length = left / np.maximum(_dot(way, moved), TINY)
        x = x + length * way
        rest = rest - length * moved
        scaled = rest / diagonal
        before, left = left, _dot(rest, scaled)
        way = scaled + left / np.maximum(before, TINY) * way
    return np.ascontiguousarray(np.moveaxis(x, 0, -1))


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return inner products of each plane [C, 1, 1] float32."""
    return np.array([np.vdot(one, other) for one, other in zip(a, b, strict=True)], np.float32)[:, None, None]

"""Normals from a depth image of the photo, by planes fitted with local least squares.

A plane n.P = d seen along the ray r = (x, y, -1) has the inverse depth 1 / z = n.r / d, which is affine in x and y. So
a plane of P is a plane of 1 / z over the picture, whatever the perspective, and z's unit cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.masks.check import object_box
from anyprobe.masks.depth import DepthSource, depth_of_view

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

LARGEST = 512
"""Largest side [px] of the object in the depth image; beyond it, depths are averaged in blocks; the networks see 64."""
SMALLEST = 12
"""Smallest side [px] at which anything is fitted."""
AIM = np.radians(4.0)
"""Tilt of normals by noise [radians] that the window's width aims at."""
NARROWEST, WIDEST = 3, 1 / 6
"""Smallest side of the window [px], and largest, as a share of the object's side."""
WORST = np.radians(15.0)
"""Largest tilt by noise [radians] of a known normal: beyond it the network's own guesses are as good."""
GRAZING = 0.2
"""Smallest cosine to the view; a steeper surface is unknown."""
FILLED = 0.6
"""Smallest share of the window that must be measured."""
JUMP = 6.0
"""Noise margin of an edge between neighbours, in standard deviations beyond the steepest surface."""
ENOUGH = 0.3
"""Smallest share of the object whose normals must be known."""
INWARD = -0.15
"""Mean outward lean of normals below which the object appears hollow: depth grows towards the camera there."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DepthNormals:
    """Result: normals [H, W, 3] float32 in the camera's frame, unit, zero where unknown; or None, with a doubt."""

    normals: np.ndarray | None
    doubt: str = ""


def normals_from_depth(source: DepthSource, mask: Float[np.ndarray, "H W"], long_fov_deg: float) -> DepthNormals:
    """Fit normals of a photo's object to its depth along the camera's axis, in any unit.

    Unknown are edges and holes of the depth, grazing surfaces, and normals that noise or steps tilt by more than WORST.

    Args:
        source: see masks.depth.read_depth; of the photo's view, at any size.
        mask: [H, W] in [0, 1], 1 on the object.
        long_fov_deg: field of view of the photo's longer side.
    Raises:
        InvalidMask: no depth image, or one of another view.
    """
    depth = depth_of_view(source, mask.shape)
    scale = np.array(depth.shape) / mask.shape
    on = mask[np.ix_(*(_nearest(n, m) for n, m in zip(depth.shape, mask.shape, strict=True)))] > 0.5
    measured = on & np.isfinite(depth) & (depth > 0)
    if not measured.any():
        return DepthNormals(normals=None, doubt="depth was measured nowhere on the object")
    height, width = mask.shape
    focal = PinholeCamera.of_fov(width, height, long_fov_deg).focal * scale
    y = (depth.shape[0] / 2 - np.arange(depth.shape[0]) - 0.5) / focal[0]
    x = (np.arange(depth.shape[1]) + 0.5 - depth.shape[1] / 2) / focal[1]
    x0, y0, x1, y1 = object_box(on)
    box = slice(y0, y1), slice(x0, x1)
    block = -(-max(y1 - y0, x1 - x0) // LARGEST)
    inside = measured[box]
    step = _step(depth[box][inside])
    inverse = np.where(inside, 1.0 / np.where(inside, depth[box], 1.0), 0.0)
    normals = _fitted(
        _blocks(inverse, block),
        _blocks(inside.astype(float), block),
        _axis(y[box[0]], block),
        _axis(x[box[1]], block),
        step,
    )
    found = np.zeros((*depth.shape, 3), np.float32)
    large = normals.repeat(block, axis=0).repeat(block, axis=1)[: inside.shape[0], : inside.shape[1]]
    found[box] = np.where(on[box][..., None], large, 0.0)
    known = np.asarray(found.any(axis=-1))
    share = known.sum() / on.sum()
    if share < ENOUGH:
        return DepthNormals(
            normals=None,
            doubt=f"depth gives normals of {share:.0%} of the object alone: it is too coarse, noisy or incomplete",
        )
    if _lean(found, known, on) < INWARD:
        return DepthNormals(
            normals=None,
            doubt="depth makes the object hollow, as inverse depth does, which is larger where things are nearer",
        )
    return DepthNormals(normals=found[np.ix_(*(_nearest(n, m) for n, m in zip(mask.shape, depth.shape, strict=True)))])


def _fitted(
    total: Float[np.ndarray, "h w"], share: Float[np.ndarray, "h w"], y: np.ndarray, x: np.ndarray, step: float
) -> Float[np.ndarray, "h w 3"]:
    """Fit normals, zero where unknown, to inverse depths times each pixel's measured share.

    y, x: of the rows and columns, on the plane at depth 1; step: relative spacing of stored depths.
    """
    valid = share > 0.5
    q = np.where(valid, total / np.maximum(share, 0.5), 0.0)
    side, focal = max(q.shape), 1.0 / max(abs(x[-1] - x[0]) / max(len(x) - 1, 1), 1e-9)
    if side < SMALLEST or min(q.shape) < NARROWEST:
        return np.zeros((*q.shape, 3))
    noise = _noise(q, valid)
    coarse = max(step - 2.0 * noise, 0.0)  # noise blurs the steps
    wanted = max(np.sqrt(noise * focal * np.sqrt(12.0) / AIM), coarse * focal / AIM, NARROWEST)
    radius = int(min(np.ceil(wanted), max(side * WIDEST, NARROWEST)) // 2)
    steepest = np.sqrt(1.0 - GRAZING**2) / GRAZING
    edge = _edges(q, valid, 1.5 * steepest / focal + JUMP * noise + step)

    q /= q[valid].mean()
    gx, gy = np.broadcast_arrays(x[None, :], y[:, None])

    def mean(values: np.ndarray) -> np.ndarray:
        return _box_sum(np.where(valid, values, 0.0), radius) / count

    count = np.maximum(_box_sum(valid.astype(float), radius), 1.0)
    mx, my, mq = mean(gx), mean(gy), mean(q)
    xx, xy, yy = mean(gx * gx) - mx * mx, mean(gx * gy) - mx * my, mean(gy * gy) - my * my
    xq, yq = mean(gx * q) - mx * mq, mean(gy * q) - my * mq
    pixel = 1.0 / focal
    spread = np.maximum(xx * yy - xy * xy, 1e-3 * pixel**4)
    b, c = (yy * xq - xy * yq) / spread, (xx * yq - xy * xq) / spread
    rest = np.maximum(mean(q * q) - mq * mq - b * xq - c * yq, 0.0)
    n = np.stack([-b, -c, mq - b * mx - c * my], axis=-1)
    n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-12)
    wo = np.stack([-gx, -gy, np.ones_like(gx)], axis=-1)
    facing = (n * wo).sum(axis=-1) / np.linalg.norm(wo, axis=-1)

    width = 2 * radius + 1
    tilt = np.sqrt(rest / np.maximum(count * np.minimum(xx, yy), 1e-12)) / np.maximum(mq, 1e-12)
    error = (tilt + coarse * focal / width) * np.maximum(facing, GRAZING) ** 2  # a slope tilts steep normals less
    known = valid & (count > FILLED * width**2) & (_box_sum(edge.astype(float), radius) < 0.5)
    known &= (facing > GRAZING) & (error < WORST)
    return np.where(known[..., None], n, 0.0)


def _noise(q: np.ndarray, valid: Bool[np.ndarray, "h w"]) -> float:
    """Estimate the relative standard deviation of q's noise by second differences; robust to edges."""
    second = []
    for values, good in ((q, valid), (q.T, valid.T)):
        three = good[:-2] & good[1:-1] & good[2:]
        second.append((values[:-2] - 2 * values[1:-1] + values[2:])[three] / values[1:-1][three])
    both = np.abs(np.concatenate(second))
    return float(np.median(both) * 1.4826 / np.sqrt(6.0)) if both.size else 0.0


def _step(depths: np.ndarray) -> float:
    """Return the typical spacing of stored depths over their mean: quantisation, or next to nothing."""
    values = np.unique(depths)
    if len(values) < 2:
        return 1.0
    return float(np.median(np.diff(values)) / values.mean())


def _edges(q: np.ndarray, valid: np.ndarray, jump: float) -> Bool[np.ndarray, "h w"]:
    """Return pixels whose depth differs from a neighbour's by more than jump, relative."""
    edge = np.zeros(q.shape, bool)
    for a, b in (
        ((slice(1, None),), (slice(None, -1),)),
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
    ):
        apart = valid[a] & valid[b] & (np.abs(q[a] - q[b]) > jump * np.minimum(q[a], q[b]))
        edge[a] |= apart
        edge[b] |= apart
    return edge


def _box_sum(values: np.ndarray, radius: int) -> np.ndarray:
    """Sum over the square of side 2 radius + 1 around every pixel; zero beyond the border."""
    for axis in (0, 1):
        size = values.shape[axis]
        total = np.insert(values.cumsum(axis=axis), 0, 0.0, axis=axis)
        here = np.arange(size)
        high, low = np.minimum(here + radius + 1, size), np.maximum(here - radius, 0)
        values = total.take(high, axis=axis) - total.take(low, axis=axis)
    return values


def _blocks(values: np.ndarray, block: int) -> np.ndarray:
    """Average over blocks of block x block, zero beyond the border."""
    if block == 1:
        return values
    height, width = (-(-size // block) for size in values.shape)
    padded = np.pad(values, ((0, height * block - values.shape[0]), (0, width * block - values.shape[1])))
    return padded.reshape(height, block, width, block).mean(axis=(1, 3))


def _axis(places: np.ndarray, block: int) -> np.ndarray:
    """Return the middle of each block of an axis."""
    pixel = places[1] - places[0] if len(places) > 1 else 0.0
    return places[0] + pixel * (np.arange(-(-len(places) // block)) * block + (block - 1) / 2)


def _nearest(wanted: int, size: int) -> np.ndarray:
    """Return the pixels of an axis of `size` at the middles of `wanted` equal parts."""
    return ((np.arange(wanted) + 0.5) * size / wanted).astype(int)


def _lean(normals: np.ndarray, known: np.ndarray, on: np.ndarray) -> float:
    """Return the mean component of known normals away from the object's centre, in the picture."""
    rows, columns = np.nonzero(on)
    row, column = rows.mean(), columns.mean()
    y, x = np.nonzero(known)
    away = np.stack([x - column, row - y], axis=-1)
    away /= np.maximum(np.linalg.norm(away, axis=-1, keepdims=True), 1e-9)
    return float((normals[known][:, :2] * away).sum(axis=-1).mean())

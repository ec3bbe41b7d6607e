"""The map below the horizon: the ground that the photo shows, seen from the object, and its colour where it shows none.

The ground is near, so that the object sees a point of it in another direction than the camera does. A Lambert ground
has the same radiance in both.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.ground import Ground
from anyprobe.estimate.surroundings import FINE, _resize, _sample
from anyprobe.light.environment import MAP_HEIGHT

if TYPE_CHECKING:
    from jaxtyping import Float

NEAR = 4.0
"""Ground of which the colour is taken, around the object, in its heights over the ground."""
LEAST_GROUND = 20
"""Pixels of the shrunk photo that it takes."""
HORIZON_DEG = 4.0
"""The ground begins so far below the horizon."""


def ground_surroundings(
    rgb: Float[np.ndarray, "H W 3"],
    mask: Float[np.ndarray, "H W"],
    long_fov_deg: float,
    camera_from_crop: Float[np.ndarray, "3 3"],
    ground: Ground,
    *,
    seen: float = 1.0,
    unseen: float = 1.0,
    reproject: bool = True,
) -> Float[np.ndarray, "64 128 4"] | None:
    height, width = mask.shape
    focal = max(width, height) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    scale = min(1.0, FINE * MAP_HEIGHT / np.pi / focal)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    free = 1.0 - np.clip(4 * _resize(mask[..., None], size), 0, 1)
    small = np.dstack([_resize(rgb, size), free])
    up = ground.up

    def rays(x, y):
        return np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)

    def pixels(points):
        depth = np.maximum(-points[..., 2], 1e-6)
        return 0.5 + focal * points[..., 0] / depth / width, 0.5 - focal * points[..., 1] / depth / height

    foot = rays(*(np.array(v, float) for v in ground.contact))
    down = -(foot @ up)
    if down < 1e-2:
        return None
    foot = foot / down
    rows = np.flatnonzero((mask > 0.5).any(axis=1))
    cols = np.flatnonzero((mask > 0.5).any(axis=0))
    middle = rays(np.array((cols[0] + cols[-1] + 1) / 2), np.array((rows[0] + rows[-1] + 1) / 2))
    # nearest point of foot + s up to the ray through the middle
    a = np.stack([up, -middle], axis=1)
    s = float(np.linalg.lstsq(a, -foot, rcond=None)[0][0])
    s = max(s, 0.02 * -foot[2])
    center = foot + s * up
    # colour of the ground near the object
    y, x = np.mgrid[0 : size[1], 0 : size[0]]
    ray = rays((x + 0.5) / size[0] * width, (y + 0.5) / size[1] * height)
    below = -(ray @ up)
    on = ray / np.maximum(below, 1e-3)[..., None]
    near = (below > 1e-2) & (np.linalg.norm(on - foot, axis=-1) < NEAR * 2 * s) & (free[..., 0] > 0.9)
    if near.sum() < LEAST_GROUND:
        near = (below > 1e-2) & (free[..., 0] > 0.9) & (y > size[1] * 0.6)
        if near.sum() < LEAST_GROUND:
            return None
    color = np.median(small[near][:, :3], axis=0)
    d = pixel_directions(MAP_HEIGHT) @ camera_from_crop.T.astype(np.float32)
    sine = -(d @ up.astype(np.float32))
    lower = np.clip((np.degrees(np.arcsin(np.clip(sine, -1, 1))) - 0.5 * HORIZON_DEG) / HORIZON_DEG, 0, 1)
    points = center + d * (s / np.maximum(sine, 1e-3))[..., None]
    column, row = pixels(points)
    inside = (points[..., 2] < -1e-3) & (column > 0) & (column < 1) & (row > 0) & (row < 1) & (sine > 1e-3)
    shown = _sample(small, column.clip(0, 1), row.clip(0, 1))
    visible = (inside * shown[..., 3])[..., None] * reproject
    display = visible * shown[..., :3] + (1 - visible) * color
    cover = lower[..., None] * (seen * visible + unseen * (1 - visible))
    return np.dstack([display * cover, cover]).clip(0, 1).astype(np.float32)

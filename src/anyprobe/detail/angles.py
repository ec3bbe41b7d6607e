"""Angles to what is seen."""

from __future__ import annotations

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.light.environment import reduced

ANGLE_ROWS = 44
"""Rows at which angles are measured."""


def angles_from(cover: np.ndarray) -> np.ndarray:
    """Return the angle [degrees, R, 2R] to the nearest direction that is covered [R, 2R]; 180 where none is."""
    rows = len(cover)
    small = reduced(cover[..., None].astype(np.float32), ANGLE_ROWS)[..., 0]
    if not cover.any():
        return np.full(cover.shape, 180.0, np.float32)
    covered = small > min(0.5, 0.9 * float(small.max()))
    d = pixel_directions(len(small)).reshape(-1, 3)
    chosen = d[covered.ravel()]
    cosine = np.concatenate([(part @ chosen.T).max(axis=1) for part in np.array_split(d, 16)])
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).reshape(*small.shape, 1)
    smooth = bilinear(angle.astype(np.float32), direction_to_uv(pixel_directions(rows)).astype(np.float32))[..., 0]
    return np.where(cover > 0.99, 0.0, smooth)

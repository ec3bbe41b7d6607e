"""Look-ups in maps at places: a place is a yaw about the map's vertical and a pitch of the camera below its horizon."""

from __future__ import annotations

import numpy as np

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import direction_to_uv

YAWS = 32
"""Number of yaws that a search tries, evenly spaced."""


def map_from_camera_at(yaw: float, pitch_deg: float) -> np.ndarray:
    """Return the rotation [3, 3] of a place."""
    return rotation_y(yaw) @ rotation_x(-np.radians(pitch_deg))


def pitches_near(pitch_deg: float, error_deg: float) -> tuple[float, ...]:
    """Return the pitches [degrees] at which a search begins, evenly spaced; error_deg: standard deviation, 0: exact.

    A search that is refined by three quarters of their distance reaches 1.75 standard deviations.
    """
    return (pitch_deg - error_deg, pitch_deg, pitch_deg + error_deg) if error_deg else (pitch_deg,)


def nearest_pixels(d: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column, in a map of this many rows, of each direction [P, 3]."""
    uv = direction_to_uv(d)
    row = np.clip((uv[..., 1] * rows).astype(int), 0, rows - 1)
    return row, (uv[..., 0] * 2 * rows).astype(int) % (2 * rows)


def seen_at_yaws(maps: np.ndarray, at: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Look up maps [N, H, 2H, C] at P pixels for each yaw: [N * YAWS, P, C]; a yaw shifts them to the left."""
    columns = maps.shape[2]
    moved = (at[1] - columns // YAWS * np.arange(YAWS)[:, None]) % columns
    return maps[:, at[0], moved].reshape(-1, len(at[0]), maps.shape[-1])


def seen_along(maps: np.ndarray, index: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Interpolate M of the maps [N, H, 2H, C] at M x P directions: [M, P, C]."""
    rows, columns = maps.shape[1:3]
    uv = direction_to_uv(d)
    column, row = uv[..., 0] * columns - 0.5, np.clip(uv[..., 1] * rows - 0.5, 0.0, rows - 1.001)
    left, top = np.floor(column), np.floor(row)
    right, down = (column - left)[..., None], (row - top)[..., None]
    left, top, which = left.astype(int) % columns, top.astype(int), index[:, None]
    after = (left + 1) % columns
    upper = maps[which, top, left] * (1 - right) + maps[which, top, after] * right
    lower = maps[which, top + 1, left] * (1 - right) + maps[which, top + 1, after] * right
    return upper * (1 - down) + lower * down

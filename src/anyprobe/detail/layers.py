"""The smooth light of an estimate drawn as a place: a room of flat faces indoors, sky over ground outdoors.

Every direction is coloured by one nearer to the middle of the face that it meets. So faces are evener than the
estimate, and their edges, which it blurs, are edges.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.detail.kinds import INDOORS, OPEN_AIR
from anyprobe.detail.matched_light import enlarged_map
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.match.kind import is_lit_outdoors, photo_outdoors
from anyprobe.match.plate import Plate
from anyprobe.notices import Notice

KNOWN = 0.25
"""Share of all directions from which on a light counts as known."""
CEILING_DEG, FLOOR_DEG = 44.0, -24.0
"""Elevations [degrees] of the edges of ceiling and floor, at the middles of the walls."""
PULL = 0.3
"""Share of the way to a face's middle from which its colour is taken."""
HORIZON_PULL_DEG, HORIZON_REACH_DEG = 12.0, 25.0
"""Elevation [degrees] from the horizon by which its colours are taken farther away, and where that is down to 1 / e."""
EDGE_DEG = 0.7
"""Width [degrees] of an edge."""
_MIDDLES = np.concatenate([np.eye(3), -np.eye(3)]).astype(np.float32)


def kind_of_place(
    hints: Mapping[str, Any] | None, plate: Plate | None, warnings: Iterable[Notice], radiance: np.ndarray
) -> str | None:
    """Return INDOORS or OPEN_AIR for a photo's light; None where a mirror shows
    the place, or more than KNOWN of it is known.

    Args:
        hints: estimate.sidecar.Origin.hints.
        radiance: [H, 2H, 3], level: what the photo shows beside its object may be nothing typical of outdoors.
    """
    hints = hints or {}
    if hints.get("above_white") or (hints.get("surroundings") or 0.0) > KNOWN:
        return None
    outdoors = photo_outdoors(plate, warnings) or (plate is not None and is_lit_outdoors(radiance))
    return OPEN_AIR if outdoors else INDOORS


def as_place(
    radiance: np.ndarray, rows: int, outdoors: bool, floor_deg: float = FLOOR_DEG
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a smooth level map [H, 2H, 3] as a place: [rows, 2 rows, 3], and the share of ground [rows, 2 rows].

    floor_deg: elevation of the floor's edge, indoors.
    """
    toward, ground = _faces(rows, outdoors, floor_deg)
    drawn = bilinear(enlarged_map(radiance, 2 * MAP_HEIGHT), direction_to_uv(toward).astype(np.float32))
    return drawn.astype(np.float32), ground


def ground_share(rows: int, outdoors: bool, floor_deg: float = FLOOR_DEG) -> np.ndarray:
    """Return the share of ground [rows, 2 rows] alone, as of as_place."""
    return _faces(rows, outdoors, floor_deg)[1]


def _faces(rows: int, outdoors: bool, floor_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction whose colour each pixel takes [rows, 2 rows, 3], and the share of ground [rows, 2 rows]."""
    d = pixel_directions(rows)
    toward, ground = _beside_horizon(d) if outdoors else _in_room(d, floor_deg, np.pi / rows)
    return toward, ground.astype(np.float32)


def _beside_horizon(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return directions pushed away from the horizon, and what is below it."""
    elevation = np.degrees(np.arcsin(np.clip(d[..., 1], -1.0, 1.0)))
    push = HORIZON_PULL_DEG * np.tanh(elevation / EDGE_DEG) * np.exp(-np.abs(elevation) / HORIZON_REACH_DEG)
    up = np.radians(elevation + push)[..., None]
    level = d * (1.0, 0.0, 1.0) / np.maximum(np.hypot(d[..., 0], d[..., 2]), 1e-6)[..., None]
    return level * np.cos(up) + np.sin(up) * (0.0, 1.0, 0.0), 0.5 - 0.5 * np.tanh(elevation / EDGE_DEG)


def _in_room(d: np.ndarray, floor_deg: float, pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return directions pulled to the middles of a room's faces, and the floor's share."""
    up, down = (np.float32(np.tan(np.radians(deg))) for deg in (CEILING_DEG, -floor_deg))
    height = np.where(d[..., 1] > 0, up, down)
    over = np.stack([d[..., 0], d[..., 1] / height, d[..., 2]], axis=-1)
    over = np.concatenate([over, -over], axis=-1)
    edge = np.float32(max(np.radians(EDGE_DEG), 1.5 * pixel))
    shares = np.clip((over - over.max(axis=-1, keepdims=True)) / edge + 1.0, 0.0, 1.0)
    shares /= shares.sum(axis=-1, keepdims=True)
    pulled = d + PULL * (shares @ _MIDDLES - d)
    return pulled / np.linalg.norm(pulled, axis=-1, keepdims=True), shares[..., 4]

"""The ground goes on: below the horizon, where the photo shows nothing, its colour around the object stands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.ground import Ground
from anyprobe.estimate.surroundings import LEAST_COVER

if TYPE_CHECKING:
    from jaxtyping import Float

_GROUND = contract("ground")
NEAR: float = _GROUND["near"]
"""The colour is that of the ground around the object up to so far, in halves of the crop's side."""
LEAST_PIXELS: int = _GROUND["least_pixels"]
"""Of the map, that have to show it."""
BEGINS_DEG: float = _GROUND["begins_deg"]
FULL_DEG: float = _GROUND["full_deg"]
"""Below the horizon, where the ground begins and where it has its full weight."""
WEIGHT: float = _GROUND["weight"]
"""Of the ground's colour, over the model's guess; chosen on left-out whole photos, as the two above."""


def ground_below(
    seen: Float[np.ndarray, "64 128 C"],
    camera_from_crop: Float[np.ndarray, "3 3"],
    ground: Ground,
    foot: Float[np.ndarray, " 3"],
    tan_half: float,
) -> Float[np.ndarray, "64 128 4"] | None:
    """The map below the horizon where what is seen leaves it open, in the colour of the ground that is seen.

    Args:
        seen: [64, 128, 4 or 5] in the crop's frame, see estimate.surroundings.
        foot: [3] unit direction to where the object touches the ground, in the camera's frame.
        tan_half: of the crop.
    Returns:
        [64, 128, 4] display RGB times cover, and cover; None where too little of the ground is seen, or the object
        would float above the horizon.
    """
    d = pixel_directions(len(seen)) @ camera_from_crop.T.astype(np.float32)
    up = ground.up
    slope = -float(foot @ up)
    if slope < np.sin(np.radians(BEGINS_DEG)):
        return None
    down = -(d @ up.astype(np.float32))
    point = d / np.maximum(down, 1e-3)[..., None]  # on the plane that is one below the camera
    reach = NEAR * tan_half / slope
    near = (down > np.sin(np.radians(BEGINS_DEG))) & (np.linalg.norm(point - foot / slope, axis=-1) < reach)
    near &= seen[..., 3] > 0.9
    if near.sum() < LEAST_PIXELS:
        return None
    color = np.median(np.minimum(seen[near][:, :3] / seen[near][:, 3:4], 1.0), axis=0)
    depth_deg = np.degrees(np.arcsin(np.clip(down, -1.0, 1.0)))
    cover = WEIGHT * np.clip((depth_deg - BEGINS_DEG) / (FULL_DEG - BEGINS_DEG), 0.0, 1.0) * (1.0 - seen[..., 3])
    cover = np.where(cover < LEAST_COVER, 0.0, cover)[..., None]
    return np.concatenate([color * cover, cover], axis=-1).astype(np.float32)

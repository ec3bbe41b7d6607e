"""Photos of a map with a disc in front of it: what lies beside the object is known exactly."""

from __future__ import annotations

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.core.frames import normalize
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response

FOV_DEG = 60.0


def smooth_map() -> np.ndarray:
    """[64, 128, 3] between 0.1 and 0.7: soft waves, each channel another way."""
    return (0.4 + 0.3 * np.sin(2 * pixel_directions(64) + 1)).astype(np.float32)


def room_photo(
    radiance: np.ndarray, width: int = 240, height: int = 160, world_from_camera: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """A photo of a map through a lens of FOV_DEG, a black disc right of its middle; and the disc's mask.

    world_from_camera: the map's frame being the world's; None: the camera is not turned.
    """
    slope = np.tan(np.radians(FOV_DEG) / 2) / (width / 2)
    x, y = np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5
    rays = np.stack([*np.meshgrid(slope * x, slope * y), np.full((height, width), -1.0)], axis=-1)
    rays = normalize(rays if world_from_camera is None else rays @ world_from_camera.T)
    photo = response(bilinear(radiance, direction_to_uv(rays).astype(np.float32)))
    rows, columns = np.mgrid[:height, :width]
    mask = (columns - 160) ** 2 + (rows - 70) ** 2 < 30**2
    return to_bytes(photo * ~mask[..., None]), mask.astype(np.uint8) * 255

"""What a photo shows beside the object, at the resolution of a map with detail."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.core.latlong import bilinear, pixel_directions

FINE = 1.0
"""Pixels of the shrunk photo on one of the map's, at least."""
EDGE = 0.04
"""Share of the photo's shorter side over which it fades out at its border."""
GROW = 0.015
"""Share of the photo's longer side around the object that is left out: its edge is not where the mask says."""
FRONT = 0.05
"""Least -z of a direction that a photo may show."""


def seen_in_photo(rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float, rows: int) -> np.ndarray:
    """The map in the camera's frame as far as the photo shows it: [rows, 2 rows, 4] float32, display values times
    cover, and cover in [0, 1], which fades out towards the border and the object.

    Args:
        rgb: [H, W, 3] display values; mask: [H, W], 1 on the object.
        long_fov_deg: field of view of the longer side.
    """
    height, width = mask.shape
    focal = max(height, width) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    scale = min(1.0, FINE * rows / np.pi / focal)
    size = (max(2, round(width * scale)), max(2, round(height * scale)))
    picture = np.dstack([_resized(rgb[..., k], size) for k in range(3)] + [_beside(mask, size)])
    d = pixel_directions(rows)
    depth = np.maximum(-d[..., 2], FRONT)
    column, row = 0.5 + focal * d[..., 0] / depth / width, 0.5 - focal * d[..., 1] / depth / height
    inside = (d[..., 2] < -FRONT) & (column > 0) & (column < 1) & (row > 0) & (row < 1)
    found = np.zeros((rows, 2 * rows, 4), np.float32)
    margin = np.minimum(np.minimum(column, 1 - column) * width, np.minimum(row, 1 - row) * height)[inside] / (
        EDGE * min(width, height)
    )
    shown = bilinear(picture.astype(np.float32), np.stack([column[inside], row[inside]], axis=-1))
    cover = shown[:, 3:] * np.clip(margin, 0.0, 1.0)[:, None]
    found[inside] = np.concatenate([shown[:, :3] * cover, cover], axis=1)
    return found


def _resized(plane: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    image = Image.fromarray(np.ascontiguousarray(plane, np.float32))
    return np.asarray(image.resize(size, Image.Resampling.BOX))


def _beside(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """1 away from the object, 0 on it and close to it."""
    plane = Image.fromarray(np.round(255 * np.clip(_resized(mask, size), 0, 1)).astype(np.uint8))
    reach = max(1, round(GROW * max(size)))
    grown = plane.filter(ImageFilter.MaxFilter(4 * reach + 1)).filter(ImageFilter.GaussianBlur(reach))
    return 1.0 - np.asarray(grown, np.float32) / 255.0

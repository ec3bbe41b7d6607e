"""The plate: a photo without its object, small enough to keep, for panoramas of the place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.color import to_bytes
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.resample import between, resample, widest
from anyprobe.core.response import inverse_response
from anyprobe.match.fill import fill_hole

MOST_ROWS = 1024
"""Largest number of panorama rows for which a plate keeps enough pixels."""
GROW = 0.012
"""Rim around the object that is filled with it, as a share of the photo's longer side: masks miss the true edge."""
LEAST_FRONT = 0.05
"""Smallest -z of a direction that a photo may show."""
LEAST_LEFT = 0.02
"""Smallest share of the photo that must show the place beside its object."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Plate:
    """The photo beside its object.

    Attributes:
        rgb: [H, W, 3] uint8 display values.
        hidden: [H, W] uint8, 255 where the object or a transparent pixel hides the place.
        tan_half: [2] tangents of half the field of view, across and down.
        radiance: [H, W, 3] float16, linear radiance where the photo holds it above white; None: display values suffice.
    """

    rgb: np.ndarray
    hidden: np.ndarray
    tan_half: tuple[float, float]
    radiance: np.ndarray | None = None

    def at_density(self, rows: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the photo with the object's place filled, at the density of a panorama of this many rows.

        Returns:
            [h, w, 3] linear radiance, and [h, w] share of each pixel that is filled.
        """
        size = _size_at(self.tan_half, rows, self.rgb.shape[:2])
        linear = inverse_response(resample(self.rgb.astype(np.float32) / 255, size))
        if self.radiance is not None:
            above = resample(self.radiance.astype(np.float32), size)
            linear = np.where(above > 1, above, linear)
        hidden = resample(self.hidden.astype(np.float32)[..., None] / 255, size)[..., 0]
        grown = widest(hidden, max(2, round(GROW * max(size))))
        return fill_hole(linear, grown > 0.02), grown


def keep_plate(
    rgb: np.ndarray,
    mask: np.ndarray,
    long_fov_deg: float,
    radiance: np.ndarray | None = None,
    transparent: np.ndarray | None = None,
) -> Plate | None:
    """Make the plate of a photo [H, W, 3] with its object marked [H, W]; None where hardly any place is visible."""
    height, width = mask.shape
    tan = np.tan(np.radians(long_fov_deg) / 2) / max(height, width)
    tan_half = float(tan * width), float(tan * height)
    size = _size_at(tan_half, MOST_ROWS, (height, width))
    step = max(1, min(width // (2 * size[0]), height // (2 * size[1])))
    covered = mask if transparent is None else np.maximum(mask, transparent)
    hidden = resample(covered[::step, ::step, None].astype(np.float32), size)
    if (hidden < 0.5).mean() < LEAST_LEFT:
        return None
    return Plate(
        rgb=to_bytes(resample(rgb[::step, ::step], size)),
        hidden=to_bytes(hidden[..., 0]),
        tan_half=tan_half,
        radiance=None if radiance is None else resample(radiance[::step, ::step], size).clip(0, 6e4).astype(np.float16),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class DrawnPlate:
    """A plate in a panorama's frame.

    Attributes:
        radiance: [R, 2R, 3], linear; zero outside the photo.
        margin: [R, 2R], distance [degrees] inwards from the photo's border; negative outside.
        filled: [R, 2R], share of each pixel that is filled, not seen.
    """

    radiance: np.ndarray
    margin: np.ndarray
    filled: np.ndarray


def seen_in(plate: Plate, frame_from_camera: np.ndarray, rows: int) -> DrawnPlate:
    """Draw a plate into a panorama of this many rows whose frame is rotated by frame_from_camera [3, 3]."""
    linear, filled = plate.at_density(rows)
    height, width = filled.shape
    d = pixel_directions(rows) @ frame_from_camera.astype(np.float32)  # R^T d
    depth = np.maximum(-d[..., 2], LEAST_FRONT)
    x, y = d[..., 0] / depth / plate.tan_half[0], d[..., 1] / depth / plate.tan_half[1]
    front = d[..., 2] < -LEAST_FRONT
    length = np.sqrt(1 + (x * plate.tan_half[0]) ** 2 + (y * plate.tan_half[1]) ** 2)
    margin = np.minimum((1 - np.abs(x)) * plate.tan_half[0], (1 - np.abs(y)) * plate.tan_half[1]) / length
    margin = np.where(front, np.degrees(margin), -90.0).astype(np.float32)
    inside = margin > 0
    column, row = (0.5 + 0.5 * x[inside]) * width - 0.5, (0.5 - 0.5 * y[inside]) * height - 0.5
    found = np.zeros((rows, 2 * rows, 4), np.float32)
    found[inside] = between(np.dstack([linear, filled]).astype(np.float32), column, row)
    return DrawnPlate(radiance=found[..., :3], margin=margin, filled=found[..., 3])


def _size_at(tan_half: tuple[float, float], rows: int, shape: tuple[int, int]) -> tuple[int, int]:
    """Return width and height of a photo of this shape [H, W] at the density of a panorama, never enlarged."""
    width, height = (2 * tan * rows / np.pi for tan in tan_half)
    scale = min(1.0, shape[1] / width)
    return max(4, round(width * scale)), max(4, round(height * scale))

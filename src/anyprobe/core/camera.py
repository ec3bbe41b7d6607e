"""The camera of a photo, a pinhole at the origin that looks along -Z, and photos drawn on the sphere around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.resample import between, resample

ASSUMED_LONG_FOV_DEG: float = contract("lens")["default_long_fov_deg"]
"""Field of view [degrees] of the longer side where nothing says it, for estimates and inserted objects alike.

Cameras of the training photos take in 45 to 80 degrees: with 60 the focal length is at most a factor 1.44 off, and no
other lens does better by more than 3 %. A phone's main camera takes in 65 to 69, a cropped or zoomed photo less.
"""
MOST_STRETCH = 1.06
"""Length over width up to which a drawn sphere passes for round."""
NEAREST = 0.05
"""Smallest -z of a unit direction that a photo may show: 87 degrees from the axis."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PinholeCamera:
    """The lens of a photo.

    Attributes:
        width, height: of the photo [px].
        focal: distance of the picture plane from the pinhole [px].
    """

    width: int
    height: int
    focal: float

    @classmethod
    def of_fov(cls, width: int, height: int, long_fov_deg: float) -> PinholeCamera:
        """Return the camera whose longer side takes in this angle [degrees]."""
        focal = float(max(width, height) / 2 / np.tan(np.radians(long_fov_deg) / 2))
        return cls(width=width, height=height, focal=focal)

    @property
    def long_fov_deg(self) -> float:
        """Field of view of the longer side [degrees]."""
        return float(np.degrees(2 * np.arctan(max(self.width, self.height) / 2 / self.focal)))

    def rays(self, x, y) -> np.ndarray:
        """Return directions [..., 3] with z = -1 through points of the photo; pixel i covers [i, i + 1)."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        right, up = (x - self.width / 2) / self.focal, (self.height / 2 - y) / self.focal
        return np.stack([right, up, -np.ones_like(x)], axis=-1)

    def ray(self, point: tuple[float, float]) -> np.ndarray:
        """Return the unit direction [3] through a point of the photo."""
        toward = self.rays(*point)
        return toward / np.linalg.norm(toward)

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return where points [..., 3] in front of the camera appear, [..., 2] px."""
        depth = np.maximum(-points[..., 2], 1e-6)
        x = self.width / 2 + self.focal * points[..., 0] / depth
        return np.stack([x, self.height / 2 - self.focal * points[..., 1] / depth], axis=-1)

    def shows(self, d: np.ndarray) -> np.ndarray:
        """Return which unit directions [..., 3] are inside the photo."""
        x, y = np.moveaxis(self.pixels(d), -1, 0)
        return (d[..., 2] < -NEAREST) & (x > 0) & (x < self.width) & (y > 0) & (y < self.height)

    def stretch(self, x: float, y: float) -> float:
        """Return the length over the width of a small sphere drawn at a point: 1 / cos of the angle to the axis.

        Its cone of directions meets the picture plane in an ellipse, longer along the radius.
        """
        return float(np.linalg.norm(self.rays(x, y)))


def draw_on_sphere(
    picture: np.ndarray, camera: PinholeCamera, frame_from_camera: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw a photo into the map of a frame.

    Args:
        picture: [H, W, C], of any size, of the camera's photo; it is shrunk by means over areas to the map's pixels.
        frame_from_camera: [3, 3] rotation.
    Returns:
        [rows, 2 rows, C] float32, zero outside the photo, and which directions are inside it [rows, 2 rows].
    """
    scale = min(1.0, rows / np.pi / camera.focal)
    size = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    size = min(size[0], picture.shape[1]), min(size[1], picture.shape[0])
    d = pixel_directions(rows) @ np.asarray(frame_from_camera, np.float32)  # R^T d
    inside = camera.shows(d)
    x, y = np.moveaxis(camera.pixels(d[inside]), -1, 0)
    drawn = np.zeros((rows, 2 * rows, picture.shape[2]), np.float32)
    x, y = x * (size[0] / camera.width) - 0.5, y * (size[1] / camera.height) - 0.5
    drawn[inside] = between(resample(picture, size), x, y)
    return drawn, inside

"""The photo's camera over a horizontal plane, and the place of the real object on it.

Everything is in the camera's frame (+X right, +Y up, looking along -Z); the unit of length is the
camera's height over the ground, which a photo does not determine and nothing here needs.
"""

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.camera import PinholeCamera
from anyprobe.core.frames import orthonormal_basis
from anyprobe.errors import InputError
from anyprobe.estimate.ground import GIVEN, LEAST_SLOPE_DEG, Ground, estimate_ground, pitch_words, up_of
from anyprobe.estimate.normals_hint import Part
from anyprobe.estimate.photo import Photo

VIEW_STRIP_PIXELS = 1 << 18
"""Pixels whose places on the ground are computed at once, some 200 bytes each."""

LEAST_ROLL_DEG = 4.0
"""Smallest estimated roll [degrees] that is used; one below it may as well be none."""

LEAST_ABOVE = 0.02
"""Distance below the horizon from which ground is used, as a share of the photo's height."""


@dataclass(frozen=True, kw_only=True, slots=True)
class View(PinholeCamera):
    """The photo's camera over the plane up . x = -1; up: [3] unit vector away from the ground."""

    up: np.ndarray

    @property
    def farthest_row(self) -> float:
        """First row of the ground that is used, a little below the horizon."""
        return self.height / 2 - self.focal * float(self.up[2] / self.up[1]) + LEAST_ABOVE * self.height

    def on_ground(self, x, y) -> np.ndarray:
        """Return the points [..., 3] of the ground seen at x, y; NaN from the horizon upwards."""
        rays = self.rays(x, y)
        down = -(rays @ self.up)
        return rays / np.where(down > 1e-4, down, np.nan)[..., None]

    def part_around(self, point: np.ndarray, reach: float) -> Part:
        """Return rows and columns of the photo that show the square of ground [-reach, reach] along
        orthonormal_basis(up).

        The whole photo if that reaches the camera.
        """
        side, across = orthonormal_basis(self.up)
        corners = point + reach * np.array([x * side + y * across for x in (-1, 1) for y in (-1, 1)])
        if corners[:, 2].max() >= -1e-3:
            return slice(0, self.height), slice(0, self.width)
        pixels, sides = self.pixels(corners), np.array([self.width, self.height])
        left, top = np.floor(np.clip(pixels.min(axis=0), 0, sides)).astype(int)
        right, bottom = np.ceil(np.clip(pixels.max(axis=0), 0, sides)).astype(int)
        return slice(top, bottom), slice(left, right)

    def strips(self, part: Part) -> list[Part]:
        """Return the pixels of a part of the photo, from the top down, a few rows at a time."""
        lines, columns = part
        step = max(1, VIEW_STRIP_PIXELS // max(columns.stop - columns.start, 1))
        tops = range(lines.start, lines.stop, step)
        return [(slice(top, min(top + step, lines.stop)), columns) for top in tops]


def view_of(
    photo: Photo, pitch_deg: float | None = None, found: Ground | None = None, long_fov_deg: float | None = None
) -> tuple[View, float]:
    """Return the photo's camera over its ground, and the pitch used.

    Args:
        pitch_deg: camera pitch downwards; None: the photo's own.
        found: the ground estimated with the light; None: estimate_ground's guess. Unless the pitch is given, the camera
            sees the ground at the base at least LEAST_SLOPE_DEG below the horizon.
        long_fov_deg: the lens estimated with the light; None: the photo's.
    Raises:
        InputError: the base would lie at or above the horizon.
    """
    height, width = photo.mask.shape
    focal = PinholeCamera.of_fov(width, height, long_fov_deg or photo.long_fov_deg).focal
    ground = estimate_ground(photo, pitch_deg=pitch_deg)
    if found is not None and ground.source != GIVEN:
        ground = replace(ground, pitch_deg=found.pitch_deg, source=found.source)
    base = ground.contact[1]
    below_axis = np.degrees(np.arctan2(base - height / 2, focal))
    pitch_deg = ground.pitch_deg
    if ground.source != GIVEN:
        pitch_deg = float(max(pitch_deg, LEAST_SLOPE_DEG - below_axis))
    if not (-60 <= pitch_deg <= 90 and below_axis + pitch_deg > 1.0):
        raise InputError(
            f"expected the object's base below the horizon, got a camera that looks "
            f"{pitch_words(pitch_deg)} and a base {below_axis:.0f} degrees below its axis; give another",
            subject="pitch_deg",
        )
    known = found if found is not None else ground
    roll_deg = known.roll_deg if known.is_known or abs(known.roll_deg) >= LEAST_ROLL_DEG else 0.0
    up = up_of(pitch_deg, roll_deg)
    return View(width=width, height=height, focal=focal, up=up), pitch_deg

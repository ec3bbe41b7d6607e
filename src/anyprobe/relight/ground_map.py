"""Ground maps: the photo's ground as an object mirrors it below the horizon.

The ground is seen from the object's middle, so that one map serves all of its points. Ground outside the photo or
hidden by the real object is what the map shows in its direction; the object's own shadow lies on it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.core.color import luminance
from anyprobe.core.frames import orthonormal_basis
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.core.response import response
from anyprobe.estimate.photo import Photo
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import Placement
from anyprobe.relight.shadow import GroundShadow

if TYPE_CHECKING:
    from jaxtyping import Float

_ROWS = 128
"""Smallest number of rows of the map."""

EDGE = 0.08
"""Width of the photo's rim, as a share of its shorter side, over which its pixels blend into the mean colour."""


RIM = 0.004
"""Width of the rim around the real object that is not taken for ground, as a share of the photo's longer side."""
DARK_GROUND = 0.25
"""Median display luminance of a ground on which shadows hardly show: with half of its light it is .08 darker."""
RING_RADII, RING_POINTS = (0.6, 0.8, 1.0, 1.2, 1.4), 64
"""Where that is read around the foot, in radii of the object, and at how many points of each circle."""


class GroundPicture:
    """The ground as the photo shows it; elsewhere what a map shows in the same direction from the camera."""

    def __init__(self, photo: Photo, view: View, radiance: np.ndarray) -> None:
        """Keep photo, camera and map [H, 2H, 3] in the camera's frame."""
        self.photo, self.view, self.radiance = photo, view, radiance
        hidden = photo.mask if photo.hidden is None else np.maximum(photo.mask, photo.hidden)
        reach = 2 * max(1, round(RIM * max(hidden.shape))) + 1
        grown = Image.fromarray((hidden > 0.02).astype(np.uint8)).filter(ImageFilter.MaxFilter(reach))
        self.free = np.asarray(grown) == 0

    def at(self, points: np.ndarray, shadow: GroundShadow) -> np.ndarray:
        """Return linear radiance [P, 3] of points of the ground in the object's shadow, and in the real one's."""
        photo, view = self.photo, self.view
        pixels = view.pixels(points)
        border = np.minimum(pixels, [view.width, view.height] - pixels).min(axis=-1)
        weight = np.clip(border / (EDGE * min(view.width, view.height)), 0.0, 1.0) * (points[:, 2] < -1e-3)
        column, row = np.clip(pixels, 0, [view.width - 1, view.height - 1]).astype(int).T
        weight = (weight * self.free[row, column])[:, None]
        shown = photo.linear((row, column))
        toward = points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-9)
        around = bilinear(self.radiance, direction_to_uv(toward.astype(np.float32)))
        return weight * shown * shadow.at(points) + (1 - weight) * around * shadow.at(points, with_beside=True)


def hides_shadows(photo: Photo, view: View, spot: Placement) -> bool:
    """Return whether the ground that a photo shows around a foot is mostly too dark for shadows to be seen."""
    side, across = orthonormal_basis(view.up)
    angle = np.linspace(0, 2 * np.pi, RING_POINTS, endpoint=False)
    around = np.cos(angle)[:, None] * side + np.sin(angle)[:, None] * across
    points = spot.foot + spot.radius * np.concatenate([radius * around for radius in RING_RADII])
    seen = seen_ground(photo, view, points)
    shown = luminance(response(seen[np.isfinite(seen).all(axis=-1)]))
    return len(shown) > 0 and bool(np.median(shown) < DARK_GROUND)


def seen_ground(photo: Photo, view: View, points: np.ndarray) -> np.ndarray:
    """Return linear radiance [P, 3] of points of the ground; NaN where the photo does not show them."""
    column, row = np.floor(view.pixels(points)).T
    seen = (column >= 0) & (column < view.width) & (row >= 0) & (row < view.height) & (points[:, 2] < 0)
    column, row = (np.where(seen, of, 0).astype(int) for of in (column, row))
    seen &= photo.mask[row, column] < 0.5
    if photo.hidden is not None:
        seen &= ~photo.hidden[row, column]
    return np.where(seen[:, None], photo.linear((row, column)), np.nan)


def with_ground(ground: GroundPicture, spot: Placement, shadow: GroundShadow) -> Float[np.ndarray, "K 2*K 3"]:
    """Return a ground's map, in the camera's frame and of at least _ROWS rows, with the ground and the shadow on it
    below the horizon."""
    view, radiance = ground.view, ground.radiance
    times = max(1, _ROWS // radiance.shape[0])
    light = radiance.repeat(times, axis=0).repeat(times, axis=1)  # power is neither lost nor moved
    directions = pixel_directions(len(light))
    sine = directions @ view.up
    share = np.clip(0.5 - sine * len(light) / np.pi, 0.0, 1.0)  # of a pixel below the horizon
    below = share > 0
    height = float(((spot.mesh.positions - spot.foot) @ view.up).max()) / 2
    toward = directions[below]
    landed = spot.foot + height * view.up + toward * (height / np.maximum(-sine[below], 1e-3))[:, None]
    weight = share[below][:, None]
    result = light.astype(np.float32, copy=True)
    result[below] = result[below] * (1 - weight) + ground.at(landed, shadow) * weight
    return result

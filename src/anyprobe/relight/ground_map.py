"""Ground maps: the photo's ground as an object mirrors it below the horizon.

The ground is seen from the object's middle, so that one map serves all of its points. Ground outside the photo or
hidden by the real object has the mean colour around the object's foot; the object's own shadow lies on it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.latlong import uv_to_direction
from anyprobe.core.response import inverse_response
from anyprobe.estimate.photo import Photo
from anyprobe.relight.ground_view import View
from anyprobe.relight.placement import Placement
from anyprobe.relight.shadow import GroundShadow

if TYPE_CHECKING:
    from jaxtyping import Float

_ROWS = 128
"""Smallest number of rows of the map."""

MOST_SIDE = 512
"""Largest length [px] of the photo's longer side; larger ones are reduced."""

EDGE = 0.08
"""Width of the photo's rim, as a share of its shorter side, over which its pixels blend into the mean colour."""


def with_ground(
    photo: Photo,
    view: View,
    spot: Placement,
    radiance: Float[np.ndarray, "H 2*H 3"],
    color: np.ndarray,
    shadow: GroundShadow | None = None,
) -> Float[np.ndarray, "K 2*K 3"]:
    """Add the ground below the horizon to a map in the camera's frame, of at least _ROWS rows.

    Args:
        color: [3], linear radiance of the ground outside the photo.
        shadow: on the ground; None: none.
    """
    times = max(1, _ROWS // radiance.shape[0])
    light = radiance.repeat(times, axis=0).repeat(times, axis=1)  # power is neither lost nor moved
    rows = light.shape[0]
    v, u = ((np.arange(n) + 0.5) / n for n in (rows, 2 * rows))
    directions = uv_to_direction(np.stack(np.meshgrid(u, v), axis=-1))
    sine = directions @ view.up
    share = np.clip(0.5 - sine * rows / np.pi, 0.0, 1.0)  # of a pixel below the horizon
    below = share > 0
    height = float(((spot.mesh.positions - spot.foot) @ view.up).max()) / 2
    toward = directions[below]
    landed = spot.foot + height * view.up + toward * (height / np.maximum(-sine[below], 1e-3))[:, None]
    seen = _seen(photo, view, landed, np.asarray(color, np.float64))
    if shadow is not None:
        seen = seen * shadow.at(landed)
    weight = share[below][:, None]
    result = light.astype(np.float32, copy=True)
    result[below] = result[below] * (1 - weight) + seen * weight
    return result


def _seen(photo: Photo, view: View, points: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Return linear radiance [P, 3] of points of the ground."""
    step = -(-max(view.width, view.height) // MOST_SIDE)
    rgb, hidden = photo.rgb[::step, ::step], photo.mask[::step, ::step]
    pixels = view.pixels(points)
    border = np.minimum(pixels, [view.width, view.height] - pixels).min(axis=-1)
    weight = np.clip(border / (EDGE * min(view.width, view.height)), 0.0, 1.0) * (points[:, 2] < -1e-3)
    column, row = (np.clip(pixels // step, 0, [rgb.shape[1] - 1, rgb.shape[0] - 1])).astype(int).T
    if photo.hidden is not None:
        hidden = np.maximum(hidden, photo.hidden[::step, ::step])
    weight = (weight * (1 - hidden[row, column]))[:, None]
    return weight * inverse_response(rgb[row, column]) + (1 - weight) * color

"""How far lights are from where they should be: the peak, and every light with its nearest partner."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from anyprobe.core.color import REC709, luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.filtering import blur_cap
from anyprobe.light.light_sources import connected, dilate
from anyprobe_train.evaluate.metrics import direction_error_deg

PEAK_RADIUS = np.radians(5.0)
"""Radius of the cap that luminance is averaged over before the peak is taken; the field leaves it open."""
LOBE_LEVEL = 0.3
LEFT_ENERGY = 0.2
MOST_BLOBS = 15
MOST_AREA, MOST_WIDTH = 0.5, 0.9
"""A blob of more than these shares of the map's pixels or columns is no light."""
MATCHED = 5


def peak_direction(radiance: np.ndarray) -> np.ndarray:
    """Direction [3] of the largest luminance of a map [H, 2H, 3] after a mean over 5 degrees around."""
    blurred = blur_cap(luminance(radiance)[..., None], PEAK_RADIUS)[..., 0]
    return pixel_directions(radiance.shape[0])[np.unravel_index(np.argmax(blurred), blurred.shape)]


def find_lights(radiance: np.ndarray, published: bool = False) -> list[np.ndarray]:
    """Directions of a map's lights after EnvMapNet's recipe, brightest first.

    The map, weighted by solid angle, is peeled: the connected part of at least 0.3 of the peak is
    taken off until a fifth of the energy is left or 15 parts are found. Parts of more than half of
    the area or nine tenths of the width are dropped; those two pixels apart are one light.

    published: grey as the published code has it, 0.0722 times blue, and lights in raster order.
    """
    height = radiance.shape[0]
    grey = radiance[..., 2] * REC709[2] if published else luminance(radiance)
    energy = grey.astype(np.float64) * pixel_solid_angles(height)
    left, total = energy.copy(), energy.sum()
    found = np.zeros(energy.shape, bool)
    for _ in range(MOST_BLOBS):
        peak = left.max()
        if peak <= 0 or left.sum() <= LEFT_ENERGY * total:
            break
        row, column = np.unravel_index(np.argmax(left), left.shape)
        blob = connected(left >= LOBE_LEVEL * peak, row, column)
        left[blob] = 0.0
        wide = blob.any(axis=0).mean() > MOST_WIDTH
        if blob.mean() <= MOST_AREA and not wide:
            found |= blob
    merged = dilate(dilate(found))
    lights = []
    d = pixel_directions(height)
    while merged.any():
        row, column = np.argwhere(merged)[0]
        blob = connected(merged, row, column)
        merged &= ~blob
        weight = (blob & found) * (pixel_solid_angles(height) if published else energy)
        mean = np.einsum("hw,hwc->c", weight, d)
        length = np.linalg.norm(mean)
        if length > 1e-12:
            lights.append((0.0 if published else -float(weight.sum()), mean / length))
    return [direction for _, direction in sorted(lights, key=lambda one: one[0])]


def matched_lights_deg(a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> float | None:
    """Mean angle from each of the first five lights of one map to the nearest of the other's, both ways.

    a, b: of find_lights. None where either has none.
    """
    count = min(MATCHED, len(a), len(b))
    return nearest_mean_deg(a[:count], b[:count]) if count else None


def nearest_mean_deg(a: Sequence[np.ndarray], b: Sequence[np.ndarray]) -> float:
    """Half the sum of the mean nearest angles from a to b and from b to a [degrees]."""
    angles = np.array([[direction_error_deg(one, other) for other in b] for one in a])
    return float((angles.min(axis=0).mean() + angles.min(axis=1).mean()) / 2)

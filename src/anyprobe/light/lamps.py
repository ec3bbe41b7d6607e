"""Lamps: what is brightest in a map, taken out of it, so that shading adds it exactly instead of by samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from array_api_compat import array_namespace, to_device

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles

WIDENING = 0.75
"""To second order in a lamp's size, the mean of D over it has the peak of a D whose alpha^2 is greater by 1 - r (half
vectors turn half as far). Its flanks are narrower than that D's: a little less errs least over the whole lobe."""


def take_pixels(radiance, count: int) -> tuple[Any, Any, Any]:
    """The map [H, 2H, 3] without, and directions and flux [K, 3] of, what its brightest pixels have in excess."""
    xp = array_namespace(radiance)
    height = radiance.shape[0]
    flat = xp.reshape(radiance, (-1, 3))
    order = xp.flip(xp.argsort(luminance(flat)), axis=0)
    count = min(count, len(order) - 1)
    chosen, cap = order[:count], luminance(flat)[order[count]]
    bright = xp.take(flat, chosen, axis=0)
    excess = bright * (1.0 - cap / xp.clip(luminance(bright), 1e-12, None))[:, None]
    rest = xp.asarray(flat, copy=True)
    rest[chosen] = bright - excess
    directions = np.reshape(pixel_directions(height), (-1, 3)).astype(np.float32)
    solid_angles = np.repeat(pixel_solid_angles(height), 2 * height, axis=1).reshape(-1, 1)
    of_pixels = [xp.asarray(values, device=radiance.device) for values in (directions, solid_angles)]
    directions, solid_angles = (xp.take(values, chosen, axis=0) for values in of_pixels)
    return xp.reshape(rest, radiance.shape), directions, excess * solid_angles


def take_patches(radiance, count: int, patch: np.ndarray) -> tuple[Any, Any, Any, Any]:
    """The same of whole patches of the sphere: what all their pixels have above the next patch's brightest.

    A lamp in a room covers many pixels of one brightness, and few of them would leave nearly all of it.

    Args:
        patch: [H * 2H] int, the patch of every pixel.
    Returns:
        rest [H, 2H, 3]; directions, the middles of the lamps, and flux [K, 3]; spread [K]: what their sizes
        add to alpha^2, WIDENING (1 - r), r the length of a lamp's mean direction.
    """
    xp = array_namespace(radiance)
    height = radiance.shape[0]
    flat = np.asarray(to_device(radiance, "cpu"), np.float64).reshape(-1, 3)
    bright = luminance(flat)
    highest = np.zeros(int(patch.max()) + 1)
    np.maximum.at(highest, patch, bright)
    order = np.argsort(-highest, kind="stable")
    count = min(count, len(order) - 1)
    cap = highest[order[count]]
    pixels = np.flatnonzero(bright > cap)  # all of them lie in the chosen patches
    lamp = np.argsort(order, kind="stable")[patch[pixels]]
    excess = flat[pixels] * (1.0 - cap / bright[pixels])[:, None]
    flux = excess * np.repeat(pixel_solid_angles(height), 2 * height, axis=1).reshape(-1, 1)[pixels]
    rest = flat.copy()
    rest[pixels] -= excess

    def total(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(lamp, column, minlength=count) for column in values.T], axis=-1)

    weight = luminance(flux)[:, None]
    pointing = total(pixel_directions(height).reshape(-1, 3)[pixels] * weight)
    length = np.linalg.norm(pointing, axis=1)
    directions = np.where(length[:, None] > 0, pointing / np.maximum(length, 1e-30)[:, None], (0.0, 1.0, 0.0))
    spread = WIDENING * np.clip(1.0 - length / np.maximum(total(weight)[:, 0], 1e-30), 0.0, None)
    found = (rest.reshape(radiance.shape), directions, total(flux), np.where(length > 0, spread, 0.0))
    return tuple(xp.asarray(values.astype(np.float32), device=radiance.device) for values in found)

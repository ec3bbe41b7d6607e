"""Classification as indoors or outdoors, of a photo's surroundings and of panoramas.

A photo is outdoors if it shows sky, bright and bluish above, or plants; one colour behind the object is a studio's. A
panorama is outdoors if its upper part is blue and brighter than its lower one, and its lower part green. Both are
sometimes wrong; therefore a mismatch costs a little and excludes nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import reduced
from anyprobe.match.library import Library
from anyprobe.notices import Notice
from anyprobe.place.plate import Plate

KIND_ROWS = 32
"""Rows at which panoramas are classified."""
UPPER, LOWER = np.sin(np.radians(35.0)), -0.3
"""Smallest and largest y of the upper and of the lower part."""
BRIGHTER, BLUE, GREEN = 0.49, 2.24, 0.93
"""Weights of the upper part's ln brightness over the lower one's, of its ln of blue over red, and of the greenness.

Greenness is the ln of green squared over red and blue that a fifth of the low part exceeds. A logistic fit to 99
training maps, of which it misclassifies 8; of 30 test maps 6.
"""
LOW, GREENEST = 0.3, 0.8
"""Largest y of what may be green, and the quantile."""
OUTDOORS = 0.71
"""Score of a panorama above which it counts as outdoors."""
SKY_SHARE, PLANT_SHARE = 0.12, 0.15
"""Smallest shares of sky and of plants beside the object in an outdoor photo."""
PLAIN_BACKDROP = "plain-backdrop"
"""Code of the warning that a photo's object stands before a single colour."""
PRICE = 0.5
"""Penalty of a panorama of the other kind, in units of the misfit of likeness."""


def shows_outdoors(plate: Plate) -> bool:
    """Return whether a photo shows sky or plants beside its object."""
    free = plate.hidden < 20
    if not free.any():
        return False
    rgb = plate.rgb.astype(np.float32) / 255
    red, green, blue = np.moveaxis(rgb, -1, 0)
    upper = np.arange(len(rgb))[:, None] < 0.5 * len(rgb)
    smooth = np.zeros_like(free)
    smooth[:, 1:] = np.abs(np.diff(rgb, axis=1)).max(axis=-1) < 0.03
    sky = (blue > 1.2 * red) & (blue > 0.95 * green) & (blue > 0.5) & smooth & upper
    plants = (green > 1.08 * red) & (green > 1.25 * blue) & (green > 0.08)
    return bool((sky & free).sum() > SKY_SHARE * free.sum() or (plants & free).sum() > PLANT_SHARE * free.sum())


def outdoor_scores(maps: np.ndarray) -> np.ndarray:
    """Score how much each panorama [N, 32, 64, 3] looks like outdoors, [N]; OUTDOORS is the threshold."""
    d = pixel_directions(KIND_ROWS)[..., 1]
    upper, lower = d > UPPER, d < LOWER
    level = maps.mean(axis=-1)
    ln = np.log(level + 1e-3 * level.mean(axis=(1, 2), keepdims=True) + 1e-9)
    brighter = np.median(ln[:, upper], axis=1) - np.median(ln[:, lower], axis=1)
    red, green, blue = np.moveaxis(np.log(np.maximum(maps, 1e-9)), -1, 0)
    bluish = np.median((blue - red)[:, upper], axis=1)
    greenish = np.quantile((2 * green - red - blue)[:, d < LOW], GREENEST, axis=1)
    return BRIGHTER * brighter + BLUE * bluish + GREEN * greenish


def is_outdoors(radiance: np.ndarray) -> bool:
    """Return whether a panorama [H, 2H, 3] counts as outdoors."""
    return bool(outdoor_scores(reduced(radiance, KIND_ROWS)[None])[0] > OUTDOORS)


def photo_outdoors(plate: Plate | None, warnings: Iterable[Notice]) -> bool | None:
    """Return whether a photo is outdoors, by what it shows beside its object; None where that is nothing.

    A backdrop of one colour is a studio's.
    """
    if plate is not None:
        return shows_outdoors(plate)
    return False if any(one.code == PLAIN_BACKDROP for one in warnings) else None


def are_outdoors(library: Library) -> np.ndarray:
    """Return whether each map of a library is outdoors, [N]."""
    return outdoor_scores(library.lights) > OUTDOORS


def prices(outdoors: bool | None, library: Library, price: float) -> np.ndarray:
    """Return each map's penalty [N] for a kind other than the photo's; zeros where that is None."""
    if outdoors is None:
        return np.zeros(len(library.names), np.float32)
    return np.where(are_outdoors(library) != outdoors, price, 0.0).astype(np.float32)

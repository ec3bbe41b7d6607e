"""Continuation of a photo all around, and through the place of its object.

In a level panorama one row is one elevation: the same distance on the ground, or the same height on a wall or in the
sky. So colours are spread along rows far more than across them (detail.spread): next to the photo they are its own,
farther away ever wider means. What they lack in texture is noise with the power and the columns of what is seen
(detail.noise), which has no piece that could be recognised. Below the photo the texture is that of the plane under
the camera, seen from above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.detail.angles import angles_from
from anyprobe.detail.noise import along_rows, of_patch
from anyprobe.detail.spread import spread
from anyprobe.match.plate import DrawnPlate
from anyprobe.pictures.resampling import between

CONTINUED_FLOOR = 0.02
"""Radiance added before its logarithm."""
LEAST_WIDTH = 0.45
"""Smallest width of a row in the photo, as a share of the widest, from which texture is taken."""
LEAST_CLEAR = 0.02
"""Smallest share of the panorama that must be seen."""
FADE_DEG = 3.0
"""Elevation [degrees] above the photo over which its rows' texture fades by a factor e."""
PLANE = 0.8, 0.4
"""Elevations, in that of the photo's lowest row, between which the ground's texture replaces that of rows."""
HORIZON_DEG = -6.0
"""Elevation [degrees] below which rows are ground."""
EDGE_DEG = 2.0
"""Height [degrees] of the band at the photo's border whose mean prolongs a column."""
TALL = 0.85
"""Smallest height of a column, in that of the tallest, that is prolonged."""
PROLONGED = 0.4
"""Weight of what is prolonged."""
MERGED_DEG = 25.0
"""Elevation [degrees] above or below the photo at which all azimuths have merged."""
POLE_DEG = (50.0, 80.0)
"""Elevations [degrees] between which all azimuths merge into one, and the ground's texture fades."""
GROUND_PX, GROUND_REACH = 512, 1.25
"""Side of the ground's picture seen from above, and half of it in radii of the circle outside the photo."""
GRAIN, HUELESS = 0.8, 0.5
"""Contrast of textures relative to the seen one, and share of their colour that they lose."""
MOST_GRAIN = 0.25
"""Largest standard deviation of ln radiance of a texture; a stronger pattern is not noise."""
EVEN, EVEN_GROUND = (0.6, 0.8), (0.4, 0.7)
"""Median absolute fine detail over its deviation, 1 for Gaussian noise, between which rows and ground are textures."""
DEPTH_DEG = 2.0
"""Distance [degrees] into the object's place over which the texture of patches gives way to noise by a factor e."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Continued:
    """Continuation: ln [R, 2R, 3] of radiance + CONTINUED_FLOOR, and elevation [degrees] of the photo's top row.

    within: ln of the photo with its object's place filled anew.
    """

    ln: np.ndarray
    within: np.ndarray
    top: float


def continue_around(seen: DrawnPlate) -> Continued | None:
    """Continue what a level panorama shows; None where it shows too little."""
    rows = len(seen.margin)
    per_deg = rows / 180.0
    inside = seen.margin > 0.0
    clear = np.where(inside, np.clip(1.0 - 1.5 * seen.filled, 0.0, 1.0), 0.0).astype(np.float32)
    widths = inside.sum(axis=1)
    used = np.flatnonzero(widths >= max(LEAST_WIDTH * widths.max(), 6))
    if len(used) < 4 or clear.sum() < LEAST_CLEAR * inside.sum():
        return None
    first, last = int(used[0]), int(used[-1])
    elevation = 90.0 - (np.arange(rows) + 0.5) / per_deg
    ln = np.log(seen.radiance + CONTINUED_FLOOR)
    column = np.flatnonzero(inside.any(axis=0))
    photo = slice(int(column[0]), int(column[-1]) + 1)
    values, weight = ln.copy(), clear.copy()
    values[:, photo], weight[:, photo] = _prolonged(ln[:, photo], clear[:, photo], inside[:, photo], per_deg)
    base = spread(values, weight)
    part, known = ln[:, photo], clear[:, photo]
    fine = (part - base[:, photo]) * known[..., None]
    mean = (part * known[..., None]).sum(axis=1) / np.maximum(known.sum(axis=1), 1e-3)[:, None]
    texture = np.zeros_like(ln)
    texture[:, photo] = _calmer((part - mean[:, None]) * known[..., None], fine, known, EVEN)
    grain = along_rows(texture, clear, seed=1)
    row = np.arange(rows)
    beyond = np.maximum(np.maximum(first - row, row - last), 0)
    mirrored = np.clip(np.where(row < first, 2 * first - row, np.where(row > last, 2 * last - row, row)), first, last)
    grain = grain[mirrored] * np.exp(-beyond / per_deg / FADE_DEG).astype(np.float32)[:, None, None]
    if elevation[last] < HORIZON_DEG:
        _lay_ground(grain, fine, known, last, elevation)
    high = np.clip((np.abs(elevation) - POLE_DEG[0]) / (POLE_DEG[1] - POLE_DEG[0]), 0.0, 1.0)
    merged = np.maximum(high, np.clip(beyond / per_deg / MERGED_DEG, 0.0, 1.0))[:, None, None]
    merged = (merged * merged * (3 - 2 * merged)).astype(np.float32)
    high = high[:, None, None].astype(np.float32)
    around = base + merged * (base.mean(axis=1, keepdims=True) - base) + (1 - high) * grain
    near = np.exp(-angles_from(clear) / DEPTH_DEG)[..., None].astype(np.float32)
    patches = ln - spread(ln, inside.astype(np.float32))
    behind = around + near * (base + patches - around)
    within = ln + (1 - clear[..., None]) * (behind - ln)
    return Continued(ln=around, within=within, top=float(elevation[first]))


def _prolonged(ln: np.ndarray, clear: np.ndarray, inside: np.ndarray, per_deg: float) -> tuple[np.ndarray, np.ndarray]:
    """Prolong columns up and down by the mean of their borders, where these are the photo's, not the object's."""
    rows = len(ln)
    row = np.arange(rows)[:, None]
    edge = max(2, round(EDGE_DEG * per_deg))
    tall = inside.sum(axis=0)
    is_whole = tall > TALL * tall.max()
    sums = np.cumsum(np.concatenate([ln * clear[..., None], clear[..., None]], axis=-1), axis=0)
    column = np.arange(ln.shape[1])
    values, weight = ln, clear
    top, bottom = inside.argmax(axis=0), rows - 1 - inside[::-1].argmax(axis=0)
    for first, beyond in ((top, row < top), (bottom - edge, row > bottom)):
        last = np.clip(first + edge, 0, rows - 1)
        total = sums[last, column] - sums[np.clip(first, 0, rows - 1), column]
        seen = is_whole & (total[:, -1] > 0.7 * edge)
        total = np.stack([_along(one, 2 * edge) for one in (total * seen[:, None]).T], axis=-1)
        mean = total[:, :-1] / np.maximum(total[:, -1:], 1e-3)
        values = np.where(beyond[..., None], mean[None], values)
        weight = np.where(beyond, PROLONGED * seen, weight)
    return values.astype(np.float32), weight.astype(np.float32)


def _calmer(texture: np.ndarray, fine: np.ndarray, weight: np.ndarray, even: tuple[float, float]) -> np.ndarray:
    """Return a texture [H, W, 3] of GRAIN of its contrast and of less colour.

    Rows in whose fine part a few places differ much from a calm rest have edges of things, no texture: they fade.
    even: median absolute fine detail over its deviation as of Gaussian noise, between which rows are texture.
    """
    grey = texture.mean(axis=-1, keepdims=True)
    texture = texture + HUELESS * (grey - texture)
    reach = max(1, len(texture) // 60)
    known = weight > 0.5
    count = np.maximum(known.sum(axis=1), 1)
    fine = np.where(known, np.abs(fine.mean(axis=-1)), np.inf)
    typical = np.sort(fine, axis=1)[np.arange(len(fine)), count // 2] / 0.6745
    deviation = np.sqrt((np.where(known, fine, 0.0) ** 2).sum(axis=1) / count)
    ratio = np.where(np.isfinite(typical), typical, 0.0) / np.maximum(deviation, 1e-6)
    share = _along(np.clip((ratio - even[0]) / (even[1] - even[0]), 0.0, 1.0), reach)
    whole = np.sqrt(_along((grey[..., 0] ** 2 * weight).sum(axis=1), reach) / _along(count, reach))
    gain = GRAIN * share / np.sqrt(1 + (GRAIN * whole / MOST_GRAIN) ** 2)
    return texture * gain[:, None, None].astype(np.float32)


def _along(values: np.ndarray, reach: int) -> np.ndarray:
    """Average values [N] over 2 reach + 1 of them."""
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), mode="valid")


def _lay_ground(grain: np.ndarray, texture: np.ndarray, clear: np.ndarray, last: int, elevation: np.ndarray) -> None:
    """Give rows below the last one the texture of the plane under the camera; modifies grain.

    texture, clear: [R, P, 3] of what is seen, zero elsewhere, and [R, P], of the photo's columns.
    """
    rows, width = grain.shape[:2]
    near = 1 / np.tan(np.radians(-elevation[last]))  # the circle's radius over the camera's height
    scale = GROUND_PX / (2 * GROUND_REACH * near)  # pixels to the camera's height
    wide = near * np.sin(min(texture.shape[1] * np.pi / width, 1.2))
    across = np.arange(max(8, round(2 * wide * scale))) / scale
    along = np.arange(GROUND_PX // 3) / scale
    x, z = np.meshgrid(across - across[-1] / 2, -near - along[::-1])
    row = (90.0 + np.degrees(np.arctan2(1.0, np.hypot(x, z)))) / 180.0 * rows - 0.5
    column = (texture.shape[1] - 1) / 2 + np.arctan2(x, -z) / (2 * np.pi) * width
    patch = between(np.dstack([texture, clear]), column, np.minimum(row, last)).astype(np.float32)
    patch, weight = patch[..., :3], patch[..., 3]
    if weight.sum() < 32:
        return
    patch = patch.reshape(1, -1, 3)
    flat = _calmer(patch, patch, weight.reshape(1, -1), EVEN_GROUND).reshape(*weight.shape, 3)
    plane = of_patch(flat, weight, GROUND_PX, seed=3)
    start = int(np.searchsorted(-elevation, -PLANE[1] * elevation[last]))
    d = pixel_directions(rows)[start:]
    place = d[..., [0, 2]] / np.maximum(-d[..., 1:2], 1e-3) * scale
    laid = between(plane, *np.moveaxis(place % GROUND_PX, -1, 0), wraps=True)
    share = (elevation[start:] / elevation[last] - PLANE[1]) / (PLANE[0] - PLANE[1])
    share = np.clip(share, 0.0, 1.0)[:, None, None].astype(np.float32)
    grain[start:] = np.sqrt(share) * laid + np.sqrt(1 - share) * grain[start:]

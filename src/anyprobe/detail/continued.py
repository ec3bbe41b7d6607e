"""Continuation of a photo all around.

In a level panorama one row is one elevation: the same distance on the ground, or the same height on a wall or in the
sky. So every row is continued by strips of what is seen (detail.quilt), softer the farther from the photo. Above the
photo its upper rows continue, ever softer; below it the ground continues: the colours of its lowest rows, and their
texture seen from above, scattered over the plane under the camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.detail.quilt import continue_right, join_of, smoothed, strewn
from anyprobe.match.plate import DrawnPlate

CONTINUED_FLOOR = 0.02
"""Radiance added before its logarithm."""
LEAST_WIDTH = 0.45
"""Smallest width of a row in the photo, as a share of the widest, that is continued."""
LEAST_KNOWN = 0.7
"""Smallest seen share of a column that is continued."""
SEAM_DEG = 4.0
"""Width [degrees] over which two pieces are mixed."""
MEET_DEG = 10.0
"""The same width behind the camera, where left and right meet."""
SOFT_DEG = (0.0, 0.8, 2.5, 6.0)
"""Standard deviations [degrees] of blurs along rows."""
SOFT_AT_DEG = (4.0, 25.0, 60.0, 130.0)
"""Azimuths [degrees] from the photo's border at which each blur is reached."""
EDGE_SOFT_DEG, EDGE_SOFT_AT_DEG = (0.5, 3.0, 10.0, 40.0), (0.0, 4.0, 14.0, 40.0)
"""The same above and below the photo, by elevation from its border."""
ABOVE_DEG = 4.0
"""Elevation [degrees] above the photo over which its mirrored upper rows decay to their mean by a factor e."""
EDGE_DEG = 1.5
"""Height [degrees] of the band at its border whose mean continues."""
HORIZON_DEG = -6.0
"""Elevation [degrees] below which rows are ground."""
POLE_DEG = (55.0, 84.0)
"""Elevations [degrees] between which all azimuths merge into one."""
GROUND_PX, GROUND_REACH = 384, 1.25
"""Side of the ground's picture seen from above, and half of it in radii of the circle outside the photo."""
GRAIN, HUELESS = 0.75, 0.5
"""Contrast of that texture relative to the seen one, and share of its colour that it loses."""
BLOCK = 0.45
"""Side of the ground texture's blocks, in the same radii."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Continued:
    """Continuation: ln [R, 2R, 3] of radiance + CONTINUED_FLOOR, and elevation [degrees] of the photo's top row."""

    ln: np.ndarray
    top: float


def continue_around(seen: DrawnPlate) -> Continued | None:
    """Continue what a level panorama shows; None where it shows too little."""
    rows = len(seen.margin)
    per_deg = rows / 180.0
    known = seen.margin > 0.0
    widths = known.sum(axis=1)
    used = np.flatnonzero(widths >= max(LEAST_WIDTH * widths.max(), 6))
    if len(used) < 4:
        return None
    first, last = int(used[0]), int(used[-1])
    band = slice(first, last + 1)
    columns = np.flatnonzero(known[band].mean(axis=0) >= LEAST_KNOWN)
    if len(columns) < 6:
        return None
    ring = _sideways(seen, band, int(columns[0]), int(columns[-1]), per_deg)
    elevation = 90.0 - (np.arange(rows) + 0.5) / per_deg
    whole = _upright(ring, first, last, elevation, per_deg)
    high = np.clip((np.abs(elevation) - POLE_DEG[0]) / (POLE_DEG[1] - POLE_DEG[0]), 0.0, 1.0)[:, None, None]
    for beyond in (slice(0, first), slice(last + 1, rows)):
        whole[beyond] += high[beyond] * (whole[beyond].mean(axis=1, keepdims=True) - whole[beyond])
    if elevation[last] < HORIZON_DEG:
        _lay_ground(whole, last, slice(int(columns[0]), int(columns[-1]) + 1), elevation)
    return Continued(ln=whole, top=float(elevation[first]))


def _sideways(seen: DrawnPlate, band: slice, left: int, right: int, per_deg: float) -> np.ndarray:
    """Continue a band's rows, seen from column left to right, all around: [H, 2R, 3]; seen pixels stay."""
    known = seen.margin[band] > 0.0
    ln = np.log(seen.radiance[band] + CONTINUED_FLOOR)
    width = ln.shape[1]
    column = np.arange(width)
    nearest = _nearest_known(known)
    rows = np.arange(len(ln))[:, None]
    source = ln[rows, nearest[:, left : right + 1]]
    filled = np.where(known, seen.filled[band], 1.0)[:, left : right + 1]
    after, before = (column - right) % width, (left - column) % width
    meet, join = MEET_DEG * per_deg, join_of(right - left + 1)
    length = int((width - (right - left)) / 2 + meet)
    to_right = continue_right(source, filled, length, seed=1)
    to_left = continue_right(source[:, ::-1], filled[:, ::-1], length, seed=2)
    share = np.clip(0.5 + (before - after) / (2 * meet), 0.0, 1.0).astype(np.float32)[None, :, None]
    inside = (column >= left) & (column <= right)
    around = np.empty_like(ln)
    around[:, left : right + 1] = source
    around[:, right + 1 - join : right + 1] = to_right[:, :join]
    around[:, left : left + join] = to_left[:, join - 1 :: -1]
    around[:, ~inside] = (
        share * to_right[:, np.clip(join + after - 1, 0, join + length - 1)]
        + (1 - share) * to_left[:, np.clip(join + before - 1, 0, join + length - 1)]
    )[:, ~inside]
    distance = np.where(inside, 0, np.minimum(after, before)) / per_deg
    around = _softer_upright(_softer(around, distance, per_deg), distance, per_deg)
    own = np.clip(_from_border(known) / (SEAM_DEG * per_deg), 0.0, 1.0)[..., None]
    return own * ln + (1 - own) * around


def _nearest_known(known: np.ndarray) -> np.ndarray:
    """Return the column [H, W] of the nearest known pixel of each row; rows without any have their own columns."""
    column = np.broadcast_to(np.arange(known.shape[1]), known.shape)
    left = known.argmax(axis=1)[:, None]
    right = known.shape[1] - 1 - known[:, ::-1].argmax(axis=1)[:, None]
    return np.where(np.any(known, axis=1, keepdims=True), np.clip(column, left, right), column)


def _softer(ring: np.ndarray, distance: np.ndarray, per_deg: float) -> np.ndarray:
    """Blur rows [H, W, 3] along themselves, more with their distance [W] from what is seen."""
    level = np.interp(distance, SOFT_AT_DEG, np.arange(len(SOFT_DEG)))[None, :, None]
    return _between_blurs(ring, SOFT_DEG, level, per_deg)


def _softer_upright(ring: np.ndarray, distance: np.ndarray, per_deg: float) -> np.ndarray:
    """Blur columns too, half as much; beyond the upper and lower border by their mirror images."""
    level = np.interp(distance, SOFT_AT_DEG, np.arange(len(SOFT_DEG)))[:, None, None]
    tall = np.concatenate([ring, ring[::-1]]).transpose(1, 0, 2)
    sigmas = tuple(sigma / 2 for sigma in SOFT_DEG)
    return _between_blurs(tall, sigmas, level, per_deg)[:, : len(ring)].transpose(1, 0, 2)


def _between_blurs(rows: np.ndarray, sigmas_deg: tuple[float, ...], level: np.ndarray, per_deg: float) -> np.ndarray:
    """Blur rows [H, W, 3] along themselves by the deviations at a fractional level, an index into them."""
    width = rows.shape[1]
    waves = np.fft.rfft(rows, axis=1)
    frequency = np.arange(waves.shape[1]) * 2 * np.pi / width
    result = np.zeros(1, np.float32)
    for k, sigma in enumerate(sigmas_deg):
        kernel = np.exp(-0.5 * (frequency * sigma * per_deg) ** 2)[None, :, None]
        blurred = np.fft.irfft(waves * kernel, n=width, axis=1).astype(np.float32) if sigma else rows
        result = result + np.clip(1 - np.abs(level - k), 0.0, 1.0).astype(np.float32) * blurred
    return result


def _from_border(band: np.ndarray) -> np.ndarray:
    """Return the distance [H, W] in pixels to the nearest unseen column of the row, zero where unseen."""
    width = band.shape[1]
    column = np.arange(width)
    left, right = band.argmax(axis=1)[:, None], (width - 1 - band[:, ::-1].argmax(axis=1))[:, None]
    return np.maximum(np.minimum(column - left, right - column), 0).astype(np.float32)


def _upright(ring: np.ndarray, first: int, last: int, elevation: np.ndarray, per_deg: float) -> np.ndarray:
    """Extend rows first to last to all rows [R, 2R, 3]."""
    rows = len(elevation)
    whole = np.empty((rows, *ring.shape[1:]), np.float32)
    whole[first : last + 1] = ring
    edge = max(2, min(round(EDGE_DEG * per_deg), len(ring) // 3))
    reach = len(ring) // 2
    for target, near in ((np.arange(first), ring), (np.arange(last + 1, rows), ring[::-1])):
        distance = np.abs(target - (first if near is ring else last))
        mirrored = near[np.minimum(distance, reach)]
        fade = np.exp(-distance / (ABOVE_DEG * per_deg))[:, None, None].astype(np.float32)
        mean = near[:edge].mean(axis=0, keepdims=True)
        level = np.interp(distance / per_deg, EDGE_SOFT_AT_DEG, np.arange(len(EDGE_SOFT_DEG)))[:, None, None]
        whole[target] = _between_blurs(mean + fade * (mirrored - mean), EDGE_SOFT_DEG, level, per_deg)
    return whole


def _lay_ground(whole: np.ndarray, last: int, columns: slice, elevation: np.ndarray) -> None:
    """Give rows below the last one the texture of the plane under the camera; modifies whole.

    The texture is the difference of the seen columns' lowest rows from their smooth colours, seen from above, in blocks
    scattered over the circle.
    """
    rows, width = whole.shape[:2]
    seam = max(1, round(SEAM_DEG * rows / 180.0))
    near = 1 / np.tan(np.radians(-elevation[last]))  # the circle's radius over the camera's height
    scale = GROUND_PX / (2 * GROUND_REACH * near)  # pixels to the camera's height
    side = max(8, round(BLOCK * near * scale) // 2 * 2)
    wide = near * np.sin(min((columns.stop - columns.start) * np.pi / width, 1.2))
    across = np.arange(max(side, round(2 * wide * scale)) + 1) / scale
    along = np.arange(round(1.6 * side) + 1) / scale
    x, z = np.meshgrid(across - across[-1] / 2, -near - along[::-1])
    row = (90.0 + np.degrees(np.arctan2(1.0, np.hypot(x, z)))) / 180.0 * rows - 0.5
    column = ((columns.start + columns.stop) / 2 / width + np.arctan2(x, -z) / (2 * np.pi)) * width - 0.5
    seen = _between(whole, column, np.minimum(row, last), wraps=True)
    grain = GRAIN * (seen - smoothed(seen, side // 4))
    texture = strewn(grain + HUELESS * (grain.mean(axis=-1, keepdims=True) - grain), side, GROUND_PX, seed=3)
    d = pixel_directions(rows)[last - seam :]
    plane = d[..., [0, 2]] / np.maximum(-d[..., 1:2], 1e-3)
    place = (plane * scale + GROUND_PX / 2) - 0.5
    laid = _between(texture, place[..., 0], np.clip(place[..., 1], 0, GROUND_PX - 1.001), wraps=False)
    share = np.clip(np.arange(len(d)) / (2 * seam), 0.0, 1.0)[:, None, None].astype(np.float32)
    whole[last - seam :] += share * laid


def _between(picture: np.ndarray, column: np.ndarray, row: np.ndarray, *, wraps: bool) -> np.ndarray:
    """Interpolate a picture [H, W, C] at fractional pixels, [..., C]."""
    height, width = picture.shape[:2]
    row = np.clip(row, 0, height - 1.001)
    if not wraps:
        column = np.clip(column, 0, width - 1.001)
    left, top = np.floor(column), np.floor(row)
    fx, fy = ((at - low)[..., None].astype(np.float32) for at, low in ((column, left), (row, top)))
    left, top = left.astype(int) % width, top.astype(int)
    right, below = (left + 1) % width, top + 1
    upper = picture[top, left] * (1 - fx) + picture[top, right] * fx
    return upper * (1 - fy) + (picture[below, left] * (1 - fx) + picture[below, right] * fx) * fy

"""What a photo shows, continued all around.

In a level panorama one row is one height: at the same distance on the ground, as high on a wall or in the sky. So every
row goes on with what is seen of it, back and forth, softer the farther from the photo. Above the photo its upper part
goes on once, upside down, and fades into its mean colour; below it the ground goes on as ground: what is seen of it is
laid over the plane under the camera, as large there as it is seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.latlong import pixel_directions
from anyprobe.match.plate import DrawnPlate

CONTINUED_FLOOR = 0.02
"""Added to radiance before its logarithm."""
LEAST_WIDTH = 0.45
"""Rows that show less of the place than this share of the widest are not continued."""
SEAM_DEG = 5.0
"""Width over which two pieces are mixed."""
TURN = (0.6, 1.0)
"""Shares of the seen width after which a walk over it turns back."""
SOFT_DEG = (0.0, 0.8, 3.0, 9.0)
"""Standard deviations of blurs along rows."""
SOFT_AT_DEG = (3.0, 40.0, 90.0, 160.0)
"""Azimuths from the photo's border at which each of them is reached."""
EDGE_SOFT_DEG, EDGE_SOFT_AT_DEG = (2.0, 8.0, 25.0, 60.0), (0.0, 6.0, 18.0, 40.0)
"""The same of the mean colour above and below the photo, by height from its border."""
ABOVE_SHARE, ABOVE_DEG = 0.35, 6.0
"""Of the photo's rows above its horizon that are repeated above it, and over how many degrees they fade."""
HORIZON_DEG = -4.0
"""Rows below this are ground."""
POLE_DEG = (55.0, 84.0)
"""Heights between which all azimuths become one."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Continued:
    """ln: [R, 2R, 3] of radiance + CONTINUED_FLOOR. top, bottom: elevations of the rows that are continued, degrees."""

    ln: np.ndarray
    top: float
    bottom: float


def continue_around(seen: DrawnPlate) -> Continued | None:
    """Continue what a level panorama shows; None where it shows too little for that."""
    rows = len(seen.margin)
    per_deg = rows / 180.0
    known = seen.margin > 0.0
    widths = known.sum(axis=1)
    used = np.flatnonzero(widths >= max(LEAST_WIDTH * widths.max(), 6))
    if len(used) < 4:
        return None
    first, last = int(used[0]), int(used[-1])
    band = known[first : last + 1]
    common = band.all(axis=0)
    if common.sum() < 6:  # a strongly tilted camera
        common = band[len(band) // 2]
    columns = np.flatnonzero(common)
    ln = np.log(seen.radiance[first : last + 1] + CONTINUED_FLOOR)
    ring = _sideways(ln, band, int(columns[0]), int(columns[-1]), per_deg)
    elevation = 90.0 - (np.arange(rows) + 0.5) / per_deg
    whole = _upright(ring, first, last, elevation, per_deg)
    if elevation[last] < HORIZON_DEG:
        half = np.pi * (columns[-1] - columns[0]) / len(known[0])
        _lay_ground(whole, first, last, elevation, float(half))
    high = np.clip((np.abs(elevation) - POLE_DEG[0]) / (POLE_DEG[1] - POLE_DEG[0]), 0.0, 1.0)[:, None, None]
    above = slice(0, first)
    whole[above] += high[above] * (whole[above].mean(axis=1, keepdims=True) - whole[above])
    return Continued(ln=whole, top=float(elevation[first]), bottom=float(elevation[last]))


def _sideways(ln: np.ndarray, band: np.ndarray, left: int, right: int, per_deg: float) -> np.ndarray:
    """Rows [H, W, 3], of which columns left to right are seen, all around; the seen part itself stays."""
    width = ln.shape[1]
    wide = right - left
    column = np.arange(width)
    after, before = (column - right) % width, (left - column) % width
    turns = np.random.default_rng(1).uniform(*TURN, (2, 8 * (width // max(wide, 1) + 2))) * wide
    from_right = ln[:, np.clip(right - _folded(after, turns[0]), left, right).astype(int)]
    from_left = ln[:, np.clip(left + _folded(before, turns[1]), left, right).astype(int)]
    meet = np.clip(0.5 + (before - after) / (6 * SEAM_DEG * per_deg), 0.0, 1.0)[None, :, None]
    around = meet * from_right + (1 - meet) * from_left  # which meet behind the camera
    distance = np.where((column >= left) & (column <= right), 0, np.minimum(after, before)) / per_deg
    around = _softer(around, distance, per_deg)
    inside = np.clip(_from_border(band) / (SEAM_DEG * per_deg), 0.0, 1.0)[..., None]
    return inside * ln + (1 - inside) * _softer_upright(around, distance, per_deg)


def _softer(ring: np.ndarray, distance: np.ndarray, per_deg: float) -> np.ndarray:
    """Rows [H, W, 3] blurred along themselves, the more the farther [W] from what is seen."""
    level = np.interp(distance, SOFT_AT_DEG, np.arange(len(SOFT_DEG)))[None, :, None]
    return _between_blurs(ring, SOFT_DEG, level, per_deg)


def _softer_upright(ring: np.ndarray, distance: np.ndarray, per_deg: float) -> np.ndarray:
    """Columns blurred too, a third as much, over the upper and lower border by their mirror images."""
    level = np.interp(distance, SOFT_AT_DEG, np.arange(len(SOFT_DEG)))[:, None, None]
    tall = np.concatenate([ring, ring[::-1]]).transpose(1, 0, 2)
    sigmas = tuple(sigma / 3 for sigma in SOFT_DEG)
    return _between_blurs(tall, sigmas, level, per_deg)[:, : len(ring)].transpose(1, 0, 2)


def _softer_with(row: np.ndarray, distance: np.ndarray, per_deg: float) -> np.ndarray:
    """One row [1, W, 3] at several distances [N] from the photo's border, ever softer: [N, W, 3]."""
    level = np.interp(distance, EDGE_SOFT_AT_DEG, np.arange(len(EDGE_SOFT_DEG)))[:, None, None]
    return _between_blurs(row, EDGE_SOFT_DEG, level, per_deg)


def _between_blurs(rows: np.ndarray, sigmas_deg: tuple[float, ...], level: np.ndarray, per_deg: float) -> np.ndarray:
    """Rows [H, W, 3] blurred along themselves by the deviations at a level, which counts them and may lie between."""
    width = rows.shape[1]
    waves = np.fft.rfft(rows, axis=1)
    frequency = np.arange(waves.shape[1]) * 2 * np.pi / width
    result = np.zeros(1, np.float32)
    for k, sigma in enumerate(sigmas_deg):
        kernel = np.exp(-0.5 * (frequency * sigma * per_deg) ** 2)[None, :, None]
        blurred = np.fft.irfft(waves * kernel, n=width, axis=1).astype(np.float32) if sigma else rows
        result = result + np.clip(1 - np.abs(level - k), 0.0, 1.0).astype(np.float32) * blurred
    return result


def _folded(distance: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Where a walk back and forth is after so many steps: it turns at each of the lengths, and near its start."""
    goals = np.where(np.arange(len(turns)) % 2 == 0, turns, turns.max() - turns)
    at = np.concatenate([[0.0], goals])
    ends = np.concatenate([[0.0], np.cumsum(np.maximum(np.abs(np.diff(at)), 1.0))])
    return np.interp(distance, ends, at)


def _from_border(band: np.ndarray) -> np.ndarray:
    """Pixels [H, W] to the nearest unseen column of the row, zero where unseen."""
    width = band.shape[1]
    column = np.arange(width)
    left, right = band.argmax(axis=1)[:, None], (width - 1 - band[:, ::-1].argmax(axis=1))[:, None]
    return np.maximum(np.minimum(column - left, right - column), 0).astype(np.float32)


def _upright(ring: np.ndarray, first: int, last: int, elevation: np.ndarray, per_deg: float) -> np.ndarray:
    """All rows [R, 2R, 3], of those from first to last."""
    rows = len(elevation)
    whole = np.empty((rows, *ring.shape[1:]), np.float32)
    whole[first : last + 1] = ring
    horizon = int(np.clip(np.searchsorted(-elevation, 0.0), first, last))
    above = max(3, round(ABOVE_SHARE * (horizon - first)))
    for target, at, reach in ((np.arange(first), first, above), (np.arange(last + 1, rows), last, (last - first) // 2)):
        distance = np.abs(target - at)
        inward = 1 if at == first else -1
        source = np.clip((at - first) + inward * np.minimum(distance, reach), 0, last - first)
        edge = ring[min(at - first, (at - first) + inward * reach) : max(at - first, (at - first) + inward * reach) + 1]
        mean = _softer_with(edge.mean(axis=0, keepdims=True), distance / per_deg, per_deg)
        fade = np.exp(-((distance / (ABOVE_DEG * per_deg)) ** 2))[:, None, None] * (distance <= reach)[:, None, None]
        fade = np.minimum(fade, np.clip((reach - distance) / max(0.4 * reach, 1), 0.0, 1.0)[:, None, None])
        whole[target] = mean + fade * (ring[source] - mean)
    return whole


def _lay_ground(whole: np.ndarray, first: int, last: int, elevation: np.ndarray, half: float) -> None:
    """Rows below the last one, of the plane under the camera, mixed over SEAM_DEG above it; whole is changed.

    half: of the azimuth that is seen, radians.
    """
    rows, width = whole.shape[:2]
    seam = round(SEAM_DEG * rows / 180.0)
    top = max(first, last - seam)
    near, far = (
        1 / np.tan(np.radians(max(-angle, 0.5))) for angle in (elevation[last], min(elevation[first], HORIZON_DEG))
    )
    far = min(far, 4.0 * near)
    sine = np.tan(min(half, 1.4))
    # squares of the plane, each the mirror image of the next, of one that is seen before the camera
    side = max(min(far - near, 2 * sine * near / max(1 - sine, 0.2), 0.9 * near), 0.05 * near)
    d = pixel_directions(rows)[top:]
    plane = d[..., [0, 2]] / np.maximum(-d[..., 1:2], 1e-3)  # over the camera's height
    u, v = (np.abs((plane[..., k] / side + shift) % 2 - 1) * side for k, shift in ((0, 0.5), (1, near / side + 1)))
    x, z = u - side / 2, -(near + v)
    down = np.degrees(np.arctan2(1.0, np.hypot(x, z)))
    row = np.clip(np.searchsorted(-elevation, down.ravel()).reshape(down.shape), first, last)
    column = ((0.5 + np.arctan2(x, -z) / (2 * np.pi)) * width).astype(int) % width
    share = np.clip((last - np.arange(top, rows)) / max(seam, 1), 0.0, 1.0)[:, None, None]
    whole[top:] = share * whole[top:] + (1 - share) * whole[row, column]

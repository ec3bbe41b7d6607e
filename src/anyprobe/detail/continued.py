"""Continuation of a photo all around, and through the place of its object.

In a level panorama one row is one elevation: the same distance on the ground, or the same height on a wall or in the
sky. So a photo's columns may stand at any azimuth: it goes on with its own columns all around (detail.column_walk).
Ground that is no even surface loses its patches on the way, which would be a pattern.
Its object's place has the smooth colours of what is around it (detail.spread) and the texture of the columns beside.
Above and below, colours are spread along rows far more than across them, ever wider means. Below the photo the texture
is that of the plane under the camera, mirrored again and again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.core.resample import between
from anyprobe.detail.column_walk import Run, walk_around
from anyprobe.detail.spread import spread
from anyprobe.match.plate import DrawnPlate

CONTINUED_FLOOR = 0.02
"""Radiance added before its logarithm."""
LEAST_WIDTH = 0.45
"""Smallest width of a row in the photo, as a share of the widest, from which the photo goes on above and below."""
LEAST_CLEAR = 0.02
"""Smallest share of the photo that must be seen."""
HORIZON_DEG = -6.0
"""Elevation [degrees] below which rows are ground."""
GROUND_DEG = (5.0, 10.0)
"""Degrees below the horizon over which columns of the ground may be made alike."""
GROUND_PARTS, UNLIKE_ROWS_DEG = 64, 2.0
"""Number of parts of a row whose mean ln radiance is compared, and half the height [degrees] of the band averaged."""
UNLIKE_PARTS = (0.12, 0.25)
"""Standard deviations of these means between which a repeated ground would be a pattern."""
FINE_ALIKE = 0.5
"""Share of what is finer than such a part that goes, too."""
ALIKE_DEG = 20.0
"""Angle beside the photo over which the columns of such a ground become alike."""
EDGE_DEG = 2.0
"""Height [degrees] of the band at the photo's border whose mean prolongs a column."""
TALL = 0.8
"""Smallest height of a column, in that of the tallest, that is prolonged and goes on around."""
PROLONGED = 0.4
"""Weight of what is prolonged."""
MERGED_DEG = 25.0
"""Elevation [degrees] above or below the photo at which all azimuths have merged."""
POLE_DEG = (50.0, 80.0)
"""Elevations [degrees] between which all azimuths merge into one, and the ground's texture fades."""
WALK_ROWS = 256
"""Rows of a panorama whose columns a way is found through."""
BLEND_DEG = 3.0
"""Width [degrees] over which columns give way to those after a jump, and to the rows above and below the photo."""
CONTRAST, GROUND_CONTRAST = 0.8, 0.28
"""Contrast of what goes on around, and of the ground's texture below it, relative to what is seen."""
HIDDEN, LEAST_FREE = 0.08, 0.3
"""Largest share of a free column that the object hides, and the smallest share of columns that count as free."""
LEAST_LENDING_DEG = 6.0
"""Smallest width [degrees] of free columns side by side that lend their texture."""
GROUND_FROM = 0.8
"""Elevation, in that of the photo's lowest row, from which on the ground's texture sets in."""
GROUND_FAR = 0.5
"""Elevation of the farthest ground whose texture is used, in the same."""


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
    tall = inside.sum(axis=0)
    whole = np.flatnonzero(tall > TALL * tall.max())
    photo = slice(int(whole[0]), int(whole[-1]) + 1)
    is_free = _free_columns(clear[:, photo], inside[:, photo])
    within = _filled(ln, clear, inside, photo, is_free, per_deg)
    # what the object stands on, its shadow and what the mask missed of it, all below its top, are not repeated
    below = np.maximum.accumulate(inside - clear, axis=0)[:, photo]
    calm = clear.copy()
    calm[:, photo] *= 1 - below * ~is_free
    repeated = _filled(ln, calm, inside, photo, is_free, per_deg)
    ring, ring_shown = _around(within, repeated, inside, photo, per_deg)
    ring = _calmer_ground(ring, ring_shown, photo, elevation, per_deg)
    values, weight = _prolonged(ring, ring_shown.astype(np.float32), ring_shown, per_deg)
    base = spread(values, weight)
    beyond = np.maximum(np.maximum(first - np.arange(rows), np.arange(rows) - last), 0)
    high = np.clip((np.abs(elevation) - POLE_DEG[0]) / (POLE_DEG[1] - POLE_DEG[0]), 0.0, 1.0)
    merged = np.maximum(high, np.clip(beyond / per_deg / MERGED_DEG, 0.0, 1.0))[:, None, None]
    around = base + _smooth(merged) * (base.mean(axis=1, keepdims=True) - base)
    if elevation[last] < HORIZON_DEG:
        start, ground = _ground((ring - base) * ring_shown[..., None], ring_shown, photo, elevation, last)
        around[start:] += (1 - high[start:, None, None]).astype(np.float32) * ground
    inwards = np.minimum(np.cumsum(ring_shown, axis=0), np.cumsum(ring_shown[::-1], axis=0)[::-1])
    share = CONTRAST * _smooth(np.clip(inwards / per_deg / BLEND_DEG, 0.0, 1.0) * ring_shown)[..., None]
    return Continued(ln=around + share * (ring - around), within=within, top=float(elevation[first]))


def _smooth(share: np.ndarray) -> np.ndarray:
    """Ease a share in [0, 1] in and out."""
    return (share * share * (3 - 2 * share)).astype(np.float32)


def _free_columns(clear: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Return which columns [W] of the photo the object leaves free, or most of."""
    hidden = ((1 - clear) * inside).sum(axis=0) / np.maximum(inside.sum(axis=0), 1)
    return hidden <= max(HIDDEN, float(np.quantile(hidden, LEAST_FREE)))


def _filled(
    ln: np.ndarray, clear: np.ndarray, inside: np.ndarray, photo: slice, is_free: np.ndarray, per_deg: float
) -> np.ndarray:
    """Return ln with what is not clear filled: the colours around it, with the texture of free columns beside."""
    base = spread(ln, clear)
    texture, shown = ((ln - base) * clear[..., None])[:, photo], inside[:, photo]
    lending = np.flatnonzero(is_free)
    runs = np.split(lending, np.flatnonzero(np.diff(lending) > 1) + 1)
    longest = max(map(len, runs))
    column = np.arange(texture.shape[1])
    lent = np.zeros_like(texture)
    total = np.zeros(texture.shape[1], np.float32)
    for run in runs:
        if len(run) < min(LEAST_LENDING_DEG * per_deg, longest):
            continue
        away = np.maximum(np.maximum(run[0] - column, column - run[-1]), 0)
        share = np.exp(-np.minimum(away / per_deg, 60.0)).astype(np.float32)
        lent += share[:, None] * texture[:, _mirrored(column, int(run[0]), int(run[-1]))]
        total += share
    result = ln.copy()
    fill = (1 - clear[:, photo]) * shown
    result[:, photo] += fill[..., None] * (base[:, photo] + lent / total[:, None] - ln[:, photo])
    return result


def _mirrored(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Mirror values at both ends of a range until they are within."""
    if high <= low:
        return np.full_like(values, low)
    over = (values - low) % (2 * (high - low))
    return low + np.minimum(over, 2 * (high - low) - over)


def _around(
    ln: np.ndarray, repeated: np.ndarray, inside: np.ndarray, photo: slice, per_deg: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return ln [R, 2R, 3] with the photo's columns all around as in `repeated`, and [R, 2R] where they show it."""
    rows, columns = inside.shape
    unit = max(1, rows // WALK_ROWS)
    width = (photo.stop - photo.start) // unit * unit
    own = slice(photo.start, photo.start + width)
    small = np.dstack([repeated[:, own], inside[:, own]]).astype(np.float32)
    small = small.reshape(rows // unit, unit, width // unit, unit, 4).mean(axis=(1, 3))
    runs = walk_around(small[..., :3], small[..., 3] > 0.5, (columns - width) // unit, per_deg / unit)
    if runs is None:
        return ln, inside
    fade = max(1, round(BLEND_DEG * per_deg))
    to = (own.stop + np.arange(columns - width + fade)) % columns
    source, earlier, share = np.full(len(to), -1), np.zeros(len(to), int), np.zeros(len(to), np.float32)
    at, past = 0, Run(0, 1, width)
    for small_run in runs:
        run = Run(small_run.first * unit + (unit - 1) * (small_run.step < 0), small_run.step, small_run.count * unit)
        place, number = slice(at, at + run.count), np.arange(run.count)
        source[place] = run.first + run.step * number
        if run.first != past.last:  # a jump, no turn
            gone_on = past.last + past.step * (number + 1)
            on = (gone_on >= 0) & (gone_on < width)
            earlier[place] = np.where(on, gone_on, 0)
            share[place] = np.where(on, np.maximum(0.0, 1 - (number + 0.5) / fade), 0.0)
        at, past = at + run.count, run
    # behind the photo's own edge, which fades
    source[at:] = past.last + past.step * (np.arange(fade) + 1)
    kept = (source >= 0) & (source < width)
    to, source, earlier, share = to[kept], source[kept], earlier[kept], share[kept]
    ring, shown = ln.copy(), inside.copy()
    own_ln, own_inside = repeated[:, own], inside[:, own]
    share = share * (own_inside[:, source] & own_inside[:, earlier])
    drawn = own_ln[:, source] + share[..., None] * (own_ln[:, earlier] - own_ln[:, source])
    over = own_inside[:, source]
    ring[:, to] = np.where(over[..., None], drawn, ln[:, to])
    shown[:, to] |= over
    return ring, shown


def _calmer_ground(
    ln: np.ndarray, shown: np.ndarray, photo: slice, elevation: np.ndarray, per_deg: float
) -> np.ndarray:
    """Return ln [R, 2R, 3] with the ground's columns made alike away from the photo, in rows where they differ widely.

    Grass or a floor may be repeated; the edge of a table or a patch of light would make a pattern.
    """
    rows, columns = shown.shape
    weight = shown[..., None].astype(np.float32)
    mean = (ln * weight).sum(axis=1, keepdims=True) / np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    off = (ln - mean) * weight
    count = weight.reshape(rows, GROUND_PARTS, -1).sum(axis=2)
    patch = off.reshape(rows, GROUND_PARTS, -1, 3).sum(axis=2) / np.maximum(count, 1.0)[..., None]
    patchiness = np.sqrt((count * patch.mean(axis=-1) ** 2).sum(axis=1) / np.maximum(count.sum(axis=1), 1.0))
    patchiness = _along(patchiness, max(1, round(UNLIKE_ROWS_DEG * per_deg)))
    ahead = (np.arange(columns) - photo.stop) % columns  # columns after the photo
    away = np.minimum(ahead, columns - (photo.stop - photo.start) - 1 - ahead).clip(min=0) / per_deg

    def eased(value: np.ndarray, low: float, high: float) -> np.ndarray:
        return _smooth(np.clip((value - low) / (high - low), 0.0, 1.0))

    of_row = eased(patchiness, *UNLIKE_PARTS) * eased(-elevation, *GROUND_DEG)
    share = of_row[:, None] * eased(away, 0.0, ALIKE_DEG)
    at = (np.arange(columns) + 0.5) * GROUND_PARTS / columns - 0.5
    left = np.floor(at).astype(int)
    right = (at - left)[:, None].astype(np.float32)
    wide = (1 - right) * patch[:, left % GROUND_PARTS] + right * patch[:, (left + 1) % GROUND_PARTS]
    return ln - share[..., None] * weight * (wide + FINE_ALIKE * (off - wide))


def _ground(
    texture: np.ndarray, shown: np.ndarray, photo: slice, elevation: np.ndarray, last: int
) -> tuple[int, np.ndarray]:
    """Return the first row, and the texture [rows from there on, 2R, 3] of the ground below the photo: what the photo
    shows of it, seen from above and mirrored again and again.

    texture: [R, 2R, 3] of what is shown.
    """
    rows, columns = shown.shape
    lowest = -float(elevation[last]) - 1.0
    near = 1 / np.tan(np.radians(lowest))  # in camera heights
    far = max(1 / np.tan(np.radians(max(3.0, GROUND_FAR * lowest))), 1.3 * near)
    middle = (photo.start + photo.stop) * np.pi / columns
    half = near * np.tan(min(0.8 * (photo.stop - photo.start) * np.pi / columns, 1.0))
    start = int(np.searchsorted(-elevation, GROUND_FROM * lowest))
    azimuth = (np.arange(columns) + 0.5) * 2 * np.pi / columns - middle
    away = 1 / np.tan(np.radians(np.maximum(-elevation[start:, None], 1.0)))
    x = _mirrored(away * np.sin(azimuth), -half, half)
    z = _mirrored(away * np.cos(azimuth), near, far)
    row = (90.0 + np.degrees(np.arctan2(1.0, np.hypot(x, z)))) / 180.0 * rows - 0.5
    column = (np.arctan2(x, z) + middle) / (2 * np.pi) * columns - 0.5
    found = between(np.dstack([texture, shown]).astype(np.float32), column % columns, np.minimum(row, last))
    share = np.clip((-elevation[start:] / lowest - GROUND_FROM) / (1 - GROUND_FROM), 0.0, 1.0)[:, None, None]
    return start, (GROUND_CONTRAST * share * found[..., :3] * found[..., 3:]).astype(np.float32)


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


def _along(values: np.ndarray, reach: int) -> np.ndarray:
    """Average values [N] over 2 reach + 1 of them."""
    padded = np.pad(values, reach, mode="edge")
    return np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), mode="valid")

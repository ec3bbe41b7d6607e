"""Addition of a library map's detail to an estimate.

    L = m (E' + e) exp(sum over bands of a_b h_b) - e + sources

E' is the estimate without its light sources, h the candidate's ln radiance at the estimate's exposure, cut off
above white and without the orders that an estimate determines, split into bands; a_b^2 is the share of a band's power
that the estimate lacks, so that reflections in a mirror are not drawn twice. m is smooth: it keeps blurred display
values as near to the estimate's as possible while the nine spherical harmonics of radiance are exactly the estimate's.
Surroundings visible in the photo replace all this; light sources are drawn where the estimate has them.

Arrays here are planar, [3, H, 2H].
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response, response
from anyprobe.detail.drawn_sources import draw_lights, take_sources
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import project, sh_basis
from anyprobe.match.library import decode

HELD = 9.0
"""Sharpness of the blur b_l = exp(-l (l + 1) / 18) of order l; an estimate holds 1 - (1 - b)^3: .88 of order 3, .70 of
order 4, .26 of order 6, .05 of order 8."""
BANDS = (192.0, 768.0)
"""Variances of the blurs between bands: a half at orders 16 and 32."""
CONTRAST = (0.22, 0.13, 0.16)
"""Target standard deviation of ln radiance in each band, close to that of real maps; the resulting power is in
docs/how-to/detail.md. Invented detail adds its own variance to the error, so that more costs more."""
CONTRAST_GAIN = 1.6
"""Largest factor, or its inverse, by which a band's contrast is changed."""
CEILING = 1.5
"""Radiance in units of white at which a candidate is clipped: its light sources are not the estimate's."""
FLOOR = 0.02
"""Radiance e added before the logarithm, which bounds the depth of a candidate's black."""
CODE_STEPS = 16
"""Number of steps between two codes of a picture."""
STEP = 2.0
"""Largest factor, or its inverse, of one step towards the estimate's display values or harmonics."""
STEPS = 5
"""Number of steps towards the estimate's harmonics."""
_CLIPPED = 0.97
"""Display value above which a seen pixel is a lower bound of its radiance."""
_LEAST_COVER = 1e-3
"""Smallest cover that display values are divided by."""


def blend(
    estimate: np.ndarray,
    codes: np.ndarray,
    candidate_from_estimate: np.ndarray,
    ln_gain: np.ndarray,
    rows: int,
    seen: np.ndarray | None = None,
) -> np.ndarray:
    """Blend an estimate [h, 2h, 3] with the detail of a candidate: [rows, 2 rows, 3] float32 with the same SH9.

    Args:
        codes: [H, 2H, 3], see match.library.Library.candidate.
        candidate_from_estimate, ln_gain: from match.Match.
        rows: a multiple of 64.
        seen: [rows, 2 rows, 4] known surroundings: display values times cover, and cover; with
            a fifth channel, the cover of values known above white too, where values over 1 are radiance.
    """
    sources, rest = take_sources(estimate)
    rest = _planar(rest)
    detailed = _detailed(rest, _candidate(codes, candidate_from_estimate, ln_gain, rows))
    goal = project(estimate)
    shown, cover = _shown(seen, rest, rows)
    full = np.zeros((1, rows, 2 * rows), np.float32)
    lights = draw_lights(sources, _interleaved(full + cover), _interleaved(full + shown * cover))
    fixed = shown * cover + (1 - _measured(seen)) * _planar(lights)
    free = detailed * (1 - cover)
    free *= enlarged_planes(_towards(free, fixed, rest, goal), rows)
    # again, for the residual of reducing to 64 rows
    lack = goal - project(_interleaved(free + fixed))
    free *= enlarged_planes(_harmonics_step(_shrunk(free), lack), rows)
    return _interleaved(free + fixed)


def _planar(radiance: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.moveaxis(radiance, -1, 0), np.float32)


def _interleaved(planes: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1), np.float32)


def _detailed(rest: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """Apply the detail of ln radiance phi [3, H, 2H] to the estimate's light [3, 64, 128]."""
    ln_rest = np.log(np.maximum(rest, 0.0) + FLOOR)
    low, *bands = _bands(_shrunk(phi))
    shares = [
        _share(own, theirs, contrast)
        for own, theirs, contrast in zip(_bands(ln_rest)[1:], bands, CONTRAST, strict=True)
    ]
    # phi itself carries the finest detail, by the share of the finest band
    field = ln_rest - shares[-1] * low
    for share, band in zip(shares, bands, strict=True):
        field = field + (share - shares[-1]) * band
    ln_all = shares[-1] * phi
    ln_all += enlarged_planes(field, phi.shape[1])
    np.exp(ln_all, out=ln_all)
    ln_all -= FLOOR
    return np.maximum(ln_all, 0.0, out=ln_all)


def _bands(values: np.ndarray) -> list[np.ndarray]:
    """Split [3, 64, 128] into the part an estimate determines, two bands, and the rest; their sum is the whole."""
    blurred = [_held(values), *(_blur(values, sharpness) for sharpness in BANDS), values]
    return [blurred[0], *(fine - coarse for coarse, fine in zip(blurred, blurred[1:], strict=False))]


def _blur(values: np.ndarray, sharpness: float) -> np.ndarray:
    return np.moveaxis(blur_cosine_power(np.moveaxis(values, 0, -1), sharpness), -1, 0)


def _held(values: np.ndarray) -> np.ndarray:
    """Return the low-order part of values [3, 64, 128] that an estimate determines."""
    high = values
    for _ in range(3):
        high = high - _blur(high, HELD)
    return values - high


def _share(own: np.ndarray, theirs: np.ndarray, contrast: float) -> float:
    """Return the factor by which a candidate's band, brought to a contrast, fills up an estimate's band to its own
    power."""
    weights = pixel_solid_angles(own.shape[1]) / (4 * np.pi * len(own))
    mine, whole = (float(np.sqrt((weights * band**2).sum())) for band in (own, theirs))
    gain = float(np.clip(contrast / max(whole, 1e-6), 1 / CONTRAST_GAIN, CONTRAST_GAIN))
    return gain * float(np.sqrt(max(0.0, 1.0 - (mine / max(gain * whole, 1e-6)) ** 2)))


def _candidate(codes: np.ndarray, turn: np.ndarray, ln_gain: np.ndarray, rows: int) -> np.ndarray:
    """Return ln(radiance + FLOOR) of a candidate, rotated and exposed: [3, rows, 2 rows] float32."""
    x, y, z = turn.astype(np.float32) @ _directions(rows)
    height, width = codes.shape[:2]
    column = (0.5 + np.arctan2(x, -z) / np.float32(2 * np.pi)) * width - 0.5
    row = np.clip(np.arccos(np.clip(y, -1.0, 1.0)) * np.float32(height / np.pi) - 0.5, 0.0, height - 1.001)
    left, top = np.floor(column), np.floor(row)
    right, down = (column - left)[:, None], (row - top)[:, None]
    left, top = left.astype(np.int32) % width, top.astype(np.int32) * width
    after = (left + 1) % width
    flat = codes.reshape(-1, 3)
    upper, lower = (_between(flat, line + left, line + after, right) for line in (top, top + width))
    steps = ((upper + (lower - upper) * down) * CODE_STEPS).astype(np.uint16)
    ln = np.interp(np.arange(255 * CODE_STEPS + 1) / CODE_STEPS, np.arange(256), np.log(decode()))
    table = np.log(np.minimum(np.exp(ln[:, None] + ln_gain), CEILING) + FLOOR).astype(np.float32)
    return np.stack([table[steps[:, k], k] for k in range(3)]).reshape(3, rows, 2 * rows)


def _between(pixels: np.ndarray, left: np.ndarray, after: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Interpolate pixels [N, 3] between two indices [P], weight `right` [P, 1] for the second: [P, 3] float32."""
    first, second = (np.take(pixels, index, axis=0).astype(np.float32) for index in (left, after))
    second -= first
    second *= right
    second += first
    return second


@lru_cache(maxsize=2)
def _directions(rows: int) -> np.ndarray:
    """Return the direction of every pixel, [3, rows * 2 rows] float32."""
    return np.ascontiguousarray(pixel_directions(rows).reshape(-1, 3).T)


def _shown(seen: np.ndarray | None, rest: np.ndarray, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the radiance [3, rows, 2 rows] of seen surroundings and cover [1, rows, 2 rows].

    Clipped pixels are raised to the estimate [3, 64, 128] where that is brighter; their hue is kept.
    """
    if seen is None:
        return np.zeros((3, 1, 1), np.float32), np.zeros((1, 1, 1), np.float32)
    cover = _planar(seen[..., 3:4])
    display = _planar(seen[..., :3]) / np.maximum(cover, _LEAST_COVER)
    radiance = np.where(display > 1, display, inverse_response(display))
    gain = np.maximum(enlarged_planes(rest, rows).mean(axis=0) / np.maximum(radiance.mean(axis=0), _LEAST_COVER), 1.0)
    clipped = (display >= _CLIPPED).any(axis=0) & (_measured(seen)[0] < 0.5)
    return np.where(clipped, radiance * gain, radiance), cover


def _measured(seen: np.ndarray | None) -> np.ndarray:
    """Return the share [1, rows, 2 rows] of each direction whose radiance is known above white."""
    return np.zeros((1, 1, 1), np.float32) if seen is None else _planar(seen[..., 4:].sum(axis=-1, keepdims=True))


def _towards(free: np.ndarray, fixed: np.ndarray, rest: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Return the factor m [3, 64, 128] of `free`, to which `fixed` is added: blurred display values move towards those
    of rest, then harmonics [9, 3] towards those of the goal."""
    free, fixed = _shrunk(free), _shrunk(fixed)
    m = _ratio(_held(response(rest)), _held(response(free)))
    for _ in range(STEPS):
        m = m * _harmonics_step(m * free, goal - project(_interleaved(m * free + fixed)))
    return m


def _ratio(wanted: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the factor of radiance that changes display values to the wanted ones."""
    a, b = (inverse_response(np.clip(values, 0.02, 0.95)) for values in (wanted, shown))
    return np.clip(a / b, 1 / STEP, STEP)


def _harmonics_step(free: np.ndarray, lack: np.ndarray) -> np.ndarray:
    """Return 1 + sum of c_i Y_i [3, 64, 128], the factor that adds the lacking harmonics [9, 3] to `free`."""
    y = sh_basis(pixel_directions(MAP_HEIGHT)).reshape(-1, 9).astype(np.float64)
    weights = np.repeat(pixel_solid_angles(MAP_HEIGHT), 2 * MAP_HEIGHT, axis=1).reshape(-1)
    factor = np.empty_like(free)
    for plane, missing, out in zip(free, lack.T, factor, strict=True):
        gram = (y * (weights * plane.reshape(-1))[:, None]).T @ y
        ridge = 1e-6 * np.trace(gram) + 1e-9
        out[:] = 1.0 + (y @ np.linalg.solve(gram + ridge * np.eye(9), missing)).reshape(plane.shape)
    return np.clip(factor, 1 / STEP, STEP)


def _shrunk(planes: np.ndarray) -> np.ndarray:
    """Average over blocks, [3, H, 2H] to [3, 64, 128], weighted by solid angle."""
    rows = planes.shape[1]
    if rows in (1, MAP_HEIGHT):
        return planes
    down, across = _blocks(rows)
    return down @ planes @ across


@lru_cache(maxsize=4)
def _blocks(rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the weights [64, rows], by solid angle, and [2 rows, 128] of averages over blocks."""
    k = rows // MAP_HEIGHT
    areas = pixel_solid_angles(rows)[:, 0].astype(np.float64)
    down = np.repeat(np.eye(MAP_HEIGHT), k, axis=1) * areas
    across = np.repeat(np.eye(2 * MAP_HEIGHT), k, axis=0) / k
    return (down / down.sum(axis=1, keepdims=True)).astype(np.float32), across.astype(np.float32)


@lru_cache(maxsize=8)
def _spline(old: int, new: int) -> np.ndarray:
    """Return the weights [new, old + 4] of the cubic B-spline on values padded by two at both ends."""
    at = (np.arange(new) + 0.5) * old / new - 0.5
    first = np.floor(at).astype(int)
    t = at - first
    parts = ((1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3)
    weights = np.zeros((new, old + 4), np.float32)
    for k, part in enumerate(parts):
        weights[np.arange(new), first + 1 + k] = part / 6
    return weights


def enlarged_planes(planes: np.ndarray, rows: int) -> np.ndarray:
    """Enlarge smooth values [3, h, 2h] to [3, rows, 2 rows]; beyond a pole lies the opposite side."""
    height, width = planes.shape[1:]
    if rows == height:
        return planes
    beyond = np.roll(planes, width // 2, axis=2)
    tall = np.concatenate([beyond[:, 1::-1], planes, beyond[:, :-3:-1]], axis=1)
    padded = np.concatenate([tall[:, :, -2:], tall, tall[:, :, :2]], axis=2)
    return _spline(height, rows) @ padded @ _spline(width, 2 * rows).T

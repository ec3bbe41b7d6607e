"""Search for the library map that agrees best with an estimate: its rotation and exposure, held over a clip's frames;
and the surroundings seen in a photo, as sharp as the map with detail.

Maps are turned about the vertical only; since up in a photo is not known, the camera's pitch is varied too: from a
little upwards to 75 degrees down. Compared are ln radiance and ln shading of low orders, each difference weighted by
the estimate's confidence there; exposure and white balance are free, the latter at a price.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.core.latlong import bilinear, pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.light.environment import reduced, rotate
from anyprobe.match.library import FEATURE_ROWS, Library, features_of
from anyprobe.match.places import map_from_camera_at
from anyprobe.pictures.resampling import resample

PITCHES_DEG = tuple(range(-15, 76, 10))
"""Camera pitches [degrees], downwards, that are tried."""
PITCH_PRICE = 0.01
"""Cost of a pitch of one radian, which grows with its square; in units of squared ln radiance."""
TINT_PRICE = 0.5
"""Cost of the squared difference in white balance, in the same units."""
SHADING_WEIGHT = 2.0
"""Weight of the ln shading beside that of each channel's ln radiance."""
PLAIN_PRICE, RICH = 0.1, 0.06
"""Cost of a candidate with little detail: PLAIN_PRICE ln(RICH / richness) squared; 0 above RICH; see
library.richness_of."""
LEAST_CONFIDENCE = 0.05


@dataclass(frozen=True, kw_only=True, slots=True)
class Match:
    """A candidate aligned to an estimate.

    index, name: of the candidate. candidate_from_estimate: [3, 3] rotation. ln_gain: [3], from the candidate's radiance
    to the estimate's. distance: mean squared difference of features, prices included.
    """

    index: int
    name: str
    candidate_from_estimate: np.ndarray
    ln_gain: np.ndarray
    distance: float


def find_level_match(
    radiance: np.ndarray,
    confidence: np.ndarray | None,
    library: Library,
    level_from_map: np.ndarray,
    rank: int = 0,
    prices: np.ndarray | None = None,
) -> Match:
    """Find a candidate that stands upright in an estimate's place.

    Args:
        level_from_map: [3, 3] rotation to a frame whose +Y is up there.
        rank, prices: see find_matches.
    """
    level = rotate(radiance, level_from_map)
    sure = None if confidence is None else rotate(confidence[..., None], level_from_map)[..., 0]
    match = find_matches(level, sure, library, rank, pitches_deg=(0.0,), prices=prices)[0]
    return replace(match, candidate_from_estimate=match.candidate_from_estimate @ level_from_map)


def find_matches(
    radiance: np.ndarray,
    confidence: np.ndarray | None,
    library: Library,
    rank: int | None = None,
    pitches_deg: Sequence[float] = PITCHES_DEG,
    prices: np.ndarray | None = None,
) -> list[Match]:
    """Rank all candidates, the best first; or return only the one of a rank (modulo their number).

    Args:
        pitches_deg: possible pitches of the camera, evenly spaced.
        prices: [N] additional costs of the candidates; None: none.
    """
    features = features_of(radiance)
    if confidence is None:
        weight = np.ones((FEATURE_ROWS, 2 * FEATURE_ROWS, 1), np.float32)
    else:
        weight = np.maximum(reduced(confidence[..., None].astype(np.float32), FEATURE_ROWS), LEAST_CONFIDENCE)
    spectra = _spectra(library)
    plain = PLAIN_PRICE * np.maximum(np.log(RICH / np.maximum(library.richness, 1e-3)), 0.0)[:, None] ** 2
    plain = plain if prices is None else plain + prices[:, None]
    costs, gains = zip(*(_compare(features, weight, spectra, plain, pitch) for pitch in pitches_deg), strict=True)
    cost = np.stack(costs, axis=1)  # [N, pitches, columns]
    best = cost.reshape(len(cost), -1).min(axis=1)
    order = np.argsort(best, kind="stable")
    chosen = order if rank is None else order[[rank % len(best)]]
    return [_placed(int(index), cost, gains, library, pitches_deg) for index in chosen]


def _placed(
    index: int, cost: np.ndarray, gains: tuple[np.ndarray, ...], library: Library, pitches_deg: Sequence[float]
) -> Match:
    """Align a candidate where its cost, of [N, pitches, columns], is lowest; gains: [N, columns, 3] of each pitch."""
    pitch, column = np.unravel_index(np.argmin(cost[index]), cost.shape[1:])
    columns = cost[index, pitch, [column - 1, column, (column + 1) % cost.shape[2]]]
    rows = cost[index].min(axis=1)[[max(pitch - 1, 0), pitch, min(pitch + 1, len(pitches_deg) - 1)]]
    # a shift by one column to the right rotates by -2 pi / columns about +Y, see core.latlong
    yaw = 2 * np.pi * (column + _lowest(columns)) / cost.shape[2]
    step = pitches_deg[1] - pitches_deg[0] if len(pitches_deg) > 1 else 0.0
    pitch_deg = pitches_deg[int(pitch)] + _lowest(rows) * step
    return Match(
        index=index,
        name=library.names[index],
        candidate_from_estimate=map_from_camera_at(yaw, pitch_deg),
        ln_gain=gains[pitch][index, column],
        distance=float(cost[index].min()),
    )


def _lowest(three: np.ndarray) -> float:
    """Return the minimum's place of the parabola through values at -1, 0 and 1, the middle one the least."""
    before, least, after = three.astype(np.float64)
    bend = before - 2 * least + after
    return float(0.5 * (before - after) / bend) if bend > 1e-12 and min(before, after) > least else 0.0


@lru_cache(maxsize=2)
def _spectra(library: Library) -> tuple[np.ndarray, np.ndarray]:
    """Return Fourier transforms along the columns of the features and of their squares, [N, 16, 17, 4]."""
    features = library.features
    plain, squares = (np.fft.rfft(values, axis=2).astype(np.complex64) for values in (features, features**2))
    return plain, squares


def _compare(
    features: np.ndarray,
    weight: np.ndarray,
    spectra: tuple[np.ndarray, np.ndarray],
    plain: np.ndarray,
    pitch_deg: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Compare all candidates at every turn: cost, including plain [N, 1], [N, columns], and ln gains [N, columns, 3].

    At a turn by k columns, with c the candidate's features and e the estimate's: the least sum of
    w (e(x) - s c(x - k) - g)^2 over a gain g and a contrast s in [0, 1] of each feature, since an estimate is softer
    than its place. Computed by correlations along the columns.
    """
    level = rotate(np.concatenate([features, weight], axis=-1), map_from_camera_at(0.0, pitch_deg))
    w = np.maximum(level[..., 4:], 0.0) * pixel_solid_angles(FEATURE_ROWS)[..., None]
    w = w / w.sum()
    e = level[..., :4]
    first, second = spectra

    def correlate(values: np.ndarray, spectrum: np.ndarray) -> np.ndarray:
        """Sum values(x) c(x - k) over the sphere: [N, columns, 4]."""
        wave = np.conj(np.fft.rfft(values, axis=1))
        product = np.einsum("hfc,nhfc->nfc", np.broadcast_to(wave, spectrum.shape[1:]), spectrum, optimize=True)
        return np.fft.irfft(np.conj(product), n=2 * FEATURE_ROWS, axis=1)

    mean_e, mean_e2 = (w * e).sum(axis=(0, 1)), (w * e * e).sum(axis=(0, 1))
    mean_c, mean_c2 = correlate(w, first), correlate(w, second)
    mean_ec = correlate(w * e, first)
    gain = mean_e - mean_c  # [N, columns, 4]
    own, theirs = mean_e2 - mean_e**2, np.maximum(mean_c2 - mean_c**2, 1e-6)
    shared = mean_ec - mean_e * mean_c
    scale = np.clip(shared / theirs, 0.0, 1.0)
    spread = np.maximum(own - 2 * scale * shared + scale**2 * theirs, 0.0)
    exposure = gain[..., :3].mean(axis=-1, keepdims=True)
    tint = ((gain[..., :3] - exposure) ** 2).mean(axis=-1)
    cost = spread[..., :3].mean(axis=-1) + SHADING_WEIGHT * spread[..., 3] + TINT_PRICE * tint
    cost = cost + PITCH_PRICE * np.radians(pitch_deg) ** 2
    return cost + plain, gain[..., :3]


MOVED = 0.35
"""Root mean square change of features, exposure and white balance aside, above which a place is chosen anew.

A light turned by 10 degrees differs by 0.05 to 0.2, one turned by 30 by 0.15 to 0.6; noise of 5 % by 0.002.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class HeldMatch:
    """A match kept over frames: match, as chosen; features [16, 32, 4] of the estimate then, see
    library.features_of."""

    match: Match
    features: np.ndarray


def hold_match(held: HeldMatch | None, radiance: np.ndarray, find: Callable[[], Match]) -> HeldMatch:
    """Return the held match, or a new one if there is none or the estimate has moved away; pure.

    A new choice for each frame of a clip would make reflections flicker between candidates that agree equally well.

    Args:
        radiance: [H, 2H, 3] of this frame, all frames in one frame of reference.
        find: gives the new one, in that frame of reference.
    """
    features = features_of(radiance)
    if held is not None and _apart(features, held.features) < MOVED:
        return held
    match = find()
    turn, gain = (np.ascontiguousarray(values) for values in (match.candidate_from_estimate, match.ln_gain))
    # in the memory order of an array read from a file, so that sums agree to the last bit
    match = replace(match, candidate_from_estimate=turn, ln_gain=gain)
    return HeldMatch(match=match, features=np.ascontiguousarray(features))


def exposed_match(held: HeldMatch, radiance: np.ndarray) -> Match:
    """Return the held match with the exposure and white balance of a frame's estimate [H, 2H, 3]."""
    shift = _mean(features_of(radiance) - held.features)[:3]
    return replace(held.match, ln_gain=held.match.ln_gain + shift)


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    """Return the root mean square difference of features, apart from exposure and white balance."""
    difference = a - b
    return float(np.sqrt(_mean((difference - _mean(difference)) ** 2).mean()))


def _mean(values: np.ndarray) -> np.ndarray:
    """Average over the sphere, [16, 32, C] to [C]."""
    return (values * pixel_solid_angles(FEATURE_ROWS)[..., None]).sum(axis=(0, 1)) / (4 * np.pi)


PHOTO_DENSITY = 1.0
"""Number of the shrunk photo's pixels per pixel of the map."""
EDGE = 0.04
"""Width of the fade-out at the photo's border, as a share of its shorter side."""
GROW = 0.015
"""Rim around the object that is left out, as a share of the photo's longer side: masks miss the true edge."""
_FRONT = 0.05
"""Smallest -z of a direction that a photo may show."""


def seen_in_photo(
    rgb: np.ndarray, mask: np.ndarray, long_fov_deg: float, rows: int, radiance: np.ndarray | None = None
) -> np.ndarray:
    """Draw a photo into the map of its camera's frame: [rows, 2 rows, 4] float32.

    Channels: display values times cover, and cover in [0, 1], which fades out towards the border and the object.

    Args:
        rgb: [H, W, 3] display values; mask: [H, W], 1 on the object.
        long_fov_deg: field of view of the longer side.
        radiance: [H, W, 3], where the photo holds radiance above white: adds a fifth channel, its cover, and replaces
            display values above 1 by radiance.
    """
    height, width = mask.shape
    focal = max(height, width) / 2 / np.tan(np.radians(long_fov_deg) / 2)
    scale = min(1.0, PHOTO_DENSITY * rows / np.pi / focal)
    size = (max(2, round(width * scale)), max(2, round(height * scale)))
    colors = resample(rgb if radiance is None else radiance, size)
    if radiance is not None:
        colors = np.where(colors > 1, colors, response(np.maximum(colors, 0.0)))
    picture = np.dstack([colors, _beside(mask, size)])
    d = pixel_directions(rows)
    depth = np.maximum(-d[..., 2], _FRONT)
    column, row = 0.5 + focal * d[..., 0] / depth / width, 0.5 - focal * d[..., 1] / depth / height
    inside = (d[..., 2] < -_FRONT) & (column > 0) & (column < 1) & (row > 0) & (row < 1)
    found = np.zeros((rows, 2 * rows, 4), np.float32)
    margin = np.minimum(np.minimum(column, 1 - column) * width, np.minimum(row, 1 - row) * height)[inside] / (
        EDGE * min(width, height)
    )
    shown = bilinear(picture.astype(np.float32), np.stack([column[inside], row[inside]], axis=-1))
    cover = shown[:, 3:] * np.clip(margin, 0.0, 1.0)[:, None]
    found[inside] = np.concatenate([shown[:, :3] * cover, cover], axis=1)
    return found if radiance is None else np.concatenate([found, found[..., 3:]], axis=-1)


def _beside(mask: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return 1 away from the object, 0 on it and close to it."""
    plane = Image.fromarray(np.round(255 * np.clip(resample(mask[..., None], size)[..., 0], 0, 1)).astype(np.uint8))
    reach = max(1, round(GROW * max(size)))
    grown = plane.filter(ImageFilter.MaxFilter(4 * reach + 1)).filter(ImageFilter.GaussianBlur(reach))
    return 1.0 - np.asarray(grown, np.float32) / 255.0

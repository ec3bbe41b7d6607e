"""Search for the library map that agrees best with an estimate: its rotation and exposure.

Maps are turned about the vertical only; since up in a photo is not known, the camera's pitch is varied too: from a
little upwards to 75 degrees down. Compared are ln radiance and ln shading of low orders, each difference weighted by
the estimate's confidence there; exposure and white balance are free, the latter at a price.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.light.environment import reduced, rotate
from anyprobe.match.library import FEATURE_ROWS, Library, features_of
from anyprobe.match.places import map_from_camera_at

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


def find_matches(
    radiance: np.ndarray, confidence: np.ndarray | None, library: Library, pitches_deg: Sequence[float] = PITCHES_DEG
) -> list[Match]:
    """Rank all candidates, the best first.

    Args:
        pitches_deg: possible pitches of the camera, evenly spaced.
    """
    features = features_of(radiance)
    if confidence is None:
        weight = np.ones((FEATURE_ROWS, 2 * FEATURE_ROWS, 1), np.float32)
    else:
        weight = np.maximum(reduced(confidence[..., None].astype(np.float32), FEATURE_ROWS), LEAST_CONFIDENCE)
    spectra = _spectra(library)
    plain = PLAIN_PRICE * np.maximum(np.log(RICH / np.maximum(library.richness, 1e-3)), 0.0)[:, None] ** 2
    costs, gains = zip(*(_compare(features, weight, spectra, plain, pitch) for pitch in pitches_deg), strict=True)
    cost = np.stack(costs, axis=1)  # [N, pitches, columns]
    best = cost.reshape(len(cost), -1).min(axis=1)
    order = np.argsort(best, kind="stable")
    return [_placed(int(index), cost, gains, library, pitches_deg) for index in order]


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

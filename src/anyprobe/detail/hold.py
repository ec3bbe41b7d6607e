"""One place for the detail of all frames of a clip, held until the estimate moves clearly away from where it was found.

A new choice for each frame would make reflections flicker: candidates that agree equally well take turns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.detail.library import FEATURE_ROWS, Library, features_of
from anyprobe.detail.match import Match, find_match

MOVED = 0.35
"""Root mean square of what the features differ by, exposure and white balance aside, from which on a place is chosen
anew: a light turned by 10 degrees differs by 0.05 to 0.2, one turned by 30 by 0.15 to 0.6; noise of 5 % by 0.002."""


@dataclass(frozen=True, kw_only=True, slots=True)
class HeldMatch:
    """match: as it was chosen. features: [16, 32, 4] of the estimate then, see library.features_of."""

    match: Match
    features: np.ndarray


def hold_match(
    held: HeldMatch | None, radiance: np.ndarray, confidence: np.ndarray | None, library: Library
) -> HeldMatch:
    """What was held, or a new choice where there is none or the estimate has moved away; pure.

    Args:
        radiance: [H, 2H, 3] of this frame, all frames in one frame of reference; confidence: [H, 2H] or None.
    """
    features = features_of(radiance)
    if held is not None and _apart(features, held.features) < MOVED:
        return held
    match = find_match(radiance, confidence, library)
    turn, gain = (np.ascontiguousarray(one) for one in (match.candidate_from_estimate, match.ln_gain))
    # in the order of memory that a file gives back: sums go by it, to the last bit
    match = replace(match, candidate_from_estimate=turn, ln_gain=gain)
    return HeldMatch(match=match, features=np.ascontiguousarray(features))


def exposed_match(held: HeldMatch, radiance: np.ndarray) -> Match:
    """The held match at the exposure and white balance of a frame's estimate [H, 2H, 3]."""
    shift = _mean(features_of(radiance) - held.features)[:3]
    return replace(held.match, ln_gain=held.match.ln_gain + shift)


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    difference = one - other
    return float(np.sqrt(_mean((difference - _mean(difference)) ** 2).mean()))


def _mean(values: np.ndarray) -> np.ndarray:
    """Over the sphere, [16, 32, C] to [C]."""
    return (values * pixel_solid_angles(FEATURE_ROWS)[..., None]).sum(axis=(0, 1)) / (4 * np.pi)

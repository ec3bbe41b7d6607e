"""Doubts about the first panorama of a match: another kind of place, another lighting."""

from __future__ import annotations

import numpy as np

from anyprobe.estimate.result import Light
from anyprobe.light.environment import MAP_HEIGHT, rotate
from anyprobe.match.ranking import OWN_ERROR, MatchedMap, log_odds, same_kind, shading_apart
from anyprobe.notices import Notice, give

UNLIKE = 0.4
"""Probability up to which a place and a map are hardly of one kind."""


def match_doubts(light: Light, first: MatchedMap) -> list[Notice]:
    """Return what is doubtful about a light's first map."""
    to_camera = light.map_from_camera.T
    radiance, estimate = rotate(first.radiance(MAP_HEIGHT), to_camera), rotate(light.radiance, to_camera)
    doubts = fit_doubts(estimate, radiance)
    if light.pitch_deg is None:
        text = "the camera's pitch is unknown, so maps may be tilted"
        doubts.append(Notice(text, code="pitch-unknown", remedy=give("pitch_deg")))
    return doubts + kind_doubts(light.outdoors, first.library.lights[first.index], first.name)


def fit_doubts(estimate: np.ndarray, radiance: np.ndarray) -> list[Notice]:
    """Return a warning if the first map shades a matte sphere further from the estimate than the estimate's own error.

    Then no other map shades it as the estimate does, either. Both maps [H, 2H, 3] are in the camera's frame.
    """
    apart = shading_apart(radiance, estimate)
    if apart <= OWN_ERROR:
        return []
    text = (
        f"no panorama fits: the first one shades a matte sphere {apart:.1f} stops off the estimate, more than the "
        "estimate's own error; use the estimate itself, or other panoramas"
    )
    return [Notice(text, code="match-fit")]


def kind_doubts(outdoors: float | None, radiance: np.ndarray, name: str) -> list[Notice]:
    """Return a warning if a panorama [H, 2H, 3] is hardly of the same kind of place as a light's, which is outdoors
    with this probability, see match.ranking."""
    theirs = log_odds(radiance[None])
    if same_kind(outdoors, theirs)[0] > UNLIKE:
        return []
    kinds = ("outdoors", "indoors") if theirs[0] > 0 else ("indoors", "outdoors")
    text = "looks {}, but the light is as {}; check the map before using it".format(*kinds)
    return [Notice(text, code="match-kind", source=name)]

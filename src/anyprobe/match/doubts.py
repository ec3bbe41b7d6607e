"""Doubts about the first panorama of a match: another kind of place, another lighting, another level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions
from anyprobe.light.environment import MAP_HEIGHT, integral
from anyprobe.match.kind import is_outdoors, photo_outdoors
from anyprobe.notices import Notice, give
from anyprobe.render.spheres import diffuse, sphere_normals

if TYPE_CHECKING:
    from anyprobe.estimate.result import Light
    from anyprobe.match.ranking import MatchedMap

STOPS_APART = 1.0
"""Difference in brightness above which a map's level is doubtful [stops]."""
OWN_ERROR = 0.8
"""Error of an estimate's shading that one in ten exceeds [stops], see shading_apart.

Of 182 left-out renders of whole photos, quantiles of .5, .8 and .9 are .33, .61 and .82, of 72 cut-outs .41, .65 and
1.03 (`python -m research.scenes shading`).
"""
MOST_TRIED = 20
"""Number of maps, the best first, among which one that fits is looked for."""
SHADED, FAINT = 16, 1e-4
"""Size [px] of the sphere that is compared, and the share of the mean radiance added before logarithms."""


def match_doubts(light: Light, ranked: Sequence[MatchedMap]) -> list[Notice]:
    """Return what is doubtful about the first of a light's maps, the best first."""
    first, radiance = ranked[0], ranked[0].radiance(MAP_HEIGHT)
    doubts = fit_doubts(light, ranked)
    if light.pitch_deg is None and (light.shown is None or light.shown.behind is None):
        text = "the camera's pitch is unknown, so maps may be tilted"
        doubts.append(Notice(text, code="pitch-unknown", remedy=give("pitch_deg")))
    stops = stops_apart(radiance, light.radiance)
    if abs(stops) > STOPS_APART:
        text = (
            f"the first map lights the object's visible side {stops:+.1f} stops off the estimate, as the object "
            "and its background need different exposures; check the sheet before using the map"
        )
        doubts.append(Notice(text, code="match-level"))
    outdoors = photo_outdoors(light.plate, light.warnings)
    return doubts + kind_doubts(outdoors, first.library.lights[first.index], first.name)


def fit_doubts(light: Light, ranked: Sequence[MatchedMap]) -> list[Notice]:
    """Return a warning if the first map shades a matte sphere unlike the estimate, by more than that may be wrong."""
    apart = shading_apart(ranked[0].radiance(MAP_HEIGHT), light.radiance)
    if apart <= OWN_ERROR:
        return []
    text = f"the first panorama shades a matte sphere {apart:.1f} stops off the estimate, more than that may be wrong"
    for other in ranked[1:MOST_TRIED]:
        if shading_apart(other.radiance(MAP_HEIGHT), light.radiance) <= OWN_ERROR:
            text = f"{text}; the first that fits is number {other.rank + 1}, {other.name}"
            return [Notice(text, code="match-fit")]
    return [Notice(f"no panorama fits: {text}; use the estimate itself, or other panoramas", code="match-fit")]


def kind_doubts(outdoors: bool | None, radiance: np.ndarray, name: str) -> list[Notice]:
    """Return a warning if a panorama [H, 2H, 3] is outdoors and the photo shows no sign of it, or the other way round.

    outdoors: of the photo, see match.kind.photo_outdoors.
    """
    map_is_outdoors = is_outdoors(radiance)
    if map_is_outdoors == bool(outdoors):
        return []
    if outdoors:
        text = "looks indoors, but the photo shows sky or plants"
    elif outdoors is None:
        text = "looks outdoors, but the photo shows nothing of its place"
    else:
        text = "looks outdoors, but the photo shows neither sky nor plants"
    return [Notice(f"{text}; check the map before using it", code="match-kind", source=name)]


def stops_apart(radiance: np.ndarray, other: np.ndarray) -> float:
    """Return by how many stops a map [H, 2H, 3] lights a plane that faces the camera more than another map does."""
    irradiance = [
        integral(light * np.maximum(pixel_directions(len(light))[..., 2:], 0.0)) for light in (radiance, other)
    ]
    first, second = (max(float(luminance(rgb)), 1e-6) for rgb in irradiance)
    return float(np.log2(first / second))


def shading_apart(radiance: np.ndarray, other: np.ndarray) -> float:
    """Return how differently two maps [H, 2H, 3] shade a matte sphere, in stops: root mean square over its visible
    side, exposure being free."""
    normals, inside = sphere_normals(SHADED)
    shades = [
        np.log2(luminance(diffuse(light, SHADED)[inside]) + FAINT * float(light.mean())) for light in (radiance, other)
    ]
    apart = shades[0] - shades[1]
    facing = normals[:, 2]
    apart = apart - np.average(apart, weights=facing)
    return float(np.sqrt(np.average(apart**2, weights=facing)))

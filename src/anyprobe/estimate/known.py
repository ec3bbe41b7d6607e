"""Prior knowledge beside the photo: normals and surroundings, with their origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate.depth_normals import normals_from_depth
from anyprobe.estimate.normals_hint import normals_from_outline, read_normals
from anyprobe.estimate.surroundings import read_panorama
from anyprobe.hints import AUTO, NONE, PHOTO, SPHERE, Hints, NormalsSource, SurroundingsSource
from anyprobe.notices import Notice, give
from anyprobe.pictures.images import Pixels

FROM_DEPTH = "depth"
"""Origin of normals computed from a depth image rather than given."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PhotoBackground:
    """The photo's background, used as part of the map.

    is_asked: whether the caller asked for it, so that a photo without a background is refused.
    """

    is_asked: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class GivenPanorama:
    """Part of the map given by a file, in the camera's frame, see estimate.surroundings.

    small: [64, 128, 4 or 5]; full: the same with as many rows as the file has, 512 at most; None where not needed.
    """

    small: np.ndarray
    full: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class KnownNormals:
    """Normals of the object.

    values: [H, W, 3] in the camera's frame, unit, or zero where unknown. origin: "given", or "depth".
    """

    values: np.ndarray
    origin: str = "given"


def asked_surroundings(asked: SurroundingsSource | None) -> PhotoBackground | GivenPanorama | None:
    """Read the caller's surroundings; the default is "auto"."""
    if asked is None or (isinstance(asked, str) and asked in (AUTO, PHOTO, NONE)):
        return None if asked == NONE else PhotoBackground(is_asked=asked == PHOTO)
    small, full = read_panorama(asked)
    return GivenPanorama(small=small, full=full)


def find_normals(
    hints: Hints, pixels: Pixels, mask: np.ndarray, long_fov_deg: float, fov_source: str
) -> tuple[KnownNormals | None, tuple[Notice, ...]]:
    """Return the given normals, else those of a depth image, and doubts about them."""
    if hints.normals is not None:
        return KnownNormals(values=_given_normals(hints.normals, mask, long_fov_deg)), ()
    if hints.depth is None:
        return None, ()
    found = normals_from_depth(hints.depth, mask, long_fov_deg)
    if found.normals is None:
        text = f"{found.doubt}; normals are estimated from the photo"
        return None, (Notice(text, code="depth-unused", source=pixels.name, remedy=give("normals")),)
    known = KnownNormals(values=found.normals, origin=FROM_DEPTH)
    if fov_source != "default":
        return known, ()
    text = f"normals are from depth seen through an assumed lens of {long_fov_deg:g} degrees"
    return known, (Notice(text, code="assumed-lens", source=pixels.name, remedy=give("fov_deg")),)


def _given_normals(source: NormalsSource, mask: np.ndarray, long_fov_deg: float) -> np.ndarray:
    if isinstance(source, str) and source == SPHERE:
        return normals_from_outline(mask, long_fov_deg)
    try:
        return read_normals(source, mask.shape)
    except InputError as error:
        raise InputError(error, subject="normals") from error

"""Prior knowledge beside the photo: normals and surroundings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from anyprobe.errors import InputError
from anyprobe.estimate.normals_hint import normals_from_outline, read_normals
from anyprobe.estimate.surroundings import read_panorama
from anyprobe.inputs.hints import AUTO, NONE, PHOTO, SPHERE, NormalsSource, SurroundingsSource


@dataclass(frozen=True, kw_only=True, slots=True)
class PhotoBackground:
    """The photo's background, used as part of the map.

    is_asked: whether the caller asked for it, so that it is used whatever it looks like.
    """

    is_asked: bool = False


@dataclass(frozen=True, kw_only=True, slots=True)
class GivenPanorama:
    """Part of the map given by a file, in the camera's frame, see estimate.surroundings.

    values: [64, 128, 4].
    """

    values: np.ndarray


def asked_surroundings(asked: SurroundingsSource | None) -> PhotoBackground | GivenPanorama | None:
    """Read the caller's surroundings; the default is "auto"."""
    if asked is None or (isinstance(asked, str) and asked in (AUTO, PHOTO, NONE)):
        return None if asked == NONE else PhotoBackground(is_asked=asked == PHOTO)
    return GivenPanorama(values=read_panorama(asked))


def read_given_normals(source: NormalsSource | None, mask: np.ndarray, long_fov_deg: float) -> np.ndarray | None:
    """Return the given normals [H, W, 3], unit, or zero where unknown, in the camera's frame; None where none are."""
    if source is None:
        return None
    if isinstance(source, str) and source == SPHERE:
        return normals_from_outline(mask, long_fov_deg)
    try:
        return read_normals(source, mask.shape)
    except InputError as error:
        raise InputError(error, subject="normals") from error

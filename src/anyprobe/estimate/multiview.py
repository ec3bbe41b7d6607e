"""One light from several photos of one object in one place, with known camera poses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import is_rotation
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.estimate.merged_surroundings import cut_out, lay_over, seen_from, window
from anyprobe.estimate.photo import Crop, Photo
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.temporal import OFFSET
from anyprobe.notices import Notice
from anyprobe.scatter.materials import Material

if TYPE_CHECKING:
    from jaxtyping import Float

    from anyprobe.place.plate import Plate

_PLACES = 3
"""Largest number of places to which the light sources of several photos are gathered."""
VOTE = 12.0
"""Sharpness of the cosine power with which each photo's light sources vote for a place."""
REACH = np.cos(np.radians(40.0))
"""Cosine of the angle from a light source within which votes belong to it: 40 degrees."""
SOURCE_RADIUS = np.radians(4.0)
"""Radius [radians] of a light source, as in the maps of single photos."""
LEAST_POWER = 1e-3
"""Smallest luminance over the sphere of a light source."""


def fuse(maps: Float[np.ndarray, "N H 2*H 3"], weights: Float[np.ndarray, "N H 2*H"]) -> Float[np.ndarray, "H 2*H 3"]:
    """Fuse maps: their weighted geometric mean up to white, and their light sources by vote.

    Light above white in all of them stays. The rest are small light sources that the photos place side by side: a mean
    would show each photo's own, dimmer. They vote for places, and their mean power goes there.

    Args:
        maps: [N, H, 2H, 3] linear radiance, all in one frame and one scale.
        weights: [N, H, 2H], positive somewhere at every pixel.
    Returns:
        [H, 2H, 3].
    """
    share = (weights / weights.sum(axis=0))[..., None]
    up_to_white = maps / np.maximum(luminance(maps)[..., None], 1.0)
    mean = np.maximum(np.exp((share * np.log(up_to_white + OFFSET)).sum(axis=0)) - OFFSET, 0.0)
    above = maps - up_to_white
    common = above.min(axis=0)
    return (mean + common + _by_vote(above.mean(axis=0) - common)).astype(np.float32)


def _by_vote(above: np.ndarray) -> np.ndarray:
    """Gather all photos' light sources [H, 2H, 3] in a few, of the same power."""
    d, solid_angles = pixel_directions(len(above)), pixel_solid_angles(len(above))
    whole = left = luminance(above) * solid_angles
    found, power = np.zeros_like(above), 0.0
    for _ in range(_PLACES):
        if left.sum() < LEAST_POWER:
            break
        votes = blur_cosine_power((left / solid_angles)[..., None], VOTE)[..., 0]
        peak = d[np.unravel_index(np.argmax(votes), votes.shape)]
        center = np.einsum("hw,hwc->c", left * np.maximum(d @ peak, 0.0) ** VOTE, d)
        center /= np.linalg.norm(center)
        mine = (left > 0) & (d @ center > REACH)
        edge = (SOURCE_RADIUS - np.arccos(np.clip(d @ center, -1.0, 1.0))) * len(above) / np.pi
        disc = np.clip(edge + 0.5, 0.0, 1.0)
        color = (above * solid_angles[..., None] * mine[..., None]).sum(axis=(0, 1))
        found += disc[..., None] * (color / (disc * solid_angles).sum())
        power += float(left[mine].sum())
        left = np.where(mine, 0.0, left)
    return found * (whole.sum() / power) if power > 0 else found


SURE = 2.0
"""Exponent of the confidence that weights a map, pixel by pixel; chosen on assets that no weights learned from."""
_LEAST = 1e-4
"""Smallest weight of a pixel."""
NOT_GIVEN = Notice(
    "the photos' EXIF does not state every exposure; all are taken as exposed alike: lock exposure",
    code="exposure-unknown",
)


def cut_photos(
    photos: Iterable[Photo], start: float | None = None
) -> tuple[list[tuple[Photo, Crop]], list[float], Plate | None]:
    """Crop the object of each photo; return photos without pixels and crops, the seconds each took, the first's plate.

    photos: from load_photo, read in turn. start: time.perf_counter() when the first one's loading began.
    """
    start = time.perf_counter() if start is None else start
    taken, spent, plate = [], [], None
    for k, photo in enumerate(photos):  # photos may be loaded lazily, one after another
        if not isinstance(photo, Photo):
            raise InputError(
                f"expected what load_photo returns, got {type(photo).__name__}; load each first", subject="photos"
            )
        if k == 0 and photo.shows_place:
            plate = photo.plate()
        taken.append((photo.without_pixels(), cut_out(photo, first=k == 0)))
        spent.append(time.perf_counter() - start)
        start += spent[-1]
    return taken, spent, plate


def estimate_crops(
    from_crop: Callable[..., Light],
    taken: list[tuple[Photo, Crop]],
    world_from_camera: Sequence[np.ndarray] | np.ndarray,
    spent: Sequence[float],
    material: Material | None = None,
) -> Light:
    """Estimate one light of photos cut out by cut_photos, see fuse_lights; surroundings are shared across views.

    Args:
        from_crop: method of an Estimator.
        world_from_camera: [3, 3] of each. Surroundings that are a panorama are in the first photo's frame.
        spent: seconds on each so far. material: the object's, if given.
    Raises:
        InputError: see fuse_lights.
    """
    turns = _turns(len(taken), world_from_camera)
    gains, _ = _gains([photo.exposure for photo, _ in taken])
    to_first = [turn @ crop.camera_from_crop for turn, (_, crop) in zip(turns, taken, strict=True)]
    merged = _merged([crop for _, crop in taken], to_first, gains)
    lights = [
        from_crop(photo, crop, time.perf_counter() - seconds, material=material, merged_surroundings=seen)
        for (photo, crop), seconds, seen in zip(taken, spent, merged, strict=True)
    ]
    return fuse_lights(lights, world_from_camera)


def _merged(crops: list[Crop], to_first: list[np.ndarray], gains: list[float]) -> list[np.ndarray | None]:
    """Merge the parts of the map that the photos show, in each crop's frame; the earlier of two photos wins."""
    panorama = None
    for crop, turn, gain in zip(crops[::-1], to_first[::-1], gains[::-1], strict=True):
        if crop.surroundings_map is not None:
            panorama = lay_over(window(crop.surroundings_map, turn, gain), panorama)
    if panorama is None:
        return [None] * len(crops)
    return [
        seen_from(panorama, turn, crop.surroundings_map, gain)
        for crop, turn, gain in zip(crops, to_first, gains, strict=True)
    ]


def fuse_lights(lights: Sequence[Light], world_from_camera: Sequence[np.ndarray] | np.ndarray) -> Light:
    """Fuse lights into one, in the camera's frame and the exposure units of the first photo.

    In one photo the object faces directions that it does not face in another; where all lights are guesses, their
    errors average out. Each light is weighted by its confidence in a direction. Exposures are brought to the first
    photo's if all photos state theirs (EXIF); else the exposure must have been locked.

    Args:
        lights: from an Estimator, one per photo; neither light nor object may have moved between the photos.
        world_from_camera: [3, 3] each, of the same photos; in any world with fixed axes.
    Raises:
        InputError: no light, more or fewer poses than lights, or a pose that is no rotation.
    """
    turns, first = _turns(len(lights), world_from_camera), lights[0]
    gains, given = _gains([light.origin.exposure for light in lights])
    turned = [first] + [light.rotate(turn) for light, turn in zip(lights[1:], turns[1:], strict=True)]
    maps = np.stack([light.radiance * np.float32(gain) for light, gain in zip(turned, gains, strict=True)])
    sure = np.stack([np.ones(maps.shape[1:3]) if one.confidence is None else one.confidence for one in turned])
    weights = sure**SURE + _LEAST
    known = all(light.confidence is not None for light in lights)
    notes = [line for light in lights for line in light.warnings]
    notes += [] if len(lights) == 1 or given else [NOT_GIVEN]
    return replace(
        first,
        radiance=fuse(maps, weights),
        confidence=((weights * sure).sum(axis=0) / weights.sum(axis=0)).astype(np.float32) if known else None,
        well_exposed_fraction=float(np.mean([light.well_exposed_fraction for light in lights])),
        warnings=tuple(dict.fromkeys(notes)),
        find_shown=first.find_shown if len(lights) == 1 else None,
        expected=first.expected if len(lights) == 1 else None,
        origin=_fused_origin(lights),
    )


def _turns(count: int, world_from_camera: Sequence[np.ndarray] | np.ndarray) -> list[np.ndarray]:
    """Return first_from_camera [3, 3] of each photo."""
    if not count or count != len(world_from_camera):
        raise InputError(f"expected one a light, got {len(world_from_camera)} for {count} lights", subject="poses")
    for number, pose in enumerate(world_from_camera, start=1):
        if not is_rotation(np.asarray(pose)):
            raise InputError(f"expected rotations [3, 3], got another matrix for photo {number}", subject="poses")
    return [np.asarray(world_from_camera[0]).T @ np.asarray(pose) for pose in world_from_camera]


def _gains(exposures: list[float | None]) -> tuple[list[float], bool]:
    """Return each photo's gain to the first one's exposure, and whether all exposures are known."""
    given = [one for one in exposures if one]
    if len(given) < len(exposures):
        return [1.0] * len(exposures), False
    return [given[0] / one for one in given], True


def _fused_origin(lights: Sequence[Light]) -> Origin:
    """Combine the first photo's origin with all names and all seconds, step by step."""
    given = [light.origin.seconds for light in lights if light.origin.seconds]
    seconds = {step: round(sum(one[step] for one in given), 4) for step in given[0]} if given else None
    return replace(lights[0].origin, fused=[light.origin.photo for light in lights], seconds=seconds)

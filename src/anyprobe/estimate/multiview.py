"""One light from several photos of one object in one place, with known camera poses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from anyprobe.core import Float
from anyprobe.core.color import luminance
from anyprobe.core.frames import is_rotation
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.estimate.extract import Extract
from anyprobe.estimate.light_graph import SEEN_CONFIDENCE
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin
from anyprobe.estimate.surroundings import LEAST_COVER, GivenPanorama
from anyprobe.light.environment import integral, rotate
from anyprobe.light.light_sources import LightSource, draw_sources, find_sources
from anyprobe.light.temporal import OFFSET
from anyprobe.notices import Notice

SHARED = 30
"""Smallest number of pixels that two windows must share to be compared."""
COMPARED = 0.02, 0.8
"""Radiance range in which two photos can be compared: neither noise nor clipped."""
DIFFER = 0.12
"""Mean difference of display values, exposure apart, above which the older view shows another light or place."""


def lay_over(newer: np.ndarray, older: np.ndarray | None) -> np.ndarray:
    """Return the newer view where it shows something, else the older, brought to the newer's exposure by what both
    show. Both are [64, 128, 4] of Light.seen, in one frame; everything shown counts as infinitely far.

    older: None where there is none yet.

    Where both show the same place and differ, the older is dropped: a light was switched off, or the poses are wrong.
    """
    if older is None:
        return newer
    both = (newer[..., 3] > 0.5) & (older[..., 3] > 0.5)
    if both.sum() >= SHARED:
        now, then = (one[both, :3] / one[both, 3:4] for one in (newer, older))
        light = luminance(now), luminance(then)
        given = np.all([(one > COMPARED[0]) & (one < COMPARED[1]) for one in light], axis=0)
        gain = np.float32(np.median(light[0][given] / light[1][given])) if given.sum() >= SHARED else np.float32(1)
        if np.abs(response(now) - response(then * gain)).mean() > DIFFER:
            return newer
        older = np.concatenate([older[..., :3] * gain, older[..., 3:]], axis=-1)
    return newer + (1 - newer[..., 3:]) * older


def completed(light: Light, known: np.ndarray) -> Light:
    """Return a light with what is known beside its own photo's part, [64, 128, 4] in the camera's frame, in the map."""
    own = 0.0 if light.seen is None else light.seen[..., 3:]
    share = (known[..., 3:] * (1.0 - own)).clip(0.0, 1.0)
    shown = known[..., :3] / np.maximum(known[..., 3:], LEAST_COVER)
    radiance = (light.radiance + share * (shown - light.radiance)).astype(np.float32)
    if light.confidence is None:
        return replace(light, radiance=radiance)
    confidence = light.confidence + share[..., 0] * (SEEN_CONFIDENCE - light.confidence)
    return replace(light, radiance=radiance, confidence=confidence.astype(np.float32))


REACH = np.cos(np.radians(40.0))
"""Cosine of the angle within which photos' light sources are taken for one."""
RADIUS_DEG = 4.0
"""Radius of a light source, as in the maps of single photos."""


def fuse(maps: Float[np.ndarray, "N H 2*H 3"], weights: Float[np.ndarray, "N H 2*H"]) -> Float[np.ndarray, "H 2*H 3"]:
    """Fuse maps: their weighted geometric mean up to white, and their light sources gathered.

    Light above white in all of them stays. The rest are small light sources that the photos place side by side: a mean
    would show each photo's own, dimmer. Their mean power goes to their middle.

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
    return (mean + common + _gathered(above - common)).astype(np.float32)


def _gathered(above: Float[np.ndarray, "N H 2*H 3"]) -> Float[np.ndarray, "H 2*H 3"]:
    """Draw the light sources of N photos' maps where most of their power is together, of the same mean power."""
    found = [source for one in above for source in find_sources(one)]
    directions, powers = (np.array([getattr(one, name) for one in found]) for name in ("direction", "power"))
    places = []
    while len(powers):
        near = directions @ directions.T > REACH
        mine = near[np.argmax(near @ luminance(powers))]
        toward = luminance(powers[mine]) @ directions[mine]
        middle = toward / np.linalg.norm(toward)
        places.append(LightSource(direction=middle, radius_deg=RADIUS_DEG, power=powers[mine].sum(axis=0)))
        directions, powers = directions[~mine], powers[~mine]
    drawn = draw_sources(above.shape[1], places)
    return drawn * (luminance(integral(above.mean(axis=0))) / max(luminance(integral(drawn)), 1e-9))


SURE = 2.0
"""Exponent of the confidence that weights a map, pixel by pixel; chosen on assets that no weights learned from."""
_LEAST = 1e-4
"""Smallest weight of a pixel."""
NOT_GIVEN = Notice(
    "the photos' EXIF does not state every exposure; all are taken as exposed alike: lock exposure",
    code="exposure-unknown",
)


def estimate_views(
    from_extract: Callable[[Extract], Light],
    extracts: Iterable[Extract],
    world_from_camera: Sequence[np.ndarray] | np.ndarray,
) -> Light:
    """Estimate one light of several photos, see fuse_lights; a panorama from a file is of the first one's frame.

    Args:
        from_extract: method of an Estimator.
        extracts: of which no more than one is kept at a time.
    """
    lights: list[Light] = []
    panorama = None
    for number, extract in enumerate(extracts):
        panorama = extract.inputs["panorama"] if panorama is None else panorama
        if lights and panorama.any() and number < len(world_from_camera):
            turn = np.asarray(world_from_camera[0]).T @ np.asarray(world_from_camera[number])
            turned = GivenPanorama(values=panorama[0]).turned(turn.T).values[None]
            extract = replace(extract, inputs={**extract.inputs, "panorama": turned})
        lights.append(from_extract(extract))
    return fuse_lights(lights, world_from_camera)


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
    if not lights or len(lights) != len(world_from_camera):
        text = f"expected one a light, got {len(world_from_camera)} for {len(lights)} lights"
        raise InputError(text, subject="poses")
    for number, pose in enumerate(world_from_camera, start=1):
        if not is_rotation(np.asarray(pose)):
            raise InputError(f"expected rotations [3, 3], got another matrix for photo {number}", subject="poses")
    turns = [np.asarray(world_from_camera[0]).T @ np.asarray(pose) for pose in world_from_camera]
    first = lights[0]
    exposures = [light.origin.exposure or 0.0 for light in lights]
    gains = [exposures[0] / one for one in exposures] if all(exposures) else [1.0] * len(lights)
    turned = [first] + [light.rotate(turn) for light, turn in zip(lights[1:], turns[1:], strict=True)]
    maps = np.stack([light.radiance * np.float32(gain) for light, gain in zip(turned, gains, strict=True)])
    sure = np.stack([np.ones(maps.shape[1:3]) if one.confidence is None else one.confidence for one in turned])
    weights = sure**SURE + _LEAST
    known = all(light.confidence is not None for light in lights)
    notes = [line for light in lights for line in light.warnings]
    notes += [] if len(lights) == 1 or all(exposures) else [NOT_GIVEN]
    seen, said_outdoors = _seen_together(lights, turns), [one.outdoors for one in lights if one.outdoors is not None]
    return replace(
        first,
        seen=seen,
        radiance=fuse(maps, weights),
        confidence=((weights * sure).sum(axis=0) / weights.sum(axis=0)).astype(np.float32) if known else None,
        well_exposed_fraction=float(np.mean([light.well_exposed_fraction for light in lights])),
        warnings=tuple(dict.fromkeys(notes)),
        find_shown=first.find_shown if len(lights) == 1 else None,
        soft=first.soft if len(lights) == 1 else None,
        outdoors=float(np.mean(said_outdoors)) if said_outdoors else None,
        said_error_deg=first.said_error_deg if len(lights) == 1 else None,
        said_sources=first.said_sources if len(lights) == 1 else None,
        origin=_fused_origin(lights, seen),
    )


def _seen_together(lights: Sequence[Light], turns: Sequence[np.ndarray]) -> np.ndarray | None:
    """Return what all photos show of the light, [64, 128, 4] of Light.seen in the first camera's frame."""
    together = None
    for light, turn in zip(lights[::-1], turns[::-1], strict=True):
        if light.seen is not None:
            together = lay_over(np.maximum(rotate(light.seen, turn), 0.0), together)
    return together


def _fused_origin(lights: Sequence[Light], seen: np.ndarray | None) -> Origin:
    """Combine the first photo's origin with all names, what all show, and all seconds, step by step."""
    given = [light.origin.seconds for light in lights if light.origin.seconds]
    seconds = {step: round(sum(one[step] for one in given), 4) for step in given[0]} if given else None
    hints = dict(lights[0].origin.hints or {})
    if seen is not None and seen[..., 3].any():
        hints["surroundings"] = round(float(integral(seen[..., 3:])[0] / (4 * np.pi)), 4)
    return replace(lights[0].origin, hints=hints, fused=[light.origin.photo for light in lights], seconds=seconds)

"""Light sources of a map, soft to hard: a few, of direction, power and angular size; under an even sky there are none.

A source lies where the mean luminance over a cap of _PLACE_DEG is greatest, the next where it is greatest further than
_APART_DEG from all before and off their discs. It is what the widest disc sends beyond the ring around it. Its radius
is that of an even disc that has SIZED of its power within the same angle of the centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cap

if TYPE_CHECKING:
    from jaxtyping import Float

_PLACE_DEG, _APART_DEG = 8.0, 16.0
_RADII_DEG = (2.0, 3.0, 4.0, 6.0, 8.0, 11.0, 16.0)
SETTLED_DEG = (16.0, 16.0)
"""Discs to whose centre of light a place moves, one after the other."""
RING_DEG = 22.0
"""Outer radius of the ring around the widest disc."""
SIZED = 0.8
_STEPS_DEG = np.arange(0.25, _RADII_DEG[-1] + 0.01, 0.25)
SMALLEST_DEG = _RADII_DEG[0]
"""Smaller discs cannot be told from one pixel."""
_WIDENED = 0.4
"""Share of a pixel's squared side by which sampling enlarges a disc's squared radius."""
LEAST_SHARE = 0.04
"""Least share of the map's power that a source has."""
LEAST_CONTRAST = 3.0
"""Least luminance of a source, in multiples of the ring's around it."""
MOST_SOURCES: int = contract("source_split")["most"]
"""The number of light sources that a map has at most: here, in the filter of videos and in the networks' heads."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightSource:
    """A round light source far away, in the map's frame.

    direction: [3] unit vector towards it. irradiance: [3] E on a plane that faces it, linear Rec. 709. radius_deg: of
    its disc. share: of the map's power, the integral of luminance over all directions.
    """

    direction: np.ndarray
    irradiance: np.ndarray
    radius_deg: float
    share: float


def find_light_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[LightSource, ...]:
    """The light sources of a map [H, 2H, 3], the one with the brightest place first; MOST_SOURCES at most."""
    small = reduced(np.asarray(radiance, np.float32))
    d = pixel_directions(len(small)).reshape(-1, 3)
    angles = np.broadcast_to(pixel_solid_angles(len(small)), small.shape[:2]).ravel()
    bright = luminance(small)
    left = blur_cap(bright[..., None], np.radians(_PLACE_DEG)).ravel().copy()
    colors, bright = small.reshape(-1, 3), bright.ravel()
    total = float(bright @ angles)
    found: list[LightSource] = []
    while len(found) < MOST_SOURCES and total > 0 and left.max() > 0:
        peak = d[int(np.argmax(left))]
        near = d @ peak > np.cos(np.radians(_PLACE_DEG))
        center = peak
        for radius in (_PLACE_DEG, *SETTLED_DEG):
            disc = d @ center > np.cos(np.radians(radius))
            center = ((bright - bright[disc].min()) * angles * disc) @ d + 1e-9 * center
            center = center / np.linalg.norm(center)
        if any(center @ one.direction > np.cos(np.radians(_APART_DEG)) for one in found):
            left[near] = 0.0  # the rim of one that is found
            continue
        cosine = d @ center
        source = _source(colors, bright, angles, cosine, total)
        if source is None:
            break
        apart = max(_APART_DEG, source[0] + _PLACE_DEG + 2.0)  # where the cap holds none of it
        left[(cosine > np.cos(np.radians(apart))) | near] = 0.0
        _, irradiance, share, radius = source
        found.append(
            LightSource(direction=center.astype(np.float32), irradiance=irradiance, radius_deg=radius, share=share)
        )
    return tuple(found)


def split_light_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[tuple[LightSource, ...], np.ndarray]:
    """The light sources of a map, and the map [H, 2H, 3] without them, for renderers that are given both.

    Of each disc of the widest radius what is brighter than the ring around it is taken out, pixel by pixel, one source
    after the other; irradiance is what that was, so that on a plane that faces it E of the map = E of the rest +
    irradiance. It differs from find_light_sources' where the map has more rows or discs overlap.
    """
    rest = np.array(radiance, np.float32)
    d, angles = pixel_directions(len(rest)), pixel_solid_angles(len(rest))
    angles = np.broadcast_to(angles, d.shape[:2])
    widest, rim = np.cos(np.radians((_RADII_DEG[-1], RING_DEG)))
    found = find_light_sources(radiance)
    bright = np.any([d @ source.direction >= widest for source in found], axis=0)
    sources = []
    for source in found:
        cosine = d @ source.direction
        disc, ring = cosine >= widest, (cosine < widest) & (cosine > rim)
        dull = ring & ~bright  # not what another source sends
        ring = dull if dull.any() else ring
        if not ring.any():  # of a map of a few rows
            continue
        around = np.average(rest[ring], axis=0, weights=angles[ring])
        taken = np.maximum(rest[disc] - around, 0.0)
        irradiance = ((cosine * angles)[disc] @ taken).astype(np.float32)
        rest[disc] -= taken
        if irradiance.max() > 0:
            sources.append(replace(source, irradiance=irradiance))
    return tuple(sources), rest


def _source(colors, bright, angles, cosine, total: float) -> tuple[float, np.ndarray, float, float] | None:
    """The smallest of _RADII_DEG with SIZED of the power, irradiance [3], share, and radius in degrees, of what lies
    around a direction; None where that is no source."""
    degrees = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    ring = (degrees > _RADII_DEG[-1]) & (degrees < RING_DEG)
    if not ring.any():  # of a map of a few rows
        return None
    around = np.average(colors[ring], axis=0, weights=angles[ring])
    beyond = np.maximum(colors - around, 0.0) * angles[:, None]
    within = np.array([luminance(beyond[degrees <= r].sum(axis=0)) for r in _RADII_DEG])
    share = float(within[-1] / total)
    size = int(np.argmax(within >= SIZED * within[-1]))
    disc = degrees <= _RADII_DEG[size]
    mean = float(np.average(bright[disc], weights=angles[disc])) if disc.any() else 0.0
    if share < LEAST_SHARE or mean < LEAST_CONTRAST * float(luminance(around)):
        return None
    whole = degrees <= _RADII_DEG[-1]
    irradiance = (beyond[whole] * np.maximum(cosine[whole], 0.0)[:, None]).sum(axis=0)
    pixel = float(np.degrees(np.sqrt(2 * np.pi**2 / len(angles))))
    radius = _radius_deg(luminance(beyond), degrees, pixel)
    return _RADII_DEG[size], irradiance.astype(np.float32), share, radius


def _radius_deg(power: Float[np.ndarray, " P"], degrees: Float[np.ndarray, " P"], pixel: float) -> float:
    """Radius of a disc by the powers of pixels so many degrees from its centre, and so wide."""
    near = degrees < _RADII_DEG[-1] + pixel
    covers = np.clip(0.5 + (_STEPS_DEG[:, None] - degrees[near]) / pixel, 0.0, 1.0)
    within = covers @ power[near]
    reach = float(np.interp(SIZED * within[-1], within, _STEPS_DEG))
    squared = reach**2 / SIZED - _WIDENED * pixel**2
    return float(np.clip(np.sqrt(max(squared, 0.0)), SMALLEST_DEG, _RADII_DEG[-1]))

"""Light sources of a map: a few directions with power and angular size; none under an even sky.

The first source lies where the mean luminance over a cap of _PLACE_DEG is greatest; each further one where it is
greatest outside the discs of all before and more than _APART_DEG from them. A source's power is what the widest disc
sends beyond the ring around it. Its radius is that of an even disc with SIZED of its power within the same angle.
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
"""Radii [degrees] of the discs whose centre of light a source moves to, one after the other."""
RING_DEG = 22.0
"""Outer radius [degrees] of the ring around the widest disc."""
SIZED = 0.8
_STEPS_DEG = np.arange(0.25, _RADII_DEG[-1] + 0.01, 0.25)
SMALLEST_DEG = _RADII_DEG[0]
"""Smallest radius of a disc [degrees]; a smaller one cannot be told from one pixel."""
_WIDENED = 0.4
"""Share of a pixel's squared side by which sampling enlarges a disc's squared radius."""
LEAST_SHARE = 0.04
"""Smallest share of the map's power that a source may have."""
LEAST_CONTRAST = 3.0
"""Smallest luminance of a source, in multiples of that of the ring around it."""
MOST_SOURCES: int = contract("source_split")["most"]
"""Largest number of light sources in a map: found here, in a frame of a video, or by the networks' heads."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightSource:
    """Round light source at infinity, in the map's frame.

    direction: [3] unit vector towards it.
    irradiance: [3] E on a plane that faces it, linear Rec. 709.
    radius_deg: radius of its disc.
    share: its part of the map's power, the integral of luminance over all directions.
    """

    direction: np.ndarray
    irradiance: np.ndarray
    radius_deg: float
    share: float


def find_light_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[LightSource, ...]:
    """Find up to MOST_SOURCES light sources of a map [H, 2H, 3]; the one with the brightest place comes first."""
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
            left[near] = 0.0  # rim of a source already found
            continue
        cosine = d @ center
        source = _source(colors, bright, angles, cosine, total)
        if source is None:
            break
        apart = max(_APART_DEG, source[0] + _PLACE_DEG + 2.0)  # beyond this the cap holds none of it
        left[(cosine > np.cos(np.radians(apart))) | near] = 0.0
        _, irradiance, share, radius = source
        found.append(
            LightSource(direction=center.astype(np.float32), irradiance=irradiance, radius_deg=radius, share=share)
        )
    return tuple(found)


def split_light_sources(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[tuple[LightSource, ...], np.ndarray]:
    """Split a map [H, 2H, 3] into its light sources and the rest, for renderers that are given both.

    Every pixel of a source's widest disc loses what it has above the ring around the disc, one source after the other.
    The irradiance is that of the removed light, so that on a plane that faces the source E of the map = E of the rest +
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
        dull = ring & ~bright  # pixels that no other source lights
        ring = dull if dull.any() else ring
        if not ring.any():  # a map of a few rows
            continue
        around = np.average(rest[ring], axis=0, weights=angles[ring])
        taken = np.maximum(rest[disc] - around, 0.0)
        irradiance = ((cosine * angles)[disc] @ taken).astype(np.float32)
        rest[disc] -= taken
        if irradiance.max() > 0:
            sources.append(replace(source, irradiance=irradiance))
    return tuple(sources), rest


def _source(colors, bright, angles, cosine, total: float) -> tuple[float, np.ndarray, float, float] | None:
    """Measure the source around a direction; None if there is no source.

    Returns the smallest of _RADII_DEG that holds SIZED of the power, irradiance [3], share of the map's power, and
    radius in degrees.
    """
    degrees = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    ring = (degrees > _RADII_DEG[-1]) & (degrees < RING_DEG)
    if not ring.any():  # a map of a few rows
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
    """Return the radius [degrees] of a disc from the powers of pixels at `degrees` from its centre, `pixel` degrees
    wide."""
    near = degrees < _RADII_DEG[-1] + pixel
    covers = np.clip(0.5 + (_STEPS_DEG[:, None] - degrees[near]) / pixel, 0.0, 1.0)
    within = covers @ power[near]
    reach = float(np.interp(SIZED * within[-1], within, _STEPS_DEG))
    squared = reach**2 / SIZED - _WIDENED * pixel**2
    return float(np.clip(np.sqrt(max(squared, 0.0)), SMALLEST_DEG, _RADII_DEG[-1]))

"""The dominant light: the one lobe that a directional light stands for (sun, emitter, window).

Lobe = the connected pixels around the brightest one whose luminance, averaged over a cap 10 degrees across, is at least
half the peak. Half the peak falls a little inside the edge of a source 10 to 30 degrees across, so the sums run over
the lobe and the pixels that touch it; without those an emitter 14 degrees across loses a quarter of its power. The
light is their excess over the surroundings, L - L_ring with L_ring the mean radiance just outside.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cap

if TYPE_CHECKING:
    from jaxtyping import Bool, Float

BLUR_RADIUS = np.radians(contract("dominant_light")["blur_deg"])
"""Radius of the cap [radians]; a source narrower than that is one lobe, not several."""

LOBE_LEVEL: float = contract("dominant_light")["lobe_level"]
RING_PX: int = contract("dominant_light")["ring_px"]
ERROR: dict[str, float] = contract("dominant_light")["error"]
"""Numbers of spread_about and direction_error for a map alone; the networks state theirs."""


@dataclass(frozen=True, kw_only=True, slots=True)
class DominantLight:
    """A directional light in the map's frame.

    direction: [3] unit vector towards the light.
    irradiance: [3] E on a plane that faces it, linear Rec. 709; white Lambert there sends E / pi.
    color: [3] irradiance / its largest channel; ones where there is no light.
    solid_angle: of the lobe [sr]; never much below that of the blur.
    directionality: |sum L d dw| / sum L dw of luminance, 0 (even light) to 1 (one direction).
    error_deg: bound on the direction's error that holds for two of three estimated maps; see direction_error.
    """

    direction: np.ndarray
    irradiance: np.ndarray
    color: np.ndarray
    solid_angle: float
    directionality: float
    error_deg: float


def dilate(mask: Bool[np.ndarray, "H 2*H"]) -> Bool[np.ndarray, "H 2*H"]:
    """Grow a mask [H, 2H] by one pixel up, down, left and right on the sphere.

    The columns wrap around, and a pole row that is touched is taken whole: all of its pixels meet at the pole.
    """
    grown = mask.copy()
    grown[:, 1:] |= mask[:, :-1]
    grown[:, :-1] |= mask[:, 1:]
    grown[:, [0, -1]] |= mask[:, [-1, 0]]
    grown[1:] |= mask[:-1]
    grown[:-1] |= mask[1:]
    grown[0] |= mask[0].any()
    grown[-1] |= mask[-1].any()
    return grown


def connected(mask: Bool[np.ndarray, "H 2*H"], row: int, column: int) -> Bool[np.ndarray, "H 2*H"]:
    """Return the part of a mask [H, 2H] that is connected to one of its pixels on the sphere."""
    region = np.zeros_like(mask)
    region[row, column] = True
    count = 1
    while True:
        region = dilate(region) & mask
        last, count = count, int(np.count_nonzero(region))
        if count == last:
            return region


def _find_lobe(bright: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the brightest lobe of luminance [H, 2H], the lobe grown by a pixel, and the ring around that.

    Maps of more than SEARCH_ROWS rows are first reduced to that size.
    """
    height = len(bright)
    small = reduced(bright[..., None])
    blurred = blur_cap(small, BLUR_RADIUS)[..., 0]
    row, column = map(int, np.unravel_index(np.argmax(blurred), blurred.shape))
    lobe = connected(blurred >= LOBE_LEVEL * blurred[row, column], row, column)
    source = dilate(lobe)
    ring = source
    for _ in range(RING_PX):
        ring = dilate(ring)
    ring = ring & ~source
    surroundings = ring if ring.any() else source  # the lobe is the whole sphere: no light stands out
    if len(small) == height:
        return lobe, source, surroundings
    rows, columns = (((np.arange(n * height) + 0.5) * len(small) / height).astype(int) for n in (1, 2))
    return tuple(mask[np.ix_(rows, columns)] for mask in (lobe, source, surroundings))


def _moment(radiance: np.ndarray) -> np.ndarray:
    """Return the sum of luminance d dw over a map [H, 2H, 3], [3]."""
    height = len(radiance)
    return np.einsum("hw,hwc->c", luminance(radiance) * pixel_solid_angles(height), pixel_directions(height))


def spread_about(
    radiance: Float[np.ndarray, "H 2*H 3"], direction: np.ndarray, error: Mapping[str, float] = ERROR
) -> float:
    """Return the mean angle [degrees] between a unit direction and where a map's light comes from.

    Directions are weighed by luminance^error["power"] dw: bright places elsewhere make a direction doubtful, the dim
    rest of the map hardly. A black map gives 90.
    """
    height = radiance.shape[0]
    weight = luminance(radiance).astype(np.float64) ** error["power"] * pixel_solid_angles(height)
    total = float(weight.sum())
    if total <= 0:
        return 90.0
    angle = np.arccos(np.clip(pixel_directions(height) @ direction, -1.0, 1.0))
    return float(np.degrees((weight * angle).sum() / total))


def direction_error(spread_deg: float, error: Mapping[str, float] = ERROR) -> float:
    """Return a bound [degrees] on an estimated dominant light's error, which two of three estimates keep.

    spread_deg: result of spread_about.
    """
    grown = error["factor"] * (spread_deg + error["offset_deg"]) ** error["exponent"]
    return min(grown, error["most_deg"])


def find_dominant_light(radiance: Float[np.ndarray, "H 2*H 3"]) -> DominantLight:
    """Return the brightest lobe of a map [H, 2H, 3] as a directional light.

        E = sum over the lobe of (L - L_ring) cos(delta) dw, delta from the light's direction
        direction = energy-weighted mean of d over the lobe, energy = luminance(L - L_ring)+ dw

    A map without a lobe (black or uniform) gives irradiance 0 and direction +Y, WebXR's fallback.
    """
    return split_dominant_light(radiance)[0]


def split_dominant_light(radiance: Float[np.ndarray, "H 2*H 3"]) -> tuple[DominantLight, np.ndarray]:
    """Split a map [H, 2H, 3] into its dominant light and the rest, for renderers that are given both.

    The rest lacks exactly what the dominant light counts: the lobe's pixels become L_ring, so that on a plane that
    faces the light E of the map = E of the rest + irradiance, channel by channel.
    """
    height = radiance.shape[0]
    d = pixel_directions(height)
    solid_angles = np.broadcast_to(pixel_solid_angles(height), d.shape[:2])
    bright = luminance(radiance)
    total = float((bright * solid_angles).sum())
    moment = _moment(radiance)
    directionality = float(np.linalg.norm(moment)) / total if total > 0 else 0.0

    lobe, source, surroundings = _find_lobe(bright)
    surrounding = np.average(radiance[surroundings], axis=0, weights=solid_angles[surroundings])

    excess = radiance[source] - surrounding  # [K, 3]
    energy = np.maximum(luminance(excess), 0.0) * solid_angles[source]
    mean = energy @ d[source]
    length = float(np.linalg.norm(mean))
    if length <= 1e-6 * total:  # rounding alone, or light from all around: no direction
        none = DominantLight(
            direction=np.array([0.0, 1.0, 0.0], np.float32),
            irradiance=np.zeros(3, np.float32),
            color=np.ones(3, np.float32),
            solid_angle=0.0,
            directionality=directionality,
            error_deg=ERROR["most_deg"],
        )
        return none, radiance.copy()
    direction = mean / length
    cosine = np.maximum(d[source] @ direction, 0.0)
    perpendicular = np.maximum((cosine * solid_angles[source]) @ excess, 0.0)
    peak = perpendicular.max()  # 0 when a channel or two fall below the ring and the rest are level
    light = DominantLight(
        direction=direction.astype(np.float32),
        irradiance=perpendicular.astype(np.float32),
        color=(perpendicular / peak if peak > 0 else np.ones(3)).astype(np.float32),
        solid_angle=float(solid_angles[lobe].sum()),
        directionality=directionality,
        error_deg=direction_error(spread_about(radiance, direction)),
    )
    rest = radiance.copy()
    rest[source] -= np.where(perpendicular > 0, excess, 0.0)  # a channel without light stays whole
    return light, np.maximum(rest, 0.0)

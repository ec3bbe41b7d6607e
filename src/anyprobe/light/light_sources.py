"""Light sources: the lobes of a map that a directional light stands for (sun, emitter, window).

Lobe = the connected pixels around the brightest one whose luminance, averaged over a cap 10 degrees across, is at least
half the peak. Half the peak falls a little inside the edge of a source 10 to 30 degrees across, so the sums run over
the lobe and the pixels that touch it; without those an emitter 14 degrees across loses a quarter of its power. The
source is their excess over the surroundings, L - L_ring with L_ring the mean radiance just outside. The next lobe is
that of the pixels beyond the ring. The first is the dominant light, however faint; how likely each is a source at all:

    exists = x^steep / (1 + x^steep),  x = min(share / least_share, contrast / least_contrast, most_radius / radius)

with share = its power over the map's, contrast = its luminance over L_ring's. A network's word goes before the rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from anyprobe.core import Bool, Float
from anyprobe.core.color import luminance
from anyprobe.core.contract import contract
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cap

RULES: dict[str, Any] = contract("sources")
MOST_SOURCES: int = RULES["most"]
"""Largest number of light sources in a map: found here, in a frame of a video, or by the networks' heads."""
BLUR_RADIUS = np.radians(RULES["blur_deg"])
"""Radius of the cap [radians]; a source narrower than that is one lobe, not several."""
LIKELY: float = RULES["likely"]
"""Smallest probability of a source beside the dominant light, and of one that is taken out of a map."""
SAME = np.cos(np.radians(RULES["most_radius_deg"]))
"""Cosine of the angle within which a source that a network said is the one found."""
LEAST_EDGE = float(np.cos(np.radians(RULES["least_edge_deg"])))
LIKELY_DEG, MOST_LIKELY = 30.0, 0.99
"""A source farther than this from its direction is not the one that is said to exist; and the largest probability of
that which is believed."""
ERROR: dict[str, float] = RULES["error"]
"""Numbers of direction_error for a map alone; the networks state theirs."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LightSource:
    """Round light source at infinity, in the map's frame.

    direction: [3] unit vector towards it.
    radius_deg: of the even disc that spreads as much about the direction.
    power: [3] integral of its radiance [sr], linear Rec. 709.
    exists: probability that it is a source, and within 30 degrees of the direction, in [0, 1].
    error_deg: bound on the direction's error that holds for two of three estimates; see direction_error.
    """

    direction: np.ndarray
    radius_deg: float
    power: np.ndarray
    exists: float = 1.0
    error_deg: float = ERROR["most_deg"]

    @property
    def irradiance(self) -> Float[np.ndarray, " 3"]:
        """E on a plane that faces it; white Lambert there sends E / pi."""
        return self.power * np.float32(np.cos(np.radians(self.radius_deg) / 2) ** 2)

    @property
    def color(self) -> Float[np.ndarray, " 3"]:
        """Power over its largest channel; ones where there is none."""
        return self.power / self.power.max() if self.power.any() else np.ones(3, np.float32)

    @property
    def solid_angle(self) -> float:
        """Solid angle of the disc [sr]."""
        return float(2 * np.pi * (1 - np.cos(np.radians(self.radius_deg))))


NO_SOURCE = LightSource(
    direction=np.array([0.0, 1.0, 0.0], np.float32), radius_deg=0.0, power=np.zeros(3, np.float32), exists=0.0
)
"""The dominant light of a black or even map: WebXR's fallback."""


def find_sources(
    radiance: Float[np.ndarray, "H 2*H 3"], said: Float[np.ndarray, "S 4"] | None = None
) -> tuple[LightSource, ...]:
    """Return the dominant light of a map, and the other sources that are likely there; none of a black or even map.

    said: of each source that a network said, whether it exists, in [0, 1], and its direction.
    """
    found = [source for source, _, _ in _lobes(radiance, said)]
    return tuple(one for number, one in enumerate(found) if number == 0 or one.exists >= LIKELY)


def find_dominant_light(radiance: Float[np.ndarray, "H 2*H 3"]) -> LightSource:
    """Return the first of find_sources, or NO_SOURCE."""
    return next((source for source, _, _ in _lobes(radiance, None)), NO_SOURCE)


def split_sources(
    radiance: Float[np.ndarray, "H 2*H 3"], said: Float[np.ndarray, "S 4"] | None = None
) -> tuple[tuple[LightSource, ...], np.ndarray]:
    """Split a map [H, 2H, 3] into the sources that are likely there and the rest, for renderers that are given both.

    The rest lacks exactly the sources' power, channel by channel: their pixels become L_ring. So on a plane that faces
    all of a source E of the map = E of the rest + irradiance. said: see find_sources.
    """
    return _taken(radiance, (lobe for lobe in _lobes(radiance, said) if lobe[0].exists >= LIKELY))


def split_dominant_light(
    radiance: Float[np.ndarray, "H 2*H 3"], said: Float[np.ndarray, "S 4"] | None = None
) -> tuple[LightSource, np.ndarray]:
    """Split a map into its dominant light, or NO_SOURCE, and the rest, as split_sources does."""
    found, rest = _taken(radiance, (lobe for lobe, _ in zip(_lobes(radiance, said), range(1), strict=False)))
    return (found or (NO_SOURCE,))[0], rest


def softened_light(radiance: Float[np.ndarray, "H 2*H 3"], likely: float) -> Float[np.ndarray, "H 2*H 3"]:
    """Return a map whose dominant light is spread over where it may be: a von Mises-Fisher lobe that has the share
    likely of its power within LIKELY_DEG."""
    source, rest = split_dominant_light(radiance)
    kappa = -np.log(1.0 - min(likely, MOST_LIKELY)) / (1.0 - np.cos(np.radians(LIKELY_DEG)))
    around = np.exp(kappa * (pixel_directions(len(radiance)) @ source.direction - 1.0))
    around /= (around * pixel_solid_angles(len(radiance))).sum()
    return (rest + source.power * around[..., None]).astype(np.float32)


def _taken(
    radiance: np.ndarray, lobes: Iterable[tuple[LightSource, np.ndarray, np.ndarray]]
) -> tuple[tuple[LightSource, ...], np.ndarray]:
    """Take lobes, which do not overlap, out of a map."""
    rest, found = radiance.copy(), []
    for source, pixels, excess in lobes:
        rest[pixels] -= np.where(source.power > 0, excess, 0.0)  # a channel without light stays whole
        found.append(source)
    return tuple(found), np.maximum(rest, 0.0)


def _lobes(
    radiance: np.ndarray, said: np.ndarray | None
) -> Iterator[tuple[LightSource, Bool[np.ndarray, "H 2*H"], Float[np.ndarray, "K 3"]]]:
    """Yield up to MOST_SOURCES sources by falling peak, each with its K pixels and their excess.

    A larger map than `reduced` returns is searched at that size, and summed as it is.
    """
    height = radiance.shape[0]
    d = pixel_directions(height)
    solid_angles = np.broadcast_to(pixel_solid_angles(height), d.shape[:2])
    bright = reduced(luminance(radiance)[..., None])
    rows = len(bright)
    finer = np.ix_(*(((np.arange(n * height) + 0.5) * rows / height).astype(int) for n in (1, 2)))
    blurred = blur_cap(bright, BLUR_RADIUS)[..., 0]
    total = float((bright[..., 0] * pixel_solid_angles(rows)).sum())
    lit, near = np.zeros_like(blurred, bool), np.zeros_like(blurred, bool)
    for _ in range(MOST_SOURCES):
        left = np.where(near, 0.0, blurred)
        row, column = map(int, np.unravel_index(np.argmax(left), left.shape))
        if left[row, column] <= 0:
            return
        lobe = connected(left >= RULES["lobe_level"] * left[row, column], row, column)
        own = ring = dilate(lobe)
        for _ in range(RULES["ring_px"]):
            ring = dilate(ring)
        beside = ring & ~own & ~lit
        lit, near = lit | own, near | ring
        pixels, around = own[finer], (beside if beside.any() else own)[finer]  # own: the lobe is the whole sphere
        level = np.average(radiance[around], axis=0, weights=solid_angles[around])
        excess, weights = radiance[pixels] - level, solid_angles[pixels]
        energy = np.maximum(luminance(excess), 0.0) * weights
        mean = energy @ d[pixels]
        length = float(np.linalg.norm(mean))
        if length <= 1e-6 * total:  # rounding alone, or light from all around: no direction
            return
        direction = mean / length
        power = np.maximum(weights @ excess, 0.0)  # 0 when a channel or two fall below the ring and the rest are level
        radius_deg = _radius_deg(length / float(energy.sum()), np.pi / height)
        inside = lobe[finer]
        peak = float(np.average(luminance(radiance[inside]), weights=solid_angles[inside]))
        source = LightSource(
            direction=direction.astype(np.float32),
            radius_deg=radius_deg,
            power=power.astype(np.float32),
            exists=_likelihood(
                direction, said, float(luminance(power)) / total, peak / float(luminance(level) + 1e-9), radius_deg
            ),
            error_deg=direction_error(bright[..., 0], direction),
        )
        said = None if said is None else said[said[:, 1:4] @ direction <= SAME]  # what was said holds for one lobe
        yield source, pixels, excess


def _radius_deg(cosine: float, pixel: float) -> float:
    """Return the radius [degrees] of an even disc of this mean cosine, less what pixels of this side [radians] spread;
    it is at least half of one."""
    beyond = max(2 * (1 - cosine) - pixel**2 / 6, pixel**2 / 8)
    return float(np.degrees(np.arccos(max(1 - beyond, -1.0))))


def _likelihood(
    direction: np.ndarray, said: np.ndarray | None, share: float, contrast: float, radius_deg: float
) -> float:
    """Return how likely a lobe is a source: as it was said of one in its place, else by the rule above."""
    if said is not None and (there := said[said[:, 1:4] @ direction > SAME, 0]).size:
        return float(there.max())
    x = min(share / RULES["least_share"], contrast / RULES["least_contrast"], RULES["most_radius_deg"] / radius_deg)
    return x ** RULES["steep"] / (1 + x ** RULES["steep"])


def dilate(mask: Bool[np.ndarray, "H 2*H"]) -> Bool[np.ndarray, "H 2*H"]:
    """Grow a mask [H, 2H] by one pixel up, down, left and right on the sphere.

    The columns wrap around, and a pole row that is touched is taken whole: all of its pixels meet at the pole.
    """
    grown = mask | np.roll(mask, 1, axis=1) | np.roll(mask, -1, axis=1)
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


def direction_error(bright: Float[np.ndarray, "H 2*H"], direction: np.ndarray) -> float:
    """Return a bound [degrees] on the error of a source's direction in a map of this luminance; two of three keep it.

    It grows with the mean angle between the direction and where the map's light comes from, weighed by
    luminance^power dw: bright places elsewhere make a direction doubtful, the dim rest of the map hardly.
    """
    weight = bright.astype(np.float64) ** ERROR["power"] * pixel_solid_angles(len(bright))
    angle = np.degrees(np.arccos(np.clip(pixel_directions(len(bright)) @ direction, -1.0, 1.0)))
    spread = float((weight * angle).sum() / weight.sum())
    return min(ERROR["factor"] * (spread + ERROR["offset_deg"]) ** ERROR["exponent"], ERROR["most_deg"])


def draw_sources(height: int, sources: Iterable[LightSource]) -> Float[np.ndarray, "H 2*H 3"]:
    """Draw sources as discs, brightest in the middle, that spread as much as even ones: L ~ cos(angle) - cos(edge).

    Each keeps its power on any grid.
    """
    d, angles = pixel_directions(height), np.broadcast_to(pixel_solid_angles(height), (height, 2 * height))
    drawn = np.zeros((height, 2 * height, 3), np.float32)
    for source in sources:
        shape = d @ source.direction - edge_cosine(source)
        disc = shape > 0.0
        part = shape[disc]
        drawn[disc] += (part / (part @ angles[disc]))[:, None] * source.power
    return drawn


def edge_cosine(source: LightSource) -> float:
    """Return the cosine of the angle at which the drawn disc of a source ends; a smaller one may miss all pixels."""
    return min(1.5 * float(np.cos(np.radians(source.radius_deg))) - 0.5, LEAST_EDGE)


def turned_said(said: Float[np.ndarray, "S 4"] | None, rotation: np.ndarray) -> Float[np.ndarray, "S 4"] | None:
    """Return what a network said of sources, see find_sources, in a map that is turned by [3, 3]."""
    return None if said is None else np.column_stack([said[:, 0], said[:, 1:4] @ np.asarray(rotation).T])

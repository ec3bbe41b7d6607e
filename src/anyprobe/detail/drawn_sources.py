"""Light sources of a map: taken out of it, and drawn again as what they may be in the place.

A source has a body of its own size, a weak one without an outline, and a faint glow around it. In a room a strong one
on a wall is a window; outdoors one at most is a sun; all others are wide glows. Glare that is not round keeps its
shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.detail.kinds import INDOORS, OPEN_AIR
from anyprobe.light.environment import MAP_HEIGHT, reduced
from anyprobe.light.filtering import blur_cap, blur_cosine_power
from anyprobe.light.light_sources import LightSource, find_light_sources

SOFT = 20.0
"""Sharpness of the blur whose colours give way to the estimate's: about 10 degrees."""
RIM, WEAK_RIM, WEAK_RADIUS = 0.6, 1.6, 0.5
"""Width of a body's rim, in its radii; that of a weak source, and the radius in the middle of that rim, in its own."""
STRONG = 0.2
"""Smallest share of the map's power of a source drawn with an outline.

On left-out renders a tenth of the light comes from within 15 degrees of so strong a source in 33 to 59 % of photos,
of a weaker one in 2 to 13 %. For cut-outs it is 6 to 28 %: there the outline says little.
"""
GLOW, GLOW_PEAK, GLOW_RADII, GLOW_DEG = 0.25, 1.2, 1.5, 6.0
"""Largest share of a source's power in its glow, largest radiance of that, and the angle at which it is down to a
quarter: in radii of the body, and at least [degrees]."""
WIDE_DEG = 16.0
"""Angle [degrees] at which the glow of a source without a body is down to a quarter."""
FLATTENED, ON_GROUND, HORIZON_DEG = 2.0, 0.2, 5.0
"""Width of such a glow in the sky over its height, its share below the horizon, and that edge's width [degrees]."""
LEAST_BODY, MOST_BODIES = 0.08, {INDOORS: 2, OPEN_AIR: 1}
"""Smallest share of the map's power of a source with a body in a place, and how many have one."""
HAZY_DEG = 2.5
"""Radius [degrees] from which on a sun is in haze."""
LEAST_WINDOW_DEG = 5.0
"""Radius [degrees] of a disc as large as the smallest window."""
LOWEST_DEG, LOWEST_SECOND_DEG = {INDOORS: -30.0, OPEN_AIR: 2.0}, -12.0
"""Elevation [degrees] below which the strongest source has no body, and the second."""
WINDOW_DEG = 30.0
"""Elevation [degrees] below which a source in a room is a window."""
TALL, BAR, SOFT_EDGE = 1.3, 0.05, 0.06
"""Height of a window in its widths; half the width of its bars, and the width of its edges, in its half widths."""
AROUND_DEG, CORE_DEG = 26.0, 15.0
"""Angle [degrees] from a source within which light is attributed to it, and within which all of it is."""
SURFACE = 0.9
"""Luminance above which light is glare."""
GLARE, GLARE_DEG = 0.18, 14.0
"""Share of the map's light within an angle [degrees] at which half of the glare is drawn."""
LEAST_RADIUS_DEG = 0.27
"""Smallest radius [degrees] of a disc: the sun's."""
LEAST_FREE = 0.05
"""Smallest share of a source outside what is seen, or clipped there, that is drawn, with the whole power."""
REACH = 5.0
"""Reach of a glow, in its angle."""


def take_sources(estimate: np.ndarray) -> tuple[list[LightSource], np.ndarray]:
    """Split a map [H, 2H, 3] into its sources, each with the light removed for it, and the rest.

    Near a source the rest is filled smoothly from around.
    """
    rest = reduced(np.asarray(estimate, np.float32), MAP_HEIGHT)
    found = find_light_sources(rest)
    if not found:
        return [], rest
    d = pixel_directions(MAP_HEIGHT)
    areas = np.broadcast_to(pixel_solid_angles(MAP_HEIGHT), d.shape[:2])[..., None]
    cosines = np.stack([d @ source.direction for source in found])
    which, nearest = cosines.argmax(axis=0), np.degrees(np.arccos(np.clip(cosines.max(axis=0), -1.0, 1.0)))
    outside = (nearest > AROUND_DEG)[..., None].astype(np.float32)
    share = blur_cosine_power(outside, SOFT)
    around = blur_cosine_power(rest * outside, SOFT) / np.maximum(share, 1e-4)
    within = np.clip((AROUND_DEG - nearest) / (AROUND_DEG - CORE_DEG), 0.0, 1.0)[..., None] * (share > 1e-4)
    removed = within * np.maximum(rest - around, 0.0)
    lights = []
    for k, source in enumerate(found):
        own = removed * (which == k)[..., None] * areas
        source = replace(source, irradiance=(own * cosines[k][..., None]).sum(axis=(0, 1)))
        lights.append(_sharpened(source, estimate) if len(estimate) > MAP_HEIGHT else source)
    return lights, (rest - removed).astype(np.float32)


def _sharpened(source: LightSource, estimate: np.ndarray) -> LightSource:
    """Return a source with the direction and radius that a map [H, 2H, 3] of more rows than MAP_HEIGHT shows.

    The radius is that of a disc of the solid angle (sum L dw)^2 / sum L^2 dw, L above the median around the source; it
    becomes no larger.
    """
    rows = len(estimate)
    reach = np.radians(2.0 * source.radius_deg)
    top, bottom = _row_span(source.direction, reach, rows)
    near = pixel_directions(rows)[top:bottom] @ source.direction > np.cos(reach)
    d = pixel_directions(rows)[top:bottom][near]
    areas = np.broadcast_to(pixel_solid_angles(rows)[top:bottom], near.shape)[near]
    light = luminance(estimate[top:bottom])[near]
    above = np.maximum(light - np.median(light), 0.0).astype(np.float64)
    power = float((above * areas).sum())
    if power <= 0.0:
        return source
    mean = (above * areas) @ d
    radius_deg = float(np.degrees(np.sqrt(power**2 / float((above**2 * areas).sum()) / np.pi)))
    direction = (mean / np.linalg.norm(mean)).astype(source.direction.dtype)
    return replace(source, direction=direction, radius_deg=min(radius_deg, source.radius_deg))


def take_glare(rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split a map [H, 2H, 3] into what walls and skies may be, and the glare of windows and lamps that are not round.

    Spots with less than about a share GLARE of the map's light are in neither: they are seldom there.
    """
    bright = luminance(rest)
    glare = rest * (np.maximum(bright - SURFACE, 0.0) / np.maximum(bright, 1e-6))[..., None]
    cap = np.radians(GLARE_DEG)
    power = blur_cap(luminance(glare)[..., None], cap) * (2 * np.pi * (1 - np.cos(cap)))
    share = power / max(float((bright * pixel_solid_angles(len(rest))).sum()), 1e-6)
    drawn = share**4 / (share**4 + GLARE**4)
    return (rest - glare).astype(np.float32), (glare * drawn).astype(np.float32)


def draw_lights(
    sources: Sequence[LightSource], cover: np.ndarray, picture: np.ndarray, kind: str | None = None
) -> np.ndarray:
    """Draw light sources [R, 2R, 3], each with its whole irradiance.

    Args:
        cover: [R, 2R, 1] share of the picture [R, 2R, 3] that is seen, where only clipped pixels are sources.
        kind: of place, see bodies_of.
    """
    rows = len(picture)
    drawn = np.zeros((rows, 2 * rows, 3), np.float32)
    for source, body_kind in zip(sources, bodies_of(sources, kind), strict=True):
        radius = np.radians(max(source.radius_deg, LEAST_RADIUS_DEG))
        rim = RIM
        if kind is None and source.share < STRONG:
            radius, rim = WEAK_RADIUS * radius, WEAK_RIM
        glow = np.radians(WIDE_DEG) if body_kind is Body.none else max(GLOW_RADII * radius, np.radians(GLOW_DEG))
        top, bottom = _row_span(source.direction, REACH * glow, rows)
        d = pixel_directions(rows)[top:bottom]
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(d - source.direction, axis=-1) / 2, 0.0, 1.0))
        facing = np.maximum(np.cos(angle), 0.0) * pixel_solid_angles(rows)[top:bottom]
        far = angle / glow
        if body_kind is Body.none and kind == OPEN_AIR:
            rise = np.arcsin(np.clip(d[..., 1], -1.0, 1.0)) - np.arcsin(np.clip(source.direction[1], -1.0, 1.0))
            along = np.maximum(angle**2 - rise**2, 0.0) / FLATTENED
            far = np.sqrt(along + rise**2 * FLATTENED) / glow
        around = np.maximum((1 + far**2) ** -2.0 - (1 + REACH**2) ** -2.0, 0.0)
        if kind == OPEN_AIR:
            above = np.clip(d[..., 1] / np.radians(HORIZON_DEG) + 0.5, 0.0, 1.0)
            around = around * (ON_GROUND + (1 - ON_GROUND) * above)
        around /= (around * facing).sum()
        shape = around
        if body_kind is not Body.none:
            if body_kind is Body.window:
                body = _window(d, source.direction, max(radius, np.radians(LEAST_WINDOW_DEG)), np.pi / rows)
            elif body_kind is Body.haze:
                body = (1 + (angle / radius) ** 2) ** -3.0
            else:
                body = np.clip((radius - angle) / max(np.pi / rows, rim * radius) + 0.5, 0.0, 1.0)
            if not body.any():
                body[np.unravel_index(np.argmin(angle), angle.shape)] = 1.0
            if body_kind is not Body.haze:
                body = body * body * (3 - 2 * body)
            body /= (body * facing).sum()
            bright = float(luminance(source.irradiance)) * float(around.max())
            shape = body + min(GLOW, GLOW_PEAK / max(bright, 1e-6)) * (around - body)
        free = np.where(luminance(picture[top:bottom]) > 0.8, 1.0, 1.0 - cover[top:bottom, :, 0])
        kept = float((shape * free * facing).sum())
        if kept > LEAST_FREE:
            drawn[top:bottom] += (shape * free / kept)[..., None] * source.irradiance
    return drawn


class Body(Enum):
    """Body of a source: a disc, a window in a wall, a sun in haze, or none, which leaves a wide glow."""

    disc = "disc"
    window = "window"
    haze = "haze"
    none = "none"


def bodies_of(sources: Sequence[LightSource], kind: str | None) -> list[Body]:
    """Choose the bodies of sources in a place of a kind (detail.kinds); discs where that is None.

    Outdoors the strongest has one, as the sun; in a room the strongest two, on the walls as windows, above them as
    lamps.
    """
    if kind is None:
        return [Body.disc] * len(sources)
    order = sorted(range(len(sources)), key=lambda k: -sources[k].share)
    bodies = [Body.none] * len(sources)
    for k in order[: MOST_BODIES[kind]]:
        one = sources[k]
        elevation = float(np.degrees(np.arcsin(np.clip(one.direction[1], -1.0, 1.0))))
        if one.share < LEAST_BODY or elevation < (LOWEST_DEG[kind] if k == order[0] else LOWEST_SECOND_DEG):
            continue
        if kind == OPEN_AIR:
            bodies[k] = Body.disc if one.radius_deg < HAZY_DEG else Body.haze
        else:
            bodies[k] = Body.window if elevation < WINDOW_DEG else Body.disc
    return bodies


def _window(d: np.ndarray, toward: np.ndarray, radius: float, pixel: float) -> np.ndarray:
    """Return the share of each direction d [R, C, 3] that shows a window in a wall that faces the middle.

    It has the solid angle of a disc of this radius, four panes, and edges a pixel [radians] wide.
    """
    level = np.array([toward[0], 0.0, toward[2]]) / np.hypot(toward[0], toward[2])
    side = np.array([-level[2], 0.0, level[0]])
    depth = d @ level
    ahead = np.maximum(depth, 1e-3)
    height = float(toward[1] / np.hypot(toward[0], toward[2]))
    far = np.sqrt(1.0 + height**2)  # of the window's middle from the camera, in the wall's distance
    half = np.sqrt(np.pi * radius**2 * far**3 / (4 * TALL)) * np.array([1.0, TALL])
    across, up = np.abs(d @ side / ahead), np.abs(d[..., 1] / ahead - height)
    edge = max(1.5 * pixel, SOFT_EDGE * half[0])
    outer = np.minimum(half[0] - across, half[1] - up) / edge + 0.5
    bar = (np.minimum(across, np.abs(up)) - BAR * half[0]) / edge + 0.5
    return np.clip(np.minimum(outer, bar), 0.0, 1.0) * (depth > 0)


def _row_span(direction: np.ndarray, reach: float, rows: int) -> tuple[int, int]:
    """Return the first row, and the one after the last, within an angle of a direction."""
    polar = np.arccos(np.clip(direction[1], -1.0, 1.0))
    top, bottom = (polar - reach) / np.pi * rows, (polar + reach) / np.pi * rows
    return max(int(np.floor(top)) - 1, 0), min(int(np.ceil(bottom)) + 1, rows)

"""Panorama of the place: the photo, its continuation, and the estimate's light.

    L = seen, else g exp(w ln C + (1 - w) ln E), + discs

C is the photo continued all around (detail.continued), with its full texture. Its colour is kept
by the share w, which falls with the angle to what is seen; the rest gives way to the estimate E without its sources.
The gain g is smooth: it brings the nine spherical harmonics to the estimate's with the least change (Kullback-Leibler).
Sources are discs of their own size, weak ones soft spots.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.detail.continued import CONTINUED_FLOOR, continue_around
from anyprobe.errors import InputError, OutputError
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import project, sh_basis
from anyprobe.light.light_sources import LightSource, find_light_sources
from anyprobe.maps.radiance import HALF_MAX, write_exr, write_hdr
from anyprobe.match.plate import DrawnPlate, Plate, seen_in
from anyprobe.pictures.images import write_png

PANORAMA_SIZES = (64, 128, 256, 512, 1024, 2048)
DRAWN_ROWS = 512
"""Rows of a panorama."""
EDGE_DEG = 3.0
"""Width [degrees] over which the photo gives way to its continuation, inside its border."""
FAR_DEG, HUE_DEG = 45.0, 60.0
"""Angles [degrees] from what is seen at which the continued brightness and hue count 1 / e."""
BESIDE_DEG = 12.0
"""Angle [degrees] from what is seen at which plausible detail replaces the continuation."""
ABOVE_GROUND_DEG = 8.0
"""The same angle above a photo that shows only ground."""
SOFT = 20.0
"""Sharpness of the blur whose colours give way to the estimate's: about 10 degrees."""
SPOT = 0.4
"""Angle, in radii of a weak source, over which its brightness falls by a factor e."""
SOFT_RIM = 0.35
"""Width of a disc's rim, in its radii."""
DISC_SHARE = 0.2
"""Smallest share of the map's power of a source drawn with the outline of a disc.

On left-out renders a tenth of the light comes from within 15 degrees of so strong a source in 33 to 59 % of photos,
of a weaker one in 2 to 13 %: weaker ones become soft spots, twice as wide below the horizon of a level picture. For
cut-outs it is 6 to 28 %: there the outline says little.
"""
AROUND_DEG, CORE_DEG = 22.0, 10.0
"""Angle [degrees] from a source within which light is attributed to it, and within which all of it is."""
LEAST_RADIUS_DEG = 0.27
"""Smallest radius [degrees] of a disc: the sun's."""
MOST_GAIN = np.log(6.0)
"""Bound of the gain's logarithm."""
NEWTON_STEPS = 12
NEAR_GAIN_DEG = 20.0
"""Angle [degrees] from what is seen over which the gain sets in, so that no edge appears there."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Panorama:
    """A panorama of the place with the origin of each pixel.

    Attributes:
        radiance: [R, 2R, 3] linear, in the light's units.
        origin: [R, 2R, 3] shares seen in the photo, estimated, and invented; they sum to 1.
        frame_from_camera: [3, 3] rotation from the camera's frame to the panorama's.
        is_level: whether +Y is up in the place; else the frame is the light's.
        attributes: entries of a file's header.
    """

    radiance: np.ndarray
    origin: np.ndarray
    frame_from_camera: np.ndarray
    is_level: bool
    attributes: dict[str, str] = field(default_factory=dict)

    def save(self, path: str | Path, *, colorspace: str = "rec709") -> Path:
        """Write .exr (half floats, or floats where halves would clip), .hdr, or a tone-mapped .png.

        Raises:
            OutputError: another suffix, or a file that cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower()
        if kind == ".exr":
            half = bool(self.radiance.max() < HALF_MAX)
            write_exr(path, self.radiance, half=half, attributes=self.attributes, colorspace=colorspace)
        elif kind == ".hdr":
            write_hdr(path, self.radiance, attributes=self.attributes)
        elif kind == ".png":
            write_png(path, response(self.radiance))
        else:
            raise OutputError(f"expected .exr, .hdr or .png, got {kind or 'no suffix'}", source=path)
        return path

    def save_origin(self, path: str | Path) -> Path:
        """Write the origin of each pixel as a picture: red is seen, green estimated, blue invented."""
        write_png(Path(path), self.origin)
        return Path(path)


def check_panorama_rows(size: int) -> None:
    """Raise InputError if a panorama cannot have so many rows."""
    if size not in PANORAMA_SIZES:
        raise InputError(
            f"expected one of {', '.join(map(str, PANORAMA_SIZES))} rows, got {size}; choose another", subject="size"
        )


def compose(
    estimate: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int, *, is_detailed: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Compose a panorama [rows, 2 rows, 3] and its origin [rows, 2 rows, 3], see Panorama.

    Args:
        estimate: [H, 2H, 3] in the panorama's frame.
        plate: the photo without its object; None where it shows nothing but the object.
        frame_from_camera: [3, 3].
        is_detailed: whether the estimate has plausible detail, which then surrounds what is seen, sources included.
    """
    sources, rest = ((), estimate) if is_detailed else _without_sources(estimate)
    smooth = _enlarged(rest, rows)
    seen = None if plate is None else seen_in(plate, frame_from_camera, rows)
    picture, cover, origin = _place(smooth, rest, seen, is_detailed)
    drawn = _discs(sources, rows, cover, picture)
    fixed = picture * cover + drawn
    free = picture * (1 - cover)
    angle = _angles_from(cover[..., 0])
    strength = 1.0 - np.exp(-((angle / NEAR_GAIN_DEG) ** 2)) if cover.any() else np.ones_like(angle)
    radiance = fixed + _moments_matched(free, fixed, project(estimate), strength[..., None].astype(np.float32))
    return radiance.astype(np.float32), origin


def _without_sources(estimate: np.ndarray) -> tuple[list[LightSource], np.ndarray]:
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


def _place(
    smooth: np.ndarray, rest: np.ndarray, seen: DrawnPlate | None, is_detailed: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the picture without sources, the share of it that is the photo's [R, 2R, 1], and the origin of each
    pixel."""
    rows = len(smooth)
    nothing = np.zeros((rows, 2 * rows, 1), np.float32)
    estimated = np.concatenate([nothing, nothing + 1 - is_detailed, nothing + is_detailed], axis=-1)
    if seen is None or not (seen.margin > 0).any():
        return smooth, nothing, estimated
    within = np.clip(seen.margin / EDGE_DEG, 0.0, 1.0)[..., None].astype(np.float32)
    within = within * within * (3 - 2 * within)
    around = continue_around(seen)
    if around is None:
        return (
            smooth + within * (seen.radiance - smooth),
            within,
            np.concatenate([within, 1 - within, nothing], axis=-1),
        )
    ln = around.ln
    soft = _enlarged(blur_cosine_power(reduced(ln, MAP_HEIGHT), SOFT), rows)
    goal = _enlarged(blur_cosine_power(np.log(reduced(rest, MAP_HEIGHT) + CONTINUED_FLOOR), SOFT), rows)
    angle = _angles_from(within[..., 0])
    share, hue = (np.exp(-((angle / far) ** 2)) for far in (FAR_DEG, HUE_DEG))
    if around.top < 0:
        up = np.degrees(np.arcsin(pixel_directions(rows)[..., 1])) - around.top
        share, hue = (weight * np.exp(-np.maximum(up, 0.0) / ABOVE_GROUND_DEG) for weight in (share, hue))
    share, hue = (weight[..., None].astype(np.float32) for weight in (share, hue))
    lack = goal - soft
    level = lack.mean(axis=-1, keepdims=True)
    continued = np.maximum(np.exp(ln + (1 - share) * level + (1 - hue) * (lack - level)) - CONTINUED_FLOOR, 0.0)
    if is_detailed:
        beside = np.exp(-((angle / BESIDE_DEG) ** 2))[..., None].astype(np.float32)
        continued = smooth + beside * (continued - smooth)
        share = np.ones_like(share)
    picture = continued + within * (seen.radiance - continued)
    clear = within * (1 - np.clip(seen.filled[..., None], 0.0, 1.0))
    invented = (1 - clear) * np.maximum(share, within)
    return picture, within, np.concatenate([clear, 1 - clear - invented, invented], axis=-1)


def _enlarged(values: np.ndarray, rows: int) -> np.ndarray:
    """Resize a map [h, 2h, C] to `rows` rows, more (smoothly) or fewer."""
    from anyprobe.detail.blend import enlarged_planes

    if len(values) >= rows:
        return reduced(values, rows)
    return np.ascontiguousarray(np.moveaxis(enlarged_planes(np.moveaxis(values, -1, 0), rows), 0, -1)).astype(
        np.float32
    )


def _angles_from(cover: np.ndarray) -> np.ndarray:
    """Return the angle [degrees, R, 2R] to the nearest covered direction; 180 where none is."""
    rows = len(cover)
    small = reduced(cover[..., None].astype(np.float32), 32)[..., 0] > 0.5
    if not small.any():
        return np.full(cover.shape, 180.0 if not cover.any() else 30.0, np.float32)
    d = pixel_directions(32).reshape(-1, 3)
    cosine = (d @ d[small.ravel()].T).max(axis=1)
    angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))).reshape(32, 64, 1)
    smooth = bilinear(angle.astype(np.float32), direction_to_uv(pixel_directions(rows)).astype(np.float32))[..., 0]
    return np.where(cover > 0.99, 0.0, smooth)


def _discs(sources: Sequence[LightSource], rows: int, cover: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """Draw light sources [rows, 2 rows, 3], each with its whole irradiance: discs of their own size, weak ones soft
    spots."""
    drawn = np.zeros((rows, 2 * rows, 3), np.float32)
    directions = pixel_directions(rows)
    areas = pixel_solid_angles(rows)
    for source in sources:
        radius = np.radians(max(source.radius_deg, LEAST_RADIUS_DEG))
        pixel = np.pi / rows
        is_disc = source.share >= DISC_SHARE
        if not is_disc:
            radius *= SPOT if source.direction[1] > 0 else 2 * SPOT
        reach = radius + pixel if is_disc else 3 * radius + pixel
        top, bottom = _row_span(source.direction, reach, rows)
        d = directions[top:bottom]
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(d - source.direction, axis=-1) / 2, 0.0, 1.0))
        edge = max(pixel, SOFT_RIM * radius)
        share = np.clip((radius - angle) / edge + 0.5, 0.0, 1.0) if is_disc else np.exp(-((angle / radius) ** 2))
        if not share.any():
            share[np.unravel_index(np.argmin(angle), angle.shape)] = 1.0
        shown = cover[top:bottom, :, 0]
        clipped = luminance(picture[top:bottom]) > 0.8
        kept = share * np.where(clipped, 1.0, 1.0 - shown)
        weights = kept * np.maximum(np.cos(angle), 0.0) * areas[top:bottom]
        if weights.sum() > 0.3 * (share * np.maximum(np.cos(angle), 0.0) * areas[top:bottom]).sum():
            drawn[top:bottom] += kept[..., None] * (source.irradiance / weights.sum())
    return drawn


def _row_span(direction: np.ndarray, reach: float, rows: int) -> tuple[int, int]:
    """Return the first row, and the one after the last, within an angle of a direction."""
    polar = np.arccos(np.clip(direction[1], -1.0, 1.0))
    top, bottom = (polar - reach) / np.pi * rows, (polar + reach) / np.pi * rows
    return max(int(np.floor(top)) - 1, 0), min(int(np.ceil(bottom)) + 1, rows)


def _moments_matched(free: np.ndarray, fixed: np.ndarray, goal: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Multiply `free` [R, 2R, 3] by a smooth gain so that, with `fixed`, it has the harmonics [9, 3] of goal.

    The gain exp(s(d) sum of c_i Y_i(d)), with s the strength, is the nearest to 1 of all gains that reach the goal,
    found by Newton's method on sum of free exp(s Y c) / s - c . lack, which is convex.
    """
    lack = (goal - project(fixed)).astype(np.float64)
    small = reduced(free, MAP_HEIGHT).astype(np.float64)
    force = reduced(strength, MAP_HEIGHT)[..., 0].reshape(-1).astype(np.float64)
    y, areas = _basis()
    coefficients = np.zeros((9, 3))
    for k in range(3):
        light = small[..., k].reshape(-1) * areas
        coefficients[:, k] = _newton(light, y, force, lack[:, k])
    gain = np.exp(np.clip(force[:, None] * (y @ coefficients), -MOST_GAIN, MOST_GAIN))
    result = free * _enlarged(gain.reshape(MAP_HEIGHT, 2 * MAP_HEIGHT, 3).astype(np.float32), len(free))
    # the coarse grid's residual
    left = lack - project(result)
    factor = np.empty((len(y), 3))
    small = reduced(result.astype(np.float32), MAP_HEIGHT).astype(np.float64)
    for k in range(3):
        light = small[..., k].reshape(-1) * areas
        gram = (y * (force * light)[:, None]).T @ y
        step = np.linalg.solve(gram + (1e-6 * np.trace(gram) + 1e-9) * np.eye(9), left[:, k])
        factor[:, k] = 1.0 + np.clip(force * (y @ step), -0.5, 0.5)
    return result * _enlarged(factor.reshape(MAP_HEIGHT, 2 * MAP_HEIGHT, 3).astype(np.float32), len(free))


@lru_cache(maxsize=1)
def _basis() -> tuple[np.ndarray, np.ndarray]:
    """Return harmonics [8192, 9] and solid angles [8192] of a map's pixels."""
    y = sh_basis(pixel_directions(MAP_HEIGHT)).reshape(-1, 9).astype(np.float64)
    return y, np.repeat(pixel_solid_angles(MAP_HEIGHT), 2 * MAP_HEIGHT, axis=1).reshape(-1).astype(np.float64)


def _newton(light: np.ndarray, y: np.ndarray, force: np.ndarray, lack: np.ndarray) -> np.ndarray:
    """Solve for the coefficients [9] of one channel."""
    c = np.zeros(9)
    for _ in range(NEWTON_STEPS):
        gained = light * np.exp(np.clip(force * (y @ c), -MOST_GAIN, MOST_GAIN))
        rest = lack - gained @ y
        gram = (y * (force * gained)[:, None]).T @ y
        step = np.linalg.solve(gram + (1e-5 * np.trace(gram) + 1e-9) * np.eye(9), rest)
        largest = np.abs(y @ step).max()
        c = c + step * min(1.0, 0.7 / max(largest, 1e-9))
        if np.abs(rest).max() < 1e-4 * max(np.abs(lack).max(), 1e-6):
            break
    return c


def in_frame(radiance: np.ndarray, frame_from_camera: np.ndarray) -> np.ndarray:
    """Rotate a map [H, 2H, 3] into a panorama's frame."""
    if np.allclose(frame_from_camera, np.eye(3)):
        return radiance
    return np.maximum(rotate(radiance, frame_from_camera), 0.0)

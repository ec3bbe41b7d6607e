"""Panorama of the place: the photo where it is seen, and the estimate everywhere else.

    L = s P + (1 - s) g (E exp(v) - FLOOR), + sources

P is the photo without its object and s its share, which fades out towards its border and its object, so that nothing
seems cut off. E is the estimate without its sources and without what it shows of the photo, v = ln P - ln E where the
photo is seen, blurred. Around it v goes on by a screened Poisson equation (place.screened) and fades out: far away the
panorama is the estimate. What is not known is smooth. The gain g is smooth, too: with the least change it gives the
luminance the estimate's nine harmonics; a coloured object colours the light, not what the photo shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.errors import InputError, OutputError
from anyprobe.light.environment import MAP_HEIGHT, enlarged_map, integral, reduced, rotate
from anyprobe.light.filtering import blur_cap, blur_cosine_power
from anyprobe.light.harmonics import project, sh_basis
from anyprobe.light.light_sources import LightSource, split_sources
from anyprobe.maps.radiance import write_exr, write_hdr
from anyprobe.pictures.images import write_png
from anyprobe.place.plate import Plate
from anyprobe.place.screened import screened

PANORAMA_SIZES = (64, 128, 256, 512, 1024, 2048)
DRAWN_ROWS = 512
"""Rows of a panorama."""
KNEE, SHOULDER = 0.5, 0.099
"""Radiance above which a picture compresses highlights, and by which factor of a logarithm: 16 is shown as 1."""
SOLVED_ROWS = 128
"""Rows at which the equation is solved: finer structure of a border dies away within one of them."""
BRIGHTNESS_DEG, HUE_DEG = (60.0, 20.0), (120.0, 60.0)
"""Angles [degrees] along azimuth and elevation over which the photo's brightness and hue beside it fade out.

Places change less along the horizon than from ground to sky; and the hue of a light that a coloured object tells of is
less certain than that of its surroundings in the photo.
"""
BESIDE_DEG = 6.0
"""Angle [degrees] around the photo in which the estimate is blurred with what it shows of the photo."""
SMOOTH = 20.0
"""Sharpness (light.filtering) of the estimate's blur, about 10 degrees: finer structure of its light is not known."""
GOING_ON, SOFT = 240.0, 60.0
"""Sharpness (light.filtering) of the blur, about 3 degrees, that the photo passes into at its border, and of the one,
about 6 degrees, that says how near the border is."""
SHARP = (0.88, 0.95)
"""Blurred cover from which on the photo begins to be seen sharp, and is; at a straight border it is a half."""
HELD, LEAST_WEIGHT = 1e3, 1e-6
"""Weight of what is seen, where 1 is the screening's; and of what is not."""
LEAST_SEEN = 1e-3
"""Smallest cover that colours are divided by."""
FLOOR = 0.01
"""Radiance added before its logarithm."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Panorama:
    """A panorama of the place with the origin of each pixel.

    Attributes:
        radiance: [R, 2R, 3] linear, in the light's units.
        origin: [R, 2R, 3] shares seen in the photo, estimated, and continued from the photo; they sum to 1.
        frame_from_camera: [3, 3] rotation from the camera's frame to the panorama's.
        is_level: whether +Y is up in the place; else the frame is the light's.
        attributes: entries of a file's header.
    """

    radiance: np.ndarray
    origin: np.ndarray
    frame_from_camera: np.ndarray
    is_level: bool
    attributes: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        frame = "level" if self.is_level else "in the light's frame"
        seen, estimated, continued = (self.origin * pixel_solid_angles(len(self.origin))[..., None]).sum((0, 1)) / (
            4 * np.pi
        )
        parts = [
            "Panorama {} x {}".format(*self.radiance.shape),
            frame,
            f"{seen:.0%} seen, {estimated:.0%} estimated, {continued:.0%} continued",
        ]
        return f"<{', '.join(parts)}>"

    def display(self) -> np.ndarray:
        """Return display values [R, 2R, 3] in [0, 1]: as the photo's, highlights compressed instead of clipped."""
        bright = self.radiance.max(axis=-1, keepdims=True)
        over = np.maximum(bright - KNEE, 0.0)
        shown = np.minimum(bright, KNEE) + SHOULDER * np.log1p(over / SHOULDER)
        return response(self.radiance * (shown / np.maximum(bright, 1e-9)))

    def save(self, path: str | Path, *, colorspace: str = "rec709") -> Path:
        """Write .exr (half floats, or floats where halves would clip), .hdr, or a tone-mapped .png.

        Raises:
            OutputError: another suffix, or a file that cannot be written.
        """
        path = Path(path)
        kind = path.suffix.lower()
        if kind == ".exr":
            write_exr(path, self.radiance, half=None, attributes=self.attributes, colorspace=colorspace)
        elif kind == ".hdr":
            write_hdr(path, self.radiance, attributes=self.attributes)
        elif kind == ".png":
            write_png(path, self.display())
        else:
            raise OutputError(f"expected .exr, .hdr or .png, got {kind or 'no suffix'}", source=path)
        return path

    def save_origin(self, path: str | Path) -> Path:
        """Write the origin of each pixel as a picture: red is seen, green estimated, blue continued."""
        write_png(Path(path), self.origin)
        return Path(path)


def check_rows(rows: int) -> None:
    """Raise InputError if a panorama cannot have so many rows."""
    if rows not in PANORAMA_SIZES:
        text = f"expected one of {', '.join(map(str, PANORAMA_SIZES))} rows, got {rows}; choose another"
        raise InputError(text, subject="size")


def compose(
    estimate: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray]:
    """Compose a panorama [rows, 2 rows, 3] and its origin [rows, 2 rows, 3], see Panorama.

    Args:
        estimate: [H, 2H, 3] in the panorama's frame.
        plate: the photo without its object; None where it shows nothing but the object.
        frame_from_camera: [3, 3].
    """
    if plate is None and len(estimate) > MAP_HEIGHT:  # a map from elsewhere, which is sharp
        nothing = np.zeros((rows, 2 * rows, 1), np.float32)
        return enlarged_map(estimate, rows), np.concatenate([nothing, nothing + 1, nothing], axis=-1)
    sources, rest = split_sources(reduced(estimate, MAP_HEIGHT))
    picture, seen, continued = _place(rest, plate, frame_from_camera, rows)
    fixed = picture * seen + discs_of(sources, float(luminance(integral(estimate))), seen, picture)
    radiance = with_moments(picture * (1 - seen), fixed, project(estimate), 1 - continued)
    origin = np.concatenate([seen, (1 - seen) * (1 - continued), (1 - seen) * continued], axis=-1)
    return np.maximum(radiance, 0.0).astype(np.float32), origin.astype(np.float32)


def _place(
    rest: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the picture without sources [R, 2R, 3], the share of it that is the photo's, and the share of what goes on
    from the photo, each [R, 2R, 1]."""
    nothing = np.zeros((rows, 2 * rows, 1), np.float32)
    if plate is None:
        return enlarged_map(np.maximum(blur_cosine_power(rest, SMOOTH), 0.0), rows), nothing, nothing
    drawn, cover, inside = plate.drawn(frame_from_camera, max(rows, SOLVED_ROWS))
    seen, within = reduced(cover, SOLVED_ROWS), reduced(inside, SOLVED_ROWS)
    photo = reduced(drawn, SOLVED_ROWS) / np.maximum(seen, LEAST_SEEN)
    apart = 1 - np.clip(4 * blur_cap(reduced(inside, MAP_HEIGHT), np.radians(BESIDE_DEG)), 0.0, 1.0)
    known = np.maximum(blur_cosine_power(np.dstack([rest * apart, apart]), SMOOTH), 0.0)
    ln = np.log(known[..., :3] / np.maximum(known[..., 3:], LEAST_WEIGHT) + FLOOR)
    ln = enlarged_map(screened(ln, HELD * known[..., 3] ** 2 + LEAST_WEIGHT, np.ones((2, 3))), SOLVED_ROWS)
    lack = np.log(photo + FLOOR) - ln
    level = lack.mean(axis=-1, keepdims=True)
    values = np.concatenate([level, np.ones_like(level), (lack - level)[..., :2]], axis=-1)
    weight = HELD * seen + (1 - within) + LEAST_WEIGHT
    reach = np.radians(np.array([BRIGHTNESS_DEG, BRIGHTNESS_DEG, HUE_DEG, HUE_DEG]).T)
    found = _soft(screened(values * (HELD * seen / weight), weight[..., 0], reach), GOING_ON)
    level, continued, hue = found[..., :1], found[..., 1:2], found[..., 2:]
    ln = ln + level + np.concatenate([hue, -hue.sum(axis=-1, keepdims=True)], axis=-1)
    smooth = enlarged_map(np.concatenate([ln, continued, _soft(seen, SOFT)], axis=-1), rows)
    share = np.clip((smooth[..., 4:] - SHARP[0]) / (SHARP[1] - SHARP[0]), 0.0, 1.0)
    drawn, cover = reduced(drawn, rows), reduced(cover, rows)
    share = np.minimum(share * share * (3 - 2 * share), cover)
    around = np.maximum(np.exp(smooth[..., :3]) - FLOOR, 0.0)
    picture = around + share * (drawn / np.maximum(cover, LEAST_SEEN) - around)
    return picture, share, np.clip(smooth[..., 3:4], 0.0, 1.0)


def _soft(values: np.ndarray, sharpness: float) -> np.ndarray:
    """Blur a map [SOLVED_ROWS, 2 SOLVED_ROWS, C]."""
    return enlarged_map(blur_cosine_power(reduced(values, MAP_HEIGHT), sharpness), SOLVED_ROWS)


def in_frame(radiance: np.ndarray, frame_from_camera: np.ndarray) -> np.ndarray:
    """Rotate a map [H, 2H, 3] into a panorama's frame."""
    if np.allclose(frame_from_camera, np.eye(3)):
        return radiance
    return np.maximum(rotate(radiance, frame_from_camera), 0.0)


MOST_GAIN = np.log(6.0)
"""Bound of the gain's logarithm."""
NEWTON_STEPS = 12


def with_moments(free: np.ndarray, fixed: np.ndarray, goal: np.ndarray, strength: np.ndarray) -> np.ndarray:
    """Return the light [R, 2R, 3] of `free`, changed, and of `fixed`, with goal's harmonics [9, 3], to a thousandth.

    The gain exp(s(d) sum of c_i Y_i(d)) of free, with s the strength [R, 2R, 1], is the nearest to 1 of all gains that
    reach the goal.
    """
    small, held, force = (reduced(one, MAP_HEIGHT).astype(np.float64) for one in (free, fixed, strength))
    y, areas = _basis()
    wanted = luminance(goal.astype(np.float64))
    light = luminance(small).reshape(-1) * areas
    force = force.reshape(-1)
    c = _newton(light, y, force, wanted - luminance(project(held.astype(np.float32)).astype(np.float64)))
    gain = np.exp(np.clip(force * (y @ c), -MOST_GAIN, MOST_GAIN))
    return fixed + free * enlarged_map(gain.astype(np.float32).reshape(*small.shape[:2], 1), len(free))


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
    return c


STRONG = 0.2
"""Smallest share of the map's power of a source that is drawn with a disc; a weaker one leaves a wide glow.

On left-out renders a tenth of the light comes from within 15 degrees of so strong a source in 33 to 59 % of photos,
of a weaker one in 2 to 13 %.
"""
WIDE_DEG = 16.0
"""Angle [degrees] at which the glow that a weak source leaves is down to a quarter."""
RIM = 0.6
"""Width of a disc's rim, in its radii."""
GLOW, GLOW_RADII, GLOW_DEG = 0.25, 1.5, 6.0
"""Share of a source's power in its glow, and the angle at which that is down to a quarter: in radii of the disc, and at
least [degrees]."""
REACH = 5.0
"""Reach of a glow, in its angle."""
LEAST_RADIUS_DEG = 0.27
"""Smallest radius [degrees] of a disc: the sun's."""
AS_SOURCE = 0.8
"""Luminance from which on a seen pixel may be the source itself."""
LEAST_FREE = 0.05
"""Smallest share of a source outside what is seen, or clipped there, that is drawn, with the whole power."""


def discs_of(sources: Sequence[LightSource], total: float, cover: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """Return discs and glows of light sources [R, 2R, 3].

    Args:
        total: luminance of the power of all light.
        cover: [R, 2R, 1] share of the picture [R, 2R, 3] that is seen, where only clipped pixels are sources.
    """
    rows = len(picture)
    drawn = np.zeros((rows, 2 * rows, 3), np.float32)
    for source in sources:
        radius = np.radians(max(source.radius_deg, LEAST_RADIUS_DEG))
        is_strong = luminance(source.power) >= STRONG * total
        glow = max(GLOW_RADII * radius, np.radians(GLOW_DEG)) if is_strong else np.radians(WIDE_DEG)
        top, bottom = _row_span(source.direction, REACH * glow, rows)
        d = pixel_directions(rows)[top:bottom]
        angle = 2 * np.arcsin(np.clip(np.linalg.norm(d - source.direction, axis=-1) / 2, 0.0, 1.0))
        facing = np.maximum(np.cos(angle), 0.0) * pixel_solid_angles(rows)[top:bottom]
        around = np.maximum((1 + (angle / glow) ** 2) ** -2.0 - (1 + REACH**2) ** -2.0, 0.0)
        shape = around / (around * facing).sum()
        if is_strong:
            body = np.clip((radius - angle) / max(np.pi / rows, RIM * radius) + 0.5, 0.0, 1.0)
            if not body.any():
                body[np.unravel_index(np.argmin(angle), angle.shape)] = 1.0
            body = body * body * (3 - 2 * body)
            shape = (1 - GLOW) * body / (body * facing).sum() + GLOW * shape
        free = np.where(luminance(picture[top:bottom]) > AS_SOURCE, 1.0, 1.0 - cover[top:bottom, :, 0])
        kept = float((shape * free * facing).sum())
        if kept > LEAST_FREE:
            drawn[top:bottom] += (shape * free / kept)[..., None] * source.irradiance
    return drawn


def _row_span(direction: np.ndarray, reach: float, rows: int) -> tuple[int, int]:
    """Return the first row, and the one after the last, within an angle of a direction."""
    polar = np.arccos(np.clip(direction[1], -1.0, 1.0))
    top, bottom = (polar - reach) / np.pi * rows, (polar + reach) / np.pi * rows
    return max(int(np.floor(top)) - 1, 0), min(int(np.ceil(bottom)) + 1, rows)

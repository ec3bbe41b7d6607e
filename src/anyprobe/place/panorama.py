"""Panorama of the place: the photo where it is seen, and the estimate everywhere else.

    L = s P + (1 - s) (exp(x) - FLOOR) + sources

P is the photo without its object and s its share, which fades out towards its border and its object, so that nothing
seems cut off. x is nearest to ln P where the photo is seen and to ln E beyond it, and smooth, along the horizon more
than across it: one screened Poisson equation (place.screened). E is the estimate without its strong sources, blurred.
Lights that the estimate only guesses thus leave no glow of their own. Smoothing takes light: two gains, of the strong
sources and of what is not seen, which is held to 1, bring irradiance near to the estimate's. A panorama to render with
is instead given the estimate's nine harmonics of luminance, by a smooth gain with the least change.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_directions, pixel_solid_angles, uv_to_direction
from anyprobe.core.response import response
from anyprobe.errors import InputError, OutputError
from anyprobe.light.environment import MAP_HEIGHT, enlarged_map, integral, reduced, rotate
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import COSINE_LOBE, project, sh_basis
from anyprobe.light.light_sources import LightSource, draw_sources, split_sources
from anyprobe.maps.radiance import write_exr, write_hdr
from anyprobe.pictures.images import write_png
from anyprobe.place.plate import Plate
from anyprobe.place.screened import screened

PANORAMA_SIZES = (64, 128, 256, 512, 1024, 2048)
DRAWN_ROWS = 512
"""Rows of a panorama."""
KNEE, SHOULDER = 0.5, 0.099
"""Radiance above which a picture compresses highlights, and by which factor of a logarithm: 16 is shown as 1."""
REACH_DEG = (90.0, 20.0)
"""Angles [degrees] of azimuth and elevation over which the picture is smooth where it is not seen.

Places change less along the horizon than from ground to sky. On rendered photos of 47 training maps 40 and 60 degrees
along it are as near to the truth, and less calm.
"""
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
STRONG = 0.2
"""Smallest share of the map's power of a source that is drawn; a weaker one is smoothed with the rest.

On left-out renders a tenth of the light comes from within 15 degrees of so strong a source in 33 to 59 % of photos,
of a weaker one in 2 to 13 %.
"""
AS_SOURCE = 0.8
"""Luminance from which on a seen pixel may be the source itself."""
LEAST_FREE = 0.05
"""Smallest share of a source outside what is seen, or clipped there, that is drawn, with the whole power."""
MOST_GAIN = 6.0
"""Bound of the factors that give back the light which smoothing takes."""


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
        weights = pixel_solid_angles(len(self.origin))[..., None] / (4 * np.pi)
        seen, estimated, continued = (self.origin * weights).sum((0, 1))
        parts = [
            "Panorama {} x {}".format(*self.radiance.shape),
            frame,
            f"{seen:.0%} seen, {estimated:.0%} estimated, {continued:.0%} continued",
        ]
        return f"<{', '.join(parts)}>"

    def display(self) -> np.ndarray:
        """Return display values [R, 2R, 3] in [0, 1]: as the photo's, highlights compressed instead of clipped."""
        bright = self.radiance.max(axis=-1, keepdims=True)
        shown = np.minimum(bright, KNEE) + SHOULDER * np.log1p(np.maximum(bright - KNEE, 0.0) / SHOULDER)
        return response(self.radiance * (shown / np.maximum(bright, 1e-9)))

    def save(self, path: str | Path, *, colorspace: str = "rec709") -> Path:
        """Write .exr (half floats, or floats where halves would clip), .hdr, or a tone-mapped .png.

        Raises:
            OutputError: another suffix, or a file that cannot be written.
        """
        return save_map(path, self.radiance, self.display, self.attributes, colorspace)

    def save_origin(self, path: str | Path) -> Path:
        """Write the origin of each pixel as a picture: red is seen, green estimated, blue continued."""
        write_png(Path(path), self.origin)
        return Path(path)


def save_map(
    path: str | Path,
    radiance: np.ndarray,
    display: Callable[[], np.ndarray],
    attributes: Mapping[str, str],
    colorspace: str,
) -> Path:
    """Write a map as .exr (half floats, or floats where halves would clip), .hdr, or its display values as .png.

    attributes: of the header. colorspace: of an .exr.

    Raises:
        OutputError: another suffix, or a file that cannot be written.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind == ".exr":
        write_exr(path, radiance, half=None, attributes=attributes, colorspace=colorspace)
    elif kind == ".hdr":
        write_hdr(path, radiance, attributes=attributes)
    elif kind == ".png":
        write_png(path, display())
    else:
        raise OutputError(f"expected .exr, .hdr, .png or a light's .json, got {kind or 'no suffix'}", source=path)
    return path


def check_rows(rows: int) -> None:
    """Raise InputError if a panorama cannot have so many rows."""
    if rows not in PANORAMA_SIZES:
        text = f"expected one of {', '.join(map(str, PANORAMA_SIZES))} rows, got {rows}; choose another"
        raise InputError(text, subject="size")


def compose(
    estimate: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int, *, lit: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Compose a panorama [rows, 2 rows, 3] and its origin [rows, 2 rows, 3], see Panorama.

    Args:
        estimate: [H, 2H, 3] in the panorama's frame.
        plate: the photo without its object; None where it shows nothing but the object.
        frame_from_camera: [3, 3].
        lit: whether luminance has all nine harmonics of the estimate, to render with.
    """
    if plate is None and len(estimate) > MAP_HEIGHT:  # a map from elsewhere, which is sharp
        nothing = np.zeros((rows, 2 * rows, 1), np.float32)
        return enlarged_map(estimate, rows), np.concatenate([nothing, nothing + 1, nothing], axis=-1)
    total = float(luminance(integral(estimate)))
    sources, rest = split_sources(reduced(estimate, MAP_HEIGHT))
    strong, weak = ([one for one in sources if (luminance(one.power) >= STRONG * total) == so] for so in (True, False))
    rest += draw_sources(MAP_HEIGHT, weak)
    picture, seen, continued = _place(rest, plate, frame_from_camera, rows)
    lights = lobes_of(strong, seen, picture)
    origin = np.concatenate([seen, (1 - seen) * (1 - continued), (1 - seen) * continued], axis=-1)
    if lit:
        radiance = with_moments(picture * (1 - seen), picture * seen + lights, project(estimate), 1 - continued)
    else:
        small = (reduced(part, MAP_HEIGHT) for part in (picture * seen, picture * (1 - seen), lights))
        seen_only, beyond, strongest = (COSINE_LOBE * luminance(project(part)) for part in small)
        lack, weight = COSINE_LOBE * luminance(project(estimate)) - seen_only, np.linalg.norm(beyond)
        equations = np.stack([np.append(beyond, weight), np.append(strongest, 0.0)], axis=1)  # the last: a gain of 1
        gains = np.linalg.lstsq(equations, np.append(lack, weight), rcond=None)[0].clip(1 / MOST_GAIN, MOST_GAIN)
        around, source = gains.astype(np.float32)
        radiance = picture * (seen + around * (1 - seen)) + source * lights
    return np.maximum(radiance, 0.0).astype(np.float32), origin.astype(np.float32)


def _place(
    rest: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the picture without strong sources [R, 2R, 3], the share of it that is the photo's, and the share of what
    goes on from the photo, each [R, 2R, 1]; `plate` draws the photo into the sphere."""
    estimate = np.log(np.maximum(blur_cosine_power(rest, SMOOTH), 0.0) + FLOOR)
    size = max(rows, MAP_HEIGHT)
    if plate is None:
        drawn, cover, inside = (np.zeros((size, 2 * size, channels), np.float32) for channels in (3, 1, 1))
    else:
        drawn, cover, inside = plate.drawn(frame_from_camera, size)
    seen, beyond = reduced(cover, MAP_HEIGHT), 1 - reduced(inside, MAP_HEIGHT)
    photo = np.log(reduced(drawn, MAP_HEIGHT) / np.maximum(seen, LEAST_SEEN) + FLOOR)
    weight = HELD * seen + beyond + LEAST_WEIGHT
    values = np.dstack([HELD * seen * photo + beyond * estimate, HELD * seen]) / weight
    found = blur_cosine_power(screened(values, weight[..., 0], np.radians(REACH_DEG)), GOING_ON)
    smooth = enlarged_map(np.dstack([found, blur_cosine_power(seen, SOFT)]), rows)
    share = np.clip((smooth[..., 4:] - SHARP[0]) / (SHARP[1] - SHARP[0]), 0.0, 1.0)
    drawn, cover = reduced(drawn, rows), reduced(cover, rows)
    share = np.minimum(share * share * (3 - 2 * share), cover)
    around = np.maximum(np.exp(smooth[..., :3]) - FLOOR, 0.0)
    picture = around + share * (drawn / np.maximum(cover, LEAST_SEEN) - around)
    return picture, share, np.clip(smooth[..., 3:4], 0.0, 1.0)


def in_frame(radiance: np.ndarray, frame_from_camera: np.ndarray) -> np.ndarray:
    """Rotate a map [H, 2H, 3] into a panorama's frame."""
    if np.allclose(frame_from_camera, np.eye(3)):
        return radiance
    return np.maximum(rotate(radiance, frame_from_camera), 0.0)


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
    gain = np.exp(np.clip(force * (y @ c), -np.log(MOST_GAIN), np.log(MOST_GAIN)))
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
        gained = light * np.exp(np.clip(force * (y @ c), -np.log(MOST_GAIN), np.log(MOST_GAIN)))
        rest = lack - gained @ y
        gram = (y * (force * gained)[:, None]).T @ y
        step = np.linalg.solve(gram + (1e-5 * np.trace(gram) + 1e-9) * np.eye(9), rest)
        c = c + step * min(1.0, 0.7 / max(np.abs(y @ step).max(), 1e-9))
    return c


def lobes_of(sources: Iterable[LightSource], cover: np.ndarray, picture: np.ndarray) -> np.ndarray:
    """Return light sources [R, 2R, 3], brightest in their middle and fading out, that spread as much as their discs:
    they are down to a quarter a fourth of the disc's radius from its middle.

    cover: [R, 2R, 1] share of the picture [R, 2R, 3] that is seen, where only clipped pixels are sources.
    """
    rows = len(picture)
    angles, polar = pixel_solid_angles(rows), np.pi * (np.arange(rows)[:, None] + 0.5) / rows
    u = (np.arange(2 * rows) + 0.5) / (2 * rows)
    level = uv_to_direction(np.stack([u, np.full_like(u, 0.5)], axis=-1))
    free = np.where(luminance(picture) > AS_SOURCE, 1.0, 1.0 - cover[..., 0])
    drawn = np.zeros_like(picture)
    for source in sources:
        radius = max(np.radians(source.radius_deg), np.pi / rows)
        cosine = np.sin(polar) * (level @ source.direction) + np.cos(polar) * source.direction[1]
        shape = angles / (1 + 32 * np.maximum(1 - cosine, 0.0) / radius**2) ** 2
        kept = float((shape * free).sum() / shape.sum())
        if kept > LEAST_FREE:
            drawn += (shape * free / angles / (kept * shape.sum()))[..., None] * source.power
    return drawn

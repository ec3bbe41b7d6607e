"""Panorama of the place: the photo, its continuation, and the estimate's light.

    L = seen, else g exp(w ln C + (1 - w) ln E), + sources

C is the photo continued all around (detail.continued), with its texture. Its colour is kept by the share w, which falls
with the angle to what is seen; the rest gives way to the estimate E without its sources, drawn as a room or as sky over
ground (detail.layers). The gain g is smooth: it brings the nine spherical harmonics to the estimate's with the least
change (Kullback-Leibler). Sources have bodies of their own size and a faint glow (detail.drawn_sources).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.detail.angles import angles_from
from anyprobe.detail.continued import CONTINUED_FLOOR, continue_around
from anyprobe.detail.drawn_sources import SOFT, draw_lights, take_glare, take_sources
from anyprobe.detail.kinds import OPEN_AIR
from anyprobe.detail.layers import FLOOR_DEG, as_place, ground_share
from anyprobe.detail.matched_light import enlarged_map, with_moments
from anyprobe.errors import InputError, OutputError
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import HALF_MAX, write_exr, write_hdr
from anyprobe.match.plate import DrawnPlate, Plate, seen_in
from anyprobe.pictures.images import write_png

PANORAMA_SIZES = (64, 128, 256, 512, 1024, 2048)
DRAWN_ROWS = 512
"""Rows of a panorama."""
KNEE, SHOULDER = 0.5, 0.099
"""Radiance above which a picture compresses highlights, and by which factor of a logarithm: 16 is shown as 1."""
EDGE_DEG = 3.0
"""Width [degrees] over which the photo gives way to its continuation, inside its border."""
WIDEST_EDGE_DEG = 14.0
"""The same of a photo that stays darker than the estimate by a factor e."""
DARKER, MOST_LIFT = 1.5, 8.0
"""Estimate over photo from which on the photo is shown brighter, and by how much at most."""
FAR_DEG, HUE_DEG = 45.0, 60.0
"""Angles [degrees] from what is seen at which the continued brightness and hue count 1 / e."""
RISE_DEG = 12.0, 25.0
"""Elevations [degrees] above the photo at which its continuation counts 1 / e, indoors and outdoors."""
LINES_DEG = 6.0
"""The same of its lines and texture."""
WALLS = 14.0
"""Sharpness of the blur of the estimate's light on walls, floor and sky: about 12 degrees."""
OVER_DEG = 4.0
"""Elevation [degrees] from the top of a photo of the ground alone to the floor's edge."""
NEAR_GAIN_DEG = 25.0
"""Angle [degrees] from what is seen over which the gain sets in, so that no edge appears there."""
MOST_OFF = 0.005
"""Error of the harmonics up to which small spots of glare may be left out."""
NEAR_GLARE_DEG = 4.0
"""The same angle of the glare."""


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

    def __repr__(self) -> str:
        frame = "level" if self.is_level else "in the light's frame"
        seen, estimated, invented = (self.origin * pixel_solid_angles(len(self.origin))[..., None]).sum((0, 1)) / (
            4 * np.pi
        )
        parts = [
            "Panorama {} x {}".format(*self.radiance.shape),
            frame,
            f"{seen:.0%} seen, {estimated:.0%} estimated, {invented:.0%} invented",
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
            half = bool(self.radiance.max() < HALF_MAX)
            write_exr(path, self.radiance, half=half, attributes=self.attributes, colorspace=colorspace)
        elif kind == ".hdr":
            write_hdr(path, self.radiance, attributes=self.attributes)
        elif kind == ".png":
            write_png(path, self.display())
        else:
            raise OutputError(f"expected .exr, .hdr or .png, got {kind or 'no suffix'}", source=path)
        return path

    def save_origin(self, path: str | Path) -> Path:
        """Write the origin of each pixel as a picture: red is seen, green estimated, blue invented."""
        write_png(Path(path), self.origin)
        return Path(path)


def check_rows(rows: int) -> None:
    """Raise InputError if a panorama cannot have so many rows."""
    if rows not in PANORAMA_SIZES:
        text = f"expected one of {', '.join(map(str, PANORAMA_SIZES))} rows, got {rows}; choose another"
        raise InputError(text, subject="size")


def compose(
    estimate: np.ndarray, plate: Plate | None, frame_from_camera: np.ndarray, rows: int, *, kind: str | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Compose a panorama [rows, 2 rows, 3] and its origin [rows, 2 rows, 3], see Panorama.

    Args:
        estimate: [H, 2H, 3] in the panorama's frame.
        plate: the photo without its object; None where it shows nothing but the object.
        frame_from_camera: [3, 3].
        kind: as which place a smooth estimate is drawn, kinds.INDOORS or OPEN_AIR; None: the map as it is.
    """
    sources, rest = take_sources(estimate)
    tries = [(rest, np.zeros((MAP_HEIGHT, 2 * MAP_HEIGHT, 3), np.float32))]
    if kind is not None:  # with less glare the harmonics may be out of reach
        tries.insert(0, take_glare(reduced(rest, MAP_HEIGHT)))
    seen = None if plate is None else seen_in(plate, frame_from_camera, rows)
    goal = project(estimate)
    for surfaces, glare in tries:
        picture, cover, origin, angle = _place(surfaces, seen, rows, kind)
        away, strength = (1.0 - np.exp(-((angle / near) ** 2)) for near in (NEAR_GLARE_DEG, NEAR_GAIN_DEG))
        fixed = picture * cover + draw_lights(sources, cover, picture, kind) + enlarged_map(glare, rows) * away
        radiance = with_moments(picture * (1 - cover), fixed, goal, strength)
        if np.linalg.norm(project(radiance) - goal) < MOST_OFF * np.linalg.norm(goal):
            break
    return radiance.astype(np.float32), origin


def _place(
    rest: np.ndarray, seen: DrawnPlate | None, rows: int, kind: str | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the picture without sources, the share of it that is the photo's [R, 2R, 1], the origin of each pixel, and
    its angle [degrees, R, 2R, 1] to the photo."""
    nothing = np.zeros((rows, 2 * rows, 1), np.float32)
    if seen is not None and not (seen.margin > 0).any():
        seen = None
    edge_deg = EDGE_DEG
    if seen is not None:
        seen, edge_deg = _lifted(seen, rest)
    around = None if seen is None else continue_around(seen)
    floor_deg = FLOOR_DEG if around is None else float(np.clip(around.top + OVER_DEG, FLOOR_DEG, -OVER_DEG))
    outdoors = kind == OPEN_AIR
    ground = None
    if kind is None:
        drawn = enlarged_map(rest, rows)
    else:
        drawn, ground = as_place(blur_cosine_power(reduced(rest, MAP_HEIGHT), WALLS), rows, outdoors, floor_deg)
    if seen is None:
        origin = np.concatenate([nothing, nothing + 1, nothing], axis=-1)
        return drawn, nothing, origin, nothing + 180
    within = np.clip(seen.margin / edge_deg, 0.0, 1.0)[..., None].astype(np.float32)
    within = within * within * (3 - 2 * within)
    angle = angles_from(within[..., 0])
    if around is None:
        picture = drawn + within * (seen.radiance - drawn)
        return picture, within, np.concatenate([within, 1 - within, nothing], axis=-1), angle[..., None]
    ln, ln_drawn = around.ln, np.log(drawn + CONTINUED_FLOOR)
    soft, goal = (enlarged_map(blur_cosine_power(reduced(one, MAP_HEIGHT), SOFT), rows) for one in (ln, ln_drawn))
    elevation = 90.0 - 180.0 * (np.arange(rows, dtype=np.float32)[:, None] + 0.5) / rows
    up = np.maximum(elevation - np.float32(around.top), 0.0)
    if around.top < 0:
        up = up * (1 - (ground_share(rows, outdoors, floor_deg) if ground is None else ground))
    rise = RISE_DEG[int(outdoors)]
    share, hue = (np.exp(-((angle / far) ** 2) - up / rise)[..., None].astype(np.float32) for far in (FAR_DEG, HUE_DEG))
    lines = np.exp(-((up / LINES_DEG) ** 2))[..., None].astype(np.float32)
    lack = goal - soft
    level = lack.mean(axis=-1, keepdims=True)
    ln = soft + (1 - share) * level + (1 - hue) * (lack - level) + lines * (ln - soft) + (1 - lines) * (ln_drawn - goal)
    continued = np.maximum(np.exp(ln) - CONTINUED_FLOOR, 0.0)
    behind = np.maximum(np.exp(around.within) - CONTINUED_FLOOR, 0.0)
    picture = continued + within * (behind - continued)
    clear = within * (1 - np.clip(seen.filled[..., None], 0.0, 1.0))
    invented = (1 - clear) * np.maximum(share, within)
    return picture, within, np.concatenate([clear, 1 - clear - invented, invented], axis=-1), angle[..., None]


def _lifted(seen: DrawnPlate, estimate: np.ndarray) -> tuple[DrawnPlate, float]:
    """Brighten a photo far darker than the estimate there, and return the width [degrees] of its edge.

    Such a place, behind a flash or near lamps, tells nothing of the light: as it is, it would be a hole in the
    panorama. White stays white.
    """
    inside = reduced((seen.margin > 0.0).astype(np.float32)[..., None], MAP_HEIGHT)
    shown = float((reduced(seen.radiance, MAP_HEIGHT) * inside).sum())
    ratio = float((reduced(estimate, MAP_HEIGHT) * inside).sum()) / max(shown, 1e-6)
    lift = float(np.clip(ratio / DARKER, 1.0, MOST_LIFT))
    left = float(np.clip(np.log(max(ratio / DARKER / lift, 1.0)), 0.0, 1.0))
    radiance = lift * seen.radiance / (1 + (lift - 1) * np.minimum(seen.radiance, 1.0))
    return replace(seen, radiance=radiance.astype(np.float32)), EDGE_DEG + (WIDEST_EDGE_DEG - EDGE_DEG) * left


def in_frame(radiance: np.ndarray, frame_from_camera: np.ndarray) -> np.ndarray:
    """Rotate a map [H, 2H, 3] into a panorama's frame."""
    if np.allclose(frame_from_camera, np.eye(3)):
        return radiance
    return np.maximum(rotate(radiance, frame_from_camera), 0.0)

"""`match`: the panoramas of a folder, ranked by how well they explain a photo's light, and brought into its frame."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, uv_to_direction
from anyprobe.errors import InputError, OutputError
from anyprobe.light.environment import reduced, rotate
from anyprobe.light.filtering import irradiance_map
from anyprobe.maps.radiance import read_radiance, write_exr
from anyprobe.match.background import seen_along
from anyprobe.match.library import Library, open_library, stamp_of
from anyprobe.match.likeness import Shown, best_places, gain_of, shown_under
from anyprobe.render.spheres import sphere_normals

KIND_ROWS = 32
"""Rows at which maps are judged."""
UPPER, LOWER = np.sin(np.radians(35.0)), -0.3
"""Smallest and largest y of the upper and of the lower part."""
BRIGHTER, BLUE, GREEN, EVEN = 0.49, 2.24, 0.93, 0.71
"""Weights of the upper part's ln brightness over the lower one's, of its ln of blue over red, and of the greenness; and
their sum at even odds.

Greenness is the ln of green squared over red and blue that a fifth of the low part exceeds. A logistic fit to 99
training maps, of which it misclassifies 8; of 30 test maps 6.
"""
LOW, GREENEST = 0.3, 0.8
"""Largest y of what may be green, and the quantile."""
MISJUDGED, MISJUDGED_ESTIMATE = 0.08, 0.25
"""How often the odds of a map are wrong however large they are, and what is said of a photo's place.

With them a map of the other kind loses at most 0.9 natural logarithms against one of the same, near the price that was
best on left-out renders.
"""


def log_odds(maps: np.ndarray) -> np.ndarray:
    """Return the log odds [N] that maps [N, H, 2H, 3] are of places outdoors.

    Those have an upper part that is blue and brighter than the lower one, and a lower one that is green. That is
    sometimes wrong, so it excludes nothing. Of a photo's place the graph says it (`Light.outdoors`).
    """
    maps = np.stack([reduced(one, KIND_ROWS) for one in maps])
    d = pixel_directions(maps.shape[1])[..., 1]
    upper, lower = d > UPPER, d < LOWER
    level = maps.mean(axis=-1)
    ln = np.log(level + 1e-3 * level.mean(axis=(1, 2), keepdims=True) + 1e-9)
    brighter = np.median(ln[:, upper], axis=1) - np.median(ln[:, lower], axis=1)
    red, green, blue = np.moveaxis(np.log(np.maximum(maps, 1e-9)), -1, 0)
    bluish = np.median((blue - red)[:, upper], axis=1)
    greenish = np.quantile((2 * green - red - blue)[:, d < LOW], GREENEST, axis=1)
    return BRIGHTER * brighter + BLUE * bluish + GREEN * greenish - EVEN


def same_kind(outdoors: float | None, maps: np.ndarray) -> np.ndarray:
    """Return the probability [N] that a place and maps are of one kind.

    outdoors: probability that the place is outdoors; None: not known. maps: log odds [N].
    """
    own = MISJUDGED_ESTIMATE + (1 - 2 * MISJUDGED_ESTIMATE) * (0.5 if outdoors is None else outdoors)
    theirs = MISJUDGED + (1 - 2 * MISJUDGED) / (1 + np.exp(-np.clip(maps, -50.0, 50.0)))
    return own * theirs + (1 - own) * (1 - theirs)


OWN_ERROR = 0.8
"""Error of an estimate's shading that one in ten exceeds [stops], see shading_apart.

Of 277 left-out renders of whole photos, quantiles of .5, .8 and .9 are .28, .54 and .72, of 105 cut-outs .38, .60 and
.84.
"""
USUAL_ERROR = 0.45
"""Standard deviation of that error [stops]: four in five are below 1.3 times as much."""
SHADED, FAINT = 16, 1e-4
"""Size [px] of the sphere that is compared, and the share of the mean radiance added before logarithms."""
SHADED_ROWS = 32
"""Rows of the maps that shade it."""


def shadings_apart(maps: np.ndarray, map_from_camera: np.ndarray, camera: np.ndarray) -> np.ndarray:
    """Return how differently each of maps [N, 32, 64, 3], rotated [N, 3, 3], and a map [H, 2H, 3] of the camera's frame
    shade a matte sphere, in stops [N]: root mean square over its visible side, exposure being free."""
    n, _ = sphere_normals(SHADED)
    turns = np.concatenate([map_from_camera, np.eye(3)[None]])
    lights = np.concatenate([maps, reduced(camera, SHADED_ROWS)[None]]).astype(np.float32)
    lit = luminance(irradiance_map(lights))[..., None]
    shades = seen_along(lit, np.arange(len(lights)), n @ turns.transpose(0, 2, 1))[..., 0]
    shades = np.log2(np.maximum(shades, 0.0) / np.pi + FAINT * lights.mean(axis=(1, 2, 3))[:, None])
    facing = n[:, 2] / n[:, 2].sum()
    apart = shades[:-1] - shades[-1]
    apart = apart - (apart @ facing)[:, None]
    return np.sqrt(apart**2 @ facing)


def shading_apart(radiance: np.ndarray, other: np.ndarray) -> float:
    """Return the same of two maps [H, 2H, 3] of one frame."""
    return float(shadings_apart(reduced(radiance, SHADED_ROWS)[None], np.eye(3)[None], other)[0])


BLOCK_ROWS = 64
"""Rows of a large map that are rotated at once."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class MatchedMap:
    """A panorama of a folder, aligned with a photo's light.

    Attributes:
        rank: 0 is the best. name: path within the folder, without the suffix. path: of the file.
        misfit: negative logarithm of its probability; only differences matter: below 1 two maps are hardly
            distinguishable.
        by: "photo", or "map" where only the light's own map was compared.
        map_from_light: [3, 3] rotation, from the light's frame to the panorama's.
        gain: [3], from the panorama's radiance to the light's units.
    """

    rank: int
    name: str
    misfit: float
    by: str
    map_from_light: np.ndarray
    gain: np.ndarray
    library: Library = field(repr=False)
    index: int = field(repr=False)

    @property
    def path(self) -> Path:
        return self.library.files[self.index]

    @property
    def exposure_ev(self) -> float:
        """The gain in stops."""
        return float(np.log2(self.gain.mean()))

    @property
    def tint(self) -> np.ndarray:
        """The gain of each channel [3] over their mean."""
        return self.gain / self.gain.mean()

    @property
    def yaw_deg(self) -> float:
        """Rotation [degrees] of the panorama to the left about its vertical."""
        return float(np.degrees(np.arctan2(self.map_from_light[0, 2], self.map_from_light[2, 2])))

    @property
    def pitch_deg(self) -> float:
        """Pitch [degrees] of the photo's camera in it, downwards."""
        return float(np.degrees(np.arcsin(np.clip(self.map_from_light[1, 2], -1.0, 1.0))))

    def radiance(self, rows: int | None = None) -> np.ndarray:
        """Return the panorama in the light's frame and units, [H, 2H, 3] float32, reduced to at most `rows` rows.

        Raises:
            InputError: the file has changed since it was compared.
        """
        if stamp_of(self.path, self.library.folder) != self.library.stamps[self.index]:
            raise InputError("expected the map that was compared, got another; run match again", source=self.path)
        source = read_radiance(self.path)
        if rows is not None:
            source = reduced(source, rows)
        height, turned = len(source), np.empty_like(source)
        u = (np.arange(2 * height) + 0.5) / (2 * height)
        turn, gain = self.map_from_light.T.astype(np.float32), self.gain.astype(np.float32)
        for top in range(0, height, BLOCK_ROWS):
            v = (np.arange(top, min(top + BLOCK_ROWS, height)) + 0.5) / height
            uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)
            d = uv_to_direction(uv).astype(np.float32) @ turn
            turned[top : top + BLOCK_ROWS] = np.maximum(bilinear(source, direction_to_uv(d)), 0.0) * gain
        return turned

    def write(self, path: str | Path) -> Path:
        """Write the panorama in the light's frame and units, at full size, as .exr of halves, or of floats where halves
        would clip.

        Raises:
            InputError: see radiance. OutputError: another suffix, or it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".exr":
            raise OutputError(f"expected a name in .exr, got {path.suffix or 'no suffix'}; rename it", source=path)
        attributes = {"match": self.name, "map_from_light": str(self.map_from_light.round(6).tolist())}
        write_exr(path, self.radiance(), half=None, attributes=attributes)
        return path

    def sidecar(self) -> dict[str, Any]:
        """Return all attributes, ready for JSON."""
        return {
            "rank": self.rank,
            "name": self.name,
            "file": str(self.path),
            "misfit": round(self.misfit, 4),
            "compared_by": self.by,
            "map_from_light": self.map_from_light.round(6).tolist(),
            "yaw_deg": round(self.yaw_deg, 2),
            "pitch_deg": round(self.pitch_deg, 2),
            "exposure_ev": round(self.exposure_ev, 3),
            "tint": self.tint.round(4).tolist(),
        }


def rank_maps(
    radiance: np.ndarray,
    shown: Shown | None,
    folder: Library | str | Path,
    light_from_camera: np.ndarray,
    pitch_deg: float | None = None,
    *,
    pitch_error_deg: float = 0.0,
    roll_deg: float = 0.0,
    outdoors: float | None = None,
) -> list[MatchedMap]:
    """Rank all maps of a folder by their posterior probability, the best first.

    Its negative logarithm, with even odds of all maps, is

        misfit of the object and its background + prior of the pitch (match.likeness)
        + (difference in shading / USUAL_ERROR)^2 / 2 - ln probability of one kind of place

    Args:
        radiance: of the light, [H, 2H, 3], in its frame.
        shown: pixels of the photo's object, in the camera's frame; None: a sphere under the light stands for it.
        light_from_camera: [3, 3].
        pitch_deg: camera pitch downwards, where known; kept if it has no error.
        pitch_error_deg: its standard deviation; it is moved by up to 1.75 times as much.
        roll_deg: camera roll, which is kept, see estimate.ground.Ground.
        outdoors: probability that the place is outdoors; None: not known.
    """
    if roll_deg:  # as for a camera without roll
        unrolled = rotation_z(np.radians(roll_deg))
        shown = None if shown is None else shown.turned(unrolled)
        light_from_camera = light_from_camera @ unrolled.T
    library = folder if isinstance(folder, Library) else open_library(folder)
    lights, levels = library.lights, library.levels
    camera = np.maximum(rotate(radiance, light_from_camera.T), 0.0)
    seen = shown_under(camera) if shown is None else shown
    places, misfits = best_places(seen, lights, pitch_deg, error_deg=pitch_error_deg)
    misfits = misfits + 0.5 * (shadings_apart(lights, places, camera) / USUAL_ERROR) ** 2
    misfits = misfits - np.log(same_kind(outdoors, log_odds(lights)))
    return [
        MatchedMap(
            rank=rank,
            name=library.names[i],
            misfit=float(misfits[i]),
            by="map" if shown is None else "photo",
            map_from_light=np.asarray(places[i] @ light_from_camera.T, np.float64),
            gain=np.asarray(gain_of(seen, camera, lights[i], places[i]) / levels[i], np.float64),
            library=library,
            index=int(i),
        )
        for rank, i in enumerate(np.argsort(misfits, kind="stable"))
    ]

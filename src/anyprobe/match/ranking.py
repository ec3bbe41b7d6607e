"""`match`: the panoramas of a folder, ranked by how well they explain a photo's light, and brought into its frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.core.frames import rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv, uv_to_direction
from anyprobe.errors import OutputError
from anyprobe.light.environment import reduced, rotate
from anyprobe.maps.radiance import HALF_MAX, read_radiance, write_exr_planes
from anyprobe.match.kind import log_odds, same_kind
from anyprobe.match.library import Library, open_library
from anyprobe.match.likeness import Shown, best_places, gain_of, shown_under
from anyprobe.match.shading import USUAL_ERROR, shadings_apart

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
        source = self._source()
        if rows is not None:
            source = reduced(source, rows)
        return np.concatenate(list(self._turned(source)))

    def write(self, path: str | Path) -> Path:
        """Write the panorama in the light's frame and units, at full size, as .exr of halves, or of floats where halves
        would clip.

        Raises:
            InputError: see radiance. OutputError: another suffix, or it cannot be written.
        """
        path = Path(path)
        if path.suffix.lower() != ".exr":
            raise OutputError(f"expected a name in .exr, got {path.suffix or 'no suffix'}; rename it", source=path)
        source = self._source()
        height = len(source)
        is_half = bool((source.max(axis=(0, 1)) * self.gain).max() <= HALF_MAX)
        planes = np.empty((3, height, 2 * height), np.float16 if is_half else np.float32)
        row = 0
        for block in self._turned(source):
            planes[:, row : row + len(block)] = np.moveaxis(block, -1, 0)
            row += len(block)
        del source
        attributes = {"match": self.name, "map_from_light": str(self.map_from_light.round(6).tolist())}
        write_exr_planes(path, planes, attributes)
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

    def _source(self) -> np.ndarray:
        self.library.check_unchanged(self.index)
        return read_radiance(self.path)

    def _turned(self, source: np.ndarray) -> Iterator[np.ndarray]:
        """Yield blocks of rows of the rotated map [n, 2H, 3]; only the source is held whole."""
        height = len(source)
        u = (np.arange(2 * height) + 0.5) / (2 * height)
        turn, gain = self.map_from_light.T.astype(np.float32), self.gain.astype(np.float32)
        for top in range(0, height, BLOCK_ROWS):
            v = (np.arange(top, min(top + BLOCK_ROWS, height)) + 0.5) / height
            uv = np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)
            d = uv_to_direction(uv).astype(np.float32) @ turn
            yield np.maximum(bilinear(source, direction_to_uv(d)), 0.0).astype(np.float32) * gain


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
        + (difference in shading / USUAL_ERROR)^2 / 2 (match.shading) - ln probability of one kind of place (match.kind)

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

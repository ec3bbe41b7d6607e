"""How cameras are turned, and what their lenses take in, from the transforms.json that trackers write (parse_poses)."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.paths import natural_order, read_regular
from anyprobe.pictures.declared_size import photo_header

TOLERANCE = 0.01
"""By how much R R^T may differ from 1: files carry a few digits."""

MOST_POSES = 50_000
"""Most poses in a file: a clip of half an hour has as many frames."""

MAX_BYTES = 64 * 2**20
"""Longest file of poses."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Lens:
    """Tangents of half the angles that the upright picture's width and height take in; None where nothing says so."""

    tan_x: float | None = None
    tan_y: float | None = None

    def long_fov_deg(self, width: int, height: int) -> float | None:
        """Field of view of the longer side of a picture of that shape; 0 x 0: of any."""
        tangents: tuple[float | None, ...] = (self.tan_x, self.tan_y)
        if width and height:
            of_x = None if self.tan_x is None else self.tan_x * height / width
            of_y = None if self.tan_y is None else self.tan_y * width / height
            tangents = (self.tan_y or of_x,) if height > width else (self.tan_x or of_y,)
        found = [tangent for tangent in tangents if tangent is not None]
        return float(2 * np.degrees(np.arctan(max(found)))) if found else None


@dataclass(frozen=True, kw_only=True, slots=True)
class Poses:
    """world_from_camera [N, 3, 3]; names of the photos without folders (see bare_name); the file's own name, for
    messages; the cameras' lenses."""

    file: str
    world_from_camera: np.ndarray
    names: tuple[str, ...]
    lenses: tuple[Lens, ...]

    def in_order(self) -> np.ndarray:
        """[N, 3, 3] of a clip's frames, by name: frame_2 before frame_10."""
        return self.world_from_camera[sorted(range(len(self.names)), key=lambda k: natural_order(self.names[k]))]

    def of(self, photos: list[Path]) -> np.ndarray:
        """[len(photos), 3, 3], by name; InputError where one is missing."""
        return self.world_from_camera[self._places(photos)]

    def fovs_deg(self, photos: list[Path], data: Sequence[Any]) -> list[float | None]:
        """Fields of view of the photos' longer sides, found as their poses are: None where the photo's own EXIF has
        it, or nothing does.

        data: the files themselves or their paths; of the photos, names count.
        """
        found = []
        for place, source in zip(self._places(photos), data, strict=True):
            size, by_exif = photo_header(source)
            found.append(self.lenses[place].long_fov_deg(*size) if by_exif is None else None)
        return found

    def clip_fov_deg(self, width: int, height: int) -> float | None:
        """Field of view of a clip's longer side, the median of its frames'; None where the file does not say.

        width, height: of the clip's upright frames, pixels: a lens may be given across alone.
        """
        found = [fov for lens in self.lenses if (fov := lens.long_fov_deg(width, height)) is not None]
        return float(np.median(found)) if found else None

    def _places(self, photos: list[Path]) -> list[int]:
        """Return which pose is whose."""
        bare = [PurePosixPath(bare_name(photo.name)) for photo in photos]
        for what, names in (("poses of", self.names), ("photos", [photo.name for photo in bare])):
            name, count = Counter(names).most_common(1)[0] if names else ("", 0)
            if count > 1:
                raise InputError(f"expected names that differ, got two {what} {name}; rename one", source=self.file)
        places = {name: place for place, name in enumerate(self.names)}
        found = []
        for photo, plain in zip(photos, bare, strict=True):
            if (one := places.get(plain.name, places.get(plain.stem))) is None:
                raise InputError(f"expected a pose of {photo.name}, got none of that name", source=self.file)
            found.append(one)
        return found


def read_poses(path: Path) -> Poses:
    """Parse a file of poses; InputError too where there is none."""
    return parse_poses(read_regular(path, str(path), InputError, "a JSON file of camera poses", MAX_BYTES), str(path))


def bare_name(path: str) -> str:
    """Return a photo's name without folders, whichever system's separators the path has."""
    return PurePosixPath(path.replace("\\", "/")).name


def parse_poses(data: bytes, file: str) -> Poses:
    """Parse camera poses: the camera looks along its -Z and +Y is up in its picture; the world's axes may be any.

    The data are the transforms.json of instant-ngp and nerfstudio: an object with "frames", whose entries have a
    "file_path" and a "transform_matrix", 4 x 4 numbers, row by row, that take a point of the camera to the world; only
    its rotation counts. The lens is that of "fl_x" and "w" (and "h"; pixels), or of "camera_angle_x" (radians), an
    entry's own or the whole file's.

    Raises:
        InputError: another content, a matrix that is no rotation, a lens that is none, or too many of them; names
            which, and the file.
    """
    try:
        content = json.loads(data)  # UTF-8, with a byte order mark or without, or another Unicode
    except (ValueError, RecursionError) as error:
        text = "cannot be read as a transforms.json of camera poses; see docs/how-to/inputs.md"
        raise InputError(text, source=file) from error
    frames = content.get("frames") if isinstance(content, dict) else None
    if not isinstance(frames, list) or not frames or not all(isinstance(one, dict) for one in frames):
        raise InputError('expected "frames", one a photo, got none; see docs/how-to/inputs.md', source=file)
    if len(frames) > MOST_POSES:
        raise InputError(f"expected at most {MOST_POSES} poses, got {len(frames)}; leave some out", source=file)
    paths = [one.get("file_path") for one in frames]
    if not all(isinstance(path, str) for path in paths):
        raise InputError('expected a "file_path" in each of the "frames", got one without; name its photo', source=file)
    names = tuple(bare_name(path) for path in paths)
    rotations = np.array([_rotation(file, name, one) for name, one in zip(names, frames, strict=True)])
    lenses = tuple(_lens(file, content | one) for one in frames)  # an entry's own before the whole file's
    return Poses(file=file, world_from_camera=rotations, names=names, lenses=lenses)


def _lens(file: str, given: dict[str, Any]) -> Lens:
    """By focal length and size in pixels, else by the angle in radians; pinholes, their axis in the middle."""

    def number(key: str, below: float = 1e9) -> float | None:
        value = given.get(key)
        if value is None or (isinstance(value, int | float) and 0 < value < below):
            return value
        raise InputError(
            f"expected {key} to be a number above 0{' and below pi' * (below < 4)}, got {value!r:.60}; "
            "repair it or leave it out",
            source=file,
        )

    def tangent(focal: str, size: str, angle: str) -> float | None:
        focal_px, size_px, radians = number(focal) or number("fl_x"), number(size), number(angle, np.pi)
        if focal_px and size_px:
            return float(size_px / focal_px / 2)
        return None if radians is None else float(np.tan(radians / 2))

    return Lens(tan_x=tangent("fl_x", "w", "camera_angle_x"), tan_y=tangent("fl_y", "h", "camera_angle_y"))


def _rotation(file: str, name: str, frame: dict[str, Any]) -> np.ndarray:
    """Return the rotation nearest to that of a frame's matrix."""
    try:
        values = np.array(frame.get("transform_matrix"), dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.zeros(0)
    if values.shape != (4, 4):
        raise InputError(f'{name}: expected a "transform_matrix" of 4 x 4 numbers, got something else', source=file)
    if np.abs(values[3, :3]).max() > TOLERANCE:
        text = f"{name}: expected rows, the last one 0 0 0 1, got columns (as of ARKit or three.js); transpose it"
        raise InputError(text, source=file)
    rotation = values[:3, :3]
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not (off <= TOLERANCE and np.linalg.det(rotation) > 0):  # NaN fails too
        text = f"{name}: expected a rotation, got a matrix that is scaled, sheared or mirrored; leave the scale out"
        raise InputError(text, source=file)
    u, _, vh = np.linalg.svd(rotation)
    return u @ vh

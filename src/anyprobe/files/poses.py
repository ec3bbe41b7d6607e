"""Poses (noun): how cameras are turned, from the files that trackers write."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InputError
from anyprobe.files.names import natural_order

TOLERANCE = 0.01
"""By how much R R^T may differ from 1: files carry a few digits."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Poses:
    """world_from_camera [N, 3, 3]; names of the photos without folders, or None where the file has none; its own name,
    for messages."""

    file: str
    world_from_camera: np.ndarray
    names: tuple[str, ...] | None

    def in_order(self) -> np.ndarray:
        """[N, 3, 3] of a clip's frames: as they are listed, by name where there are names (frame_2 before frame_10)."""
        if self.names is None:
            return self.world_from_camera
        return self.world_from_camera[
            sorted(range(len(self.names)), key=lambda k: natural_order(self.names[k]))
        ]

    def of(self, photos: list[Path]) -> np.ndarray:
        """[len(photos), 3, 3], by name where there are names, else in order; InputError where one is missing."""
        if self.names is None:
            if len(photos) != len(self.world_from_camera):
                raise InputError(
                    f"{self.file}: expected {len(photos)} poses, one a photo in order, got "
                    f"{len(self.world_from_camera)}"
                )
            return self.world_from_camera
        for what, names in (("poses of", self.names), ("photos", [photo.name for photo in photos])):
            twice = next((name for k, name in enumerate(names) if name in names[:k]), None)
            if twice is not None:
                raise InputError(
                    f"{self.file}: expected names that differ, got two {what} {twice}; rename one"
                )
        known = dict(zip(self.names, self.world_from_camera, strict=True))
        found = [known.get(photo.name, known.get(photo.stem)) for photo in photos]  # some write no suffix
        for photo, one in zip(photos, found, strict=True):
            if one is None:
                raise InputError(f"{self.file}: expected a pose of {photo.name}, got none of that name")
        return np.array(found)


def read_poses(path: Path) -> Poses:
    """parse_poses of a file; InputError too where there is none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"{path}: expected a JSON file of camera poses, got none that can be read"
        ) from error
    return parse_poses(data, str(path))


def parse_poses(data: bytes, file: str) -> Poses:
    """Camera poses: the camera looks along its -Z and +Y is up in its picture; the world's axes may be any.

    The data are JSON: a list of matrices, or an object with "frames" whose entries have "transform_matrix", as in the
    transforms.json of instant-ngp and nerfstudio, and perhaps "file_path". A matrix takes a point of the camera to the
    world: 3 x 3, 3 x 4 or 4 x 4 numbers, row by row; only its rotation counts.

    Raises:
        InputError: another content, or a matrix that is no rotation; names which, and the file.
    """
    try:
        content = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{file}: expected a JSON file of camera poses, got none that can be read"
        ) from error
    frames = content.get("frames") if isinstance(content, dict) else None
    names = None
    if isinstance(frames, list) and all(isinstance(one, dict) for one in frames):
        matrices = [one.get("transform_matrix") for one in frames]
        told = [one.get("file_path") for one in frames]
        if all(isinstance(name, str) for name in told):
            names = tuple(Path(name).name for name in told)
    else:
        matrices = content if isinstance(content, list) else []
    if not matrices:
        raise InputError(
            f'{file}: expected a list of matrices, or "frames" with "transform_matrix", got neither; '
            "write one matrix a photo"
        )
    rotations = np.array([_rotation(file, number, matrix) for number, matrix in enumerate(matrices, start=1)])
    return Poses(file=file, world_from_camera=rotations, names=names)


def _rotation(file: str, number: int, matrix: Any) -> np.ndarray:
    """The nearest rotation to the matrix's."""
    try:
        values = np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        values = np.zeros(0)
    if values.shape not in ((3, 3), (3, 4), (4, 4)):
        raise InputError(f"{file}: pose {number}: expected 3 x 3, 3 x 4 or 4 x 4 numbers, got something else")
    rotation = values[:3, :3]
    off = np.abs(rotation @ rotation.T - np.eye(3)).max()
    if not (off <= TOLERANCE and np.linalg.det(rotation) > 0):  # NaN fails too
        raise InputError(
            f"{file}: pose {number}: expected a rotation, got a matrix that is scaled, sheared or mirrored; "
            "leave the scale out"
        )
    u, _, vh = np.linalg.svd(rotation)
    return u @ vh

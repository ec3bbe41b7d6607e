"""Real photos of one object each, cropped as the networks take them."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from anyprobe.core.frames import normalize
from anyprobe.errors import InputError
from anyprobe.estimate.photo import Photo, inputs_of, load_photo
from anyprobe.estimate.runtime import Models, crop_of
from anyprobe_train.dataset.catalog import read_table

GLOSSY = "glossy"
"""Word in the material of lights.csv by which an object is specular."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RealPhotos:
    """N crops as the networks see them.

    photo [N, 4, S, S]: display RGB times mask, and mask. normals [N, 3, S, S]: unit, in the crop's frame, zero off the
    object, as `lift` estimates them, since nobody measured them. camera_from_crop: [3, 3] of each.
    """

    photo: torch.Tensor
    normals: torch.Tensor
    camera_from_crop: list[np.ndarray]

    @property
    def mask(self) -> torch.Tensor:
        """Share of the object in each pixel, [N, 1, S, S]."""
        return self.photo[:, 3:]


def cropped(photos: Iterable[Photo], side: int) -> RealPhotos:
    """Crop photos to their objects."""
    lift = Models(threads=1)
    pictures, normals, turns = [], [], []
    for photo in photos:
        inputs = inputs_of(photo)
        image, frame = crop_of(inputs, side)
        pictures.append(torch.from_numpy(image.transpose(2, 0, 1).copy()))
        turns.append(frame[:3])
        said = lift(inputs).object_normals
        assert said is not None
        resized = F.interpolate(torch.from_numpy(said.transpose(2, 0, 1).copy())[None], (side, side), mode="bilinear")
        normals.append(F.normalize(resized, dim=1)[0])
    shown = torch.stack(pictures)
    return RealPhotos(
        photo=shown.contiguous(memory_format=torch.channels_last),
        normals=torch.stack(normals) * (shown[:, 3:] > 0.5),
        camera_from_crop=turns,
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class LampPhoto:
    """A photo in a dark room; lamp: unit direction [3] towards its lamp, in the camera's frame."""

    file: Path
    mask: Path
    object: str
    is_specular: bool
    lamp: np.ndarray

    def load(self) -> Photo:
        """Read it, its surroundings left out."""
        return load_photo(self.file, mask=self.mask, surroundings="none")


def lamp_photos(folder: Path) -> list[LampPhoto]:
    """Read the photos of folder/lights.csv: file, mask, object, material, and x, y, z towards the lamp."""
    rows = read_table(folder / "lights.csv")[1]
    if not rows:
        raise InputError("expected a row for each photo, got none", source=folder / "lights.csv")
    return [
        LampPhoto(
            file=folder / row["file"],
            mask=folder / row["mask"],
            object=row["object"],
            is_specular=GLOSSY in row["material"],
            lamp=normalize(np.array([float(row[axis]) for axis in "xyz"])),
        )
        for row in rows
    ]


def masked_photos(folder: Path) -> list[tuple[Path, Path]]:
    """Return the photos of a folder that have NAME_mask.png beside them, with those masks, by name."""
    masks = sorted(folder.glob("*_mask.png"))
    photos = ((next(folder.glob(mask.name.removesuffix("_mask.png") + ".*"), None), mask) for mask in masks)
    return [(photo, mask) for photo, mask in photos if photo is not None]

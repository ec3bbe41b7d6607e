"""Real photos with what is known of their lamps, and the normals that `lift` estimates."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.runtime import Models
from research.real_photos.folders import LIGHTS, masked_photos
from research.real_photos.maps import read_direction

SHINY = ("gloss", "glaze", "metal", "silver", "gold", "chrom")
"""Words of a material that the paper would call specular."""
MASKED = 0.5


@dataclass(frozen=True, kw_only=True, slots=True)
class RealPhoto:
    """A photo with its crop; lamp: unit direction [3] towards the only lamp, in the crop's frame, None: not known."""

    name: str
    photo: Photo
    crop: Crop
    specular: bool
    lamp: np.ndarray | None


def real_photos(folder: Path) -> Iterator[RealPhoto]:
    """Yield the photos of a folder that have masks; lamps and materials are as lights.csv or manifest.csv says, if any.

    Raises:
        InputError: none has a mask.
    """
    known = _table(folder)
    for path, mask in masked_photos([folder]).values():
        row = known.get(path.stem, {})
        photo = load_photo(path, mask=mask, surroundings="none")
        crop = crop_object(photo)
        lamp = read_direction(" ".join(row.get(axis, "") for axis in "xyz"))
        yield RealPhoto(
            name=path.stem,
            photo=photo,
            crop=crop,
            specular=any(word in row.get("material", "") for word in SHINY),
            lamp=None if lamp is None else crop.camera_from_crop.T @ lamp,
        )


def _table(folder: Path) -> dict[str, dict[str, str]]:
    """What a folder's table says of each photo, by the name of its file without ending."""
    path = next((path for name in (LIGHTS, "manifest.csv") if (path := folder / name).is_file()), None)
    if path is None:
        return {}
    with path.open(newline="", encoding="utf-8-sig") as stream:
        return {Path(row.get("file") or row.get("id") or "").stem: row for row in csv.DictReader(stream)}


def real_normals(real: RealPhoto, lift: Models) -> np.ndarray:
    """What stands for the normals that Meka et al. need: `lift`'s [64, 64, 3], unit, zero off the object."""
    normals = lift(real.crop.image, real.crop.tan_half).normals
    step = len(real.crop.image) // len(normals)
    mask = real.crop.image[..., 3].reshape(len(normals), step, len(normals), step).mean(axis=(1, 3))
    return (normals * (mask > MASKED)[..., None]).astype(np.float32)

"""Real photos as the small networks see them: cropped to their side, with the normals that `lift` estimates."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from anyprobe.estimate.photo import Crop, Photo, crop_object, load_photo
from anyprobe.estimate.runtime import Models
from research.paper_designs.blocks import pixels_of
from research.paper_designs.figures.trained import Maps, Trained, maps_of
from research.paper_designs.pairs import Batch
from research.real_photos.maps import LIGHTS, read_direction

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
    """The photos of lights.csv (with lamps) or of manifest.csv: columns file, mask, material."""
    table = next((folder / name for name in (LIGHTS, "manifest.csv") if (folder / name).is_file()), folder / LIGHTS)
    with table.open(newline="", encoding="utf-8-sig") as stream:
        rows = list(csv.DictReader(stream))
    for row in rows:
        photo = load_photo(folder / row["file"], mask=folder / row["mask"], surroundings="none")
        crop = crop_object(photo)
        lamp = read_direction(" ".join(row.get(axis, "") for axis in "xyz"))
        yield RealPhoto(
            name=Path(row["file"]).stem,
            photo=photo,
            crop=crop,
            specular=any(word in row["material"] for word in SHINY),
            lamp=None if lamp is None else crop.camera_from_crop.T @ lamp,
        )


def real_maps(one: Trained, real: RealPhoto, lift: Models) -> Maps:
    """What the methods make of a real photo; the normals that Meka et al. need are `lift`'s."""
    side, rows = one.run.scale.side, one.run.scale.rows
    image = crop_object(real.photo, side).image
    mask = (image[..., 3:] > MASKED).astype(np.float32)
    color = np.where(mask > 0, image[..., :3] / np.maximum(image[..., 3:], 1e-3), 0.0).clip(0, 1)
    normals = lift(real.crop.image, real.crop.tan_half).normals
    small = np.stack([_resized(normals[..., k], side) for k in range(3)], axis=-1) * mask
    small /= np.maximum(np.linalg.norm(small, axis=-1, keepdims=True), 1e-6)
    empty = torch.zeros(1, 3, rows, 2 * rows)
    photo = _pixels(np.concatenate([color, mask], axis=-1))
    batch = Batch(
        photo=photo,
        irradiance=photo[..., :3],
        normals=_pixels(small),
        mirror=photo[..., :1],
        sphere=photo[..., :3],
        ldr=pixels_of(empty),
        ln_radiance=pixels_of(empty),
        light=torch.zeros(1, dtype=torch.long),
    )
    return maps_of(one.nets, batch, side, rows)


def _pixels(picture: np.ndarray) -> torch.Tensor:
    return pixels_of(torch.from_numpy(picture.astype(np.float32)).permute(2, 0, 1)[None])


def _resized(values: np.ndarray, side: int) -> np.ndarray:
    picture = Image.fromarray(np.ascontiguousarray(values, np.float32))
    return np.asarray(picture.resize((side, side), Image.Resampling.BOX))

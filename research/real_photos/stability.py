"""How far the dominant light moves where the same photo is given in another way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from PIL import Image, ImageFilter

from anyprobe.core.response import inverse_response, response
from anyprobe.errors import AnyprobeError
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.inputs.hints import NONE
from anyprobe.pictures.images import read_image
from anyprobe_train.evaluate.metrics import direction_error_deg
from research.clustered import upper_decile
from research.real_photos.lamps import ALONE, DEFAULT

MASK_PX, CROP_PX, EXPOSURE_EV = 2, 5, 0.5
COLUMNS = {"median_deg": "median", "upper_decile_deg": "90 %", "largest_deg": "largest", "photos": "photos"}
Given = tuple[np.ndarray, np.ndarray, float, np.ndarray]
"""A photo [H, W, 3] uint8, its mask [H, W] uint8, the field of view of its longer side, and the diagonal [3] that turns
its camera's directions to those of the photo as it is."""


def variants(rgb: np.ndarray, mask: np.ndarray, fov_deg: float) -> Iterator[tuple[str, Given]]:
    """Yield the photo [H, W, 3] uint8 as it is, named "", and in the other ways, by name."""
    same, mirrored = np.ones(3), np.array([-1.0, 1.0, 1.0])
    yield "", (rgb, mask, fov_deg, same)
    yield "mirrored", (rgb[:, ::-1], mask[:, ::-1], fov_deg, mirrored)
    for word, grow in ((f"mask {MASK_PX} px wider", ImageFilter.MaxFilter), ("narrower", ImageFilter.MinFilter)):
        name = word if grow is ImageFilter.MaxFilter else f"mask {MASK_PX} px {word}"
        yield name, (rgb, np.asarray(Image.fromarray(mask).filter(grow(2 * MASK_PX + 1))), fov_deg, same)
    inner = slice(CROP_PX, -CROP_PX), slice(CROP_PX, -CROP_PX)
    side = max(mask.shape)
    tan_half = np.tan(np.radians(fov_deg) / 2) * (side - 2 * CROP_PX) / side
    yield f"cropped by {CROP_PX} px", (rgb[inner], mask[inner], float(2 * np.degrees(np.arctan(tan_half))), same)
    for stops in (EXPOSURE_EV, -EXPOSURE_EV):
        display = response(inverse_response(rgb / 255.0) * 2.0**stops)
        yield f"{stops:+g} EV", (np.round(255 * display).astype(np.uint8), mask, fov_deg, same)


def moved_lights(path: Path, mask: Path, estimator: Estimator) -> dict[str, dict[str, float]]:
    """Return degrees by which the dominant light moves, by variant, of the whole photo and of the object alone.

    What an estimate cannot be made of (the object is gone, say) is left out.
    """
    photo = load_photo(path, mask=mask)
    rgb = np.round(255 * read_image(path).rgb).astype(np.uint8)
    covered = np.round(255 * photo.mask).astype(np.uint8)
    moved: dict[str, dict[str, float]] = {}
    for way, surroundings in ((DEFAULT, {}), (ALONE, {"surroundings": NONE})):
        first = None
        for name, (pixels, given, fov_deg, back) in variants(rgb, covered, photo.long_fov_deg):
            try:
                one = load_photo(np.ascontiguousarray(pixels), mask=given.copy(), fov_deg=fov_deg, **surroundings)
            except AnyprobeError:
                continue
            direction = back * estimator.from_photo(one).dominant_light().direction
            if first is None:
                first = direction
            else:
                moved.setdefault(way, {})[name] = round(direction_error_deg(first, direction), 2)
    return moved


def summary(moved: Mapping[str, Mapping[str, Mapping[str, float]]]) -> dict[str, dict[str, float]]:
    """Return median, 90 % and largest change by way and variant."""
    columns: dict[str, list[float]] = {}
    for one in moved.values():
        for way, row in one.items():
            for name, deg in row.items():
                columns.setdefault(f"{way}, {name}", []).append(deg)
    return {
        name: {
            "median_deg": round(float(np.median(values)), 2),
            "upper_decile_deg": round(upper_decile(np.array(values)), 2),
            "largest_deg": max(values),
            "photos": len(values),
        }
        for name, values in columns.items()
    }

"""Real photos of which only the lamp is known: the angle between it and the estimated dominant light."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, crop_object, load_photo
from anyprobe.evaluate.methods import Method
from anyprobe.evaluate.metrics import direction_error_deg
from anyprobe.light.dominant_light import find_dominant_light
from research.real_photos.maps import read_direction

CONSTANT = "towards the camera"
"""The baseline that says so of every photo: what flash photos alone cannot tell from an estimate."""
TOWARDS_CAMERA = np.array([0.0, 0.0, 1.0])
GROUP = "lamp"
"""What real.json calls these photos, of all kinds together."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LampPhoto:
    """A photo, its crop [128, 128, 4], and the unit direction [3] towards the lamp in the crop's frame, and in_camera:
    in the camera's."""

    name: str
    photo: Photo
    crop: np.ndarray
    tan_half: float
    lamp: np.ndarray
    in_camera: np.ndarray


def load_lamps(folder: Path, rows: Iterable[Mapping[str, str]]) -> Iterator[LampPhoto]:
    """The photos of the rows that have a lamp, cropped, each with the lamp turned to its crop."""
    for row in rows:
        if not row.get("lamp"):
            continue
        fov_deg = float(row["fov_deg"]) if row.get("fov_deg") else None
        photo = load_photo(folder / row["photo"], fov_deg=fov_deg, mask=folder / row["mask"])
        crop, lamp = crop_object(photo), read_direction(row["lamp"])
        yield LampPhoto(
            name=row["photo"],
            photo=photo,
            crop=crop.image,
            tan_half=crop.tan_half,
            lamp=crop.camera_from_crop.T @ lamp,
            in_camera=lamp,
        )


def lamp_angles(
    photos: Iterable[LampPhoto], methods: Mapping[str, Method], estimators: Mapping[str, Estimator] | None = None
) -> dict[str, dict[str, float]]:
    """Photo -> method -> angle [degrees] between its dominant light and the lamp; LDR methods are left out.

    methods see the crop alone; estimators the whole photo, as of a call with the mask given.
    """
    angles: dict[str, dict[str, float]] = {}
    for photo in photos:
        estimates = {name: method(photo) for name, method in methods.items()}
        angles[photo.name] = {CONSTANT: round(direction_error_deg(TOWARDS_CAMERA, photo.lamp), 5)} | {
            name: round(direction_error_deg(find_dominant_light(one.radiance).direction, photo.lamp), 5)
            for name, one in estimates.items()
            if one.radiance is not None
        }
        for name, estimator in (estimators or {}).items():
            found = estimator.from_photo(photo.photo).dominant_light().direction
            angles[photo.name][f"{name}, whole photo"] = round(direction_error_deg(found, photo.in_camera), 5)
    return angles


def lamp_group(angles: Mapping[str, Mapping[str, float]]) -> dict:
    """Those angles' means and medians by method: {"pairs", "rows"} as the other groups have them."""
    by_method: dict[str, list[float]] = {}
    for one in angles.values():
        for name, angle in one.items():
            by_method.setdefault(name, []).append(angle)
    return {
        "pairs": len(angles),
        "rows": [
            {
                "method": name,
                "dominant_light_deg": round(float(np.mean(values)), 5),
                "dominant_light_median_deg": round(float(np.median(values)), 5),
            }
            for name, values in by_method.items()
        ],
    }

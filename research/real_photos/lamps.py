"""Real photos of which only the lamp is known: the angle between it and the estimated dominant light."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import Photo, inputs_of, load_photo
from anyprobe.estimate.runtime import crop_of
from anyprobe.inputs.hints import NONE
from anyprobe.light.light_sources import find_dominant_light
from anyprobe_train.evaluate.methods import Method
from anyprobe_train.evaluate.metrics import direction_error_deg
from anyprobe_train.evaluate.standard_errors import rounded
from research.clustered import coverage, rank_correlation, upper_decile, with_error
from research.real_photos.maps import read_direction

CONSTANT = "towards the camera"
"""The baseline that says so of every photo: what flash photos alone cannot tell from an estimate."""
TOWARDS_CAMERA = np.array([0.0, 0.0, 1.0])
DEFAULT, ALONE = "default", "object alone"
"""The call as it is, and with `surroundings="none"`."""
ALL = "all"
"""The photos of all folders and objects together."""


@dataclass(frozen=True, kw_only=True, slots=True)
class LampPhoto:
    """A photo of an object, the same without its surroundings, and its crop [128, 128, 4].

    lamp, in_camera: unit direction [3] towards the lamp, in the crop's frame and in the camera's.
    """

    name: str
    object: str
    photo: Photo
    alone: Photo
    crop: np.ndarray
    tan_half: float
    lamp: np.ndarray
    in_camera: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class Angle:
    """Degrees between a dominant light and the lamp, and the error that the estimate said; None where it says none."""

    deg: float
    said_deg: float | None = None


def load_lamps(folder: Path, rows: Iterable[Mapping[str, str]]) -> Iterator[LampPhoto]:
    """Yield the photos of the rows that have a lamp, cropped, each with the lamp turned to its crop."""
    for row in rows:
        if not row.get("lamp"):
            continue
        fov_deg = float(row["fov_deg"]) if row.get("fov_deg") else None
        given = {"fov_deg": fov_deg, "mask": folder / row["mask"]}
        photo = load_photo(folder / row["photo"], **given)
        (crop, frame), lamp = crop_of(inputs_of(photo)), read_direction(row["lamp"])
        yield LampPhoto(
            name=f"{folder.resolve().name}/{row['photo']}",
            object=row.get("object") or Path(row["mask"]).stem.removesuffix("_mask"),
            photo=photo,
            alone=load_photo(folder / row["photo"], **given, surroundings=NONE),
            crop=crop,
            tan_half=frame[3, 0],
            lamp=frame[:3].T @ lamp,
            in_camera=lamp,
        )


def lamp_angles(
    photo: LampPhoto, methods: Mapping[str, Method], estimators: Mapping[str, Estimator] | None = None
) -> dict[str, Angle]:
    """Return the angle of every method's dominant light; LDR methods are left out.

    methods see the crop alone; estimators see the whole photo, and the object alone, with the mask given.
    """
    angles = {CONSTANT: Angle(deg=direction_error_deg(TOWARDS_CAMERA, photo.lamp))}
    for name, method in methods.items():
        found = method(photo).radiance
        if found is not None:
            angles[name] = Angle(deg=direction_error_deg(find_dominant_light(found).direction, photo.lamp))
    for title, estimator in (estimators or {}).items():
        for way, seen in ((ALONE, photo.alone), (DEFAULT, photo.photo)):
            main = estimator.from_photo(seen).dominant_light()
            deg = direction_error_deg(main.direction, photo.in_camera)
            angles[f"{title}{way}"] = Angle(deg=deg, said_deg=float(main.error_deg))
    return angles


def figures_of(angles: Sequence[Angle], objects: Sequence[str]) -> dict[str, float | None]:
    """Return mean, median and 90 % of the angles, and how well they are said, with standard errors by object."""
    deg = np.array([one.deg for one in angles])
    figures = {
        "mean_deg": with_error(np.mean, objects, deg),
        "median_deg": with_error(np.median, objects, deg),
        "upper_decile_deg": with_error(upper_decile, objects, deg),
    }
    if all(one.said_deg is not None for one in angles):
        said = np.array([one.said_deg for one in angles], float)
        figures["said_deg"] = with_error(np.median, objects, said)
        figures["holds"] = with_error(coverage, objects, said, deg)
        figures["ranks"] = with_error(rank_correlation, objects, said, deg)
    return {
        key: rounded(number, 3)
        for name, (value, error) in figures.items()
        for key, number in ((name, value), (f"{name}_error", error))
    }


def lamp_groups(objects: Mapping[str, str], angles: Mapping[str, Mapping[str, Angle]]) -> dict[str, dict]:
    """Return figures by method of all photos together (ALL), of each folder and of each object.

    objects, angles: by photo, named FOLDER/FILE.
    """
    groups = {ALL: list(angles)}
    for of in (lambda name: name.split("/")[0], lambda name: objects[name]):
        for name in angles:
            groups.setdefault(of(name), []).append(name)
    return {
        group: {
            "photos": len(names),
            "objects": len({objects[name] for name in names}),
            "rows": {
                method: figures_of([angles[name][method] for name in names], [objects[name] for name in names])
                for method in angles[names[0]]
            },
        }
        for group, names in groups.items()
    }

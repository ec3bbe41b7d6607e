"""Real photos from a user's folder: its rules, and the paper's groups (Sect. 4.2) of those with measured maps."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.latlong import bilinear
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.estimate.photo import inputs_of, load_photo
from anyprobe.estimate.runtime import crop_of
from anyprobe.light.environment import MAP_HEIGHT, reduced, rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import read_radiance
from anyprobe_train.evaluate.methods import Method
from anyprobe_train.evaluate.metrics import direction_error_deg
from research.compare.figures import ldr_scores, sphere_scores
from research.real_photos.folders import LIGHTS

COLUMNS = ("photo", "mask", "map", "lamp", "fov_deg", "gain", "kind", "object")
MAP_NEEDS = ("photo", "mask", "map", "fov_deg", "gain", "kind")
LAMP_NEEDS = ("photo", "mask", "lamp", "kind")
KINDS = ("specular", "diffuse")


@dataclass(frozen=True, kw_only=True, slots=True)
class RealPair:
    """A photo's crop [128, 128, 4] and the measured map [64, 128, 3] in the crop's frame and exposure."""

    name: str
    kind: str
    crop: np.ndarray
    tan_half: float
    radiance: np.ndarray


def read_real(folder: Path) -> list[dict[str, str]]:
    """Rows of manifest.csv, checked: a map or a lamp, every file there, numbers positive, kinds known.

    Raises:
        InputError: with the row's number and what was expected.
    """
    if (folder / LIGHTS).is_file():
        with (folder / LIGHTS).open(newline="", encoding="utf-8-sig") as stream:
            rows = [_light_row(row) for row in csv.DictReader(stream)]
        for number, row in enumerate(rows, 2):
            _check(row, folder, f"{folder / LIGHTS} line {number}")
        return rows
    path = folder / "manifest.csv"
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path}: expected a table with the columns {', '.join(COLUMNS)}, found none readable"
        ) from error
    if not rows:
        raise InputError(f"{path}: expected a row for each photo, got an empty table")
    lamps: set[str] = set()
    for number, row in enumerate(rows, 2):
        place = f"{path} line {number}"
        _check(row, folder, place)
        if row.get("lamp"):
            if row["photo"] in lamps:
                raise InputError(f"{place}: expected one lamp a photo, got another for {row['photo']}")
            lamps.add(row["photo"])
    return rows


def _light_row(row: Mapping[str, str]) -> dict[str, str]:
    """A row of lights.csv as manifest.csv has it."""
    lamp = " ".join(row.get(axis, "") for axis in "xyz")
    same = {name: row.get(name, "") for name in ("mask", "object")}
    return {"photo": row.get("file", ""), "lamp": lamp, "kind": KINDS[1], **same}


def load_real(folder: Path, rows: Iterable[Mapping[str, str]]) -> Iterator[RealPair]:
    """The photos of the rows that have a map, cropped; the maps turned to the crop and in the photo's exposure."""
    for row in rows:
        if not row.get("map"):
            continue
        photo = load_photo(folder / row["photo"], fov_deg=float(row["fov_deg"]), mask=folder / row["mask"])
        crop, frame = crop_of(inputs_of(photo))
        measured = read_radiance(folder / row["map"]) * float(row["gain"])
        yield RealPair(
            name=row["photo"],
            kind=row["kind"],
            crop=crop,
            tan_half=frame[3, 0],
            radiance=reduced(rotate(_fit(measured), frame[:3].T), MAP_HEIGHT).astype(np.float32),
        )


def score_real(pairs: Iterable[RealPair], methods: Mapping[str, Method]) -> dict[str, dict]:
    """Group ("specular", "diffuse") -> {"pairs", "rows"}, as fig13.json has them."""
    scores: dict[str, dict[str, list[dict[str, float]]]] = {}
    for pair in pairs:
        true_ldr = response(pair.radiance)
        true_light = find_dominant_light(pair.radiance).direction
        estimates = {name: method(pair) for name, method in methods.items()}
        for name, one in estimates.items():
            row = sphere_scores(one.ldr, true_ldr) | ldr_scores(one.ldr, true_ldr)
            if one.radiance is not None:
                row["dominant_light_deg"] = direction_error_deg(find_dominant_light(one.radiance).direction, true_light)
            scores.setdefault(pair.kind, {}).setdefault(name, []).append(row)
    counts = {kind: max(map(len, by_method.values())) for kind, by_method in scores.items()}
    return {
        kind: {
            "pairs": counts[kind],
            "rows": [
                {"method": name} | {key: round(float(np.mean([row[key] for row in rows])), 5) for key in rows[0]}
                for name, rows in by_method.items()
                if len(rows) == counts[kind]
            ],
        }
        for kind, by_method in scores.items()
    }


def _check(row: Mapping[str, str], folder: Path, place: str) -> None:
    """One row of the manifest: a map with its field of view and gain, or a lamp."""
    has_map, has_lamp = bool(row.get("map")), bool(row.get("lamp"))
    if has_map == has_lamp:
        raise InputError(f"{place}: expected a map or a lamp, got {'both' if has_map else 'neither'}")
    missing = [name for name in (MAP_NEEDS if has_map else LAMP_NEEDS) if not row.get(name)]
    if missing:
        raise InputError(f"{place}: expected a value for {', '.join(missing)}, got none")
    files = ("photo", "mask", "map") if has_map else ("photo", "mask")
    for name in files:
        if not (folder / row[name]).is_file():
            raise InputError(f"{place}: expected the file {row[name]}, found none")
    if row["kind"] not in KINDS:
        raise InputError(f"{place}: expected kind {' or '.join(KINDS)}, got {row['kind']!r}")
    for name in ("fov_deg", "gain") if has_map else ("fov_deg",):
        if row.get(name) and not _positive(row[name]):
            raise InputError(f"{place}: expected {name} > 0, got {row[name]!r}")
    if has_lamp and read_direction(row["lamp"]) is None:
        raise InputError(f"{place}: expected lamp as three numbers such as 0 0 1, not all zero, got {row['lamp']!r}")


def _fit(radiance: np.ndarray) -> np.ndarray:
    """A map of a multiple of 64 rows, interpolated up where it is not one."""
    rows = -(-radiance.shape[0] // MAP_HEIGHT) * MAP_HEIGHT
    if rows == radiance.shape[0]:
        return radiance
    u, v = np.meshgrid((np.arange(2 * rows) + 0.5) / (2 * rows), (np.arange(rows) + 0.5) / rows)
    return bilinear(radiance, np.stack([u, v], axis=-1).astype(np.float32))


def read_direction(text: str) -> np.ndarray | None:
    """Three numbers with spaces between them as a unit vector [3]; None where they are no direction."""
    try:
        direction = np.array([float(word) for word in text.split()])
    except ValueError:
        return None
    if direction.shape != (3,) or not np.isfinite(direction).all() or not direction.any():
        return None
    direction = direction / np.abs(direction).max()  # squares of very long or short ones would not fit
    return direction / np.linalg.norm(direction)


def _positive(text: str) -> bool:
    try:
        return 0 < float(text) < float("inf")
    except ValueError:
        return False

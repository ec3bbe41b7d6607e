"""Real photos from a folder that a user supplies: its rules, and the paper's groups of those with measured maps."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.latlong import bilinear
from anyprobe.core.response import response
from anyprobe.errors import InputError
from anyprobe.evaluate.metrics import direction_error_deg
from anyprobe.evaluate.panel import Estimate, Method, ball_scores, ldr_scores
from anyprobe.files.radiance import read_radiance
from anyprobe.infer.photo import crop_object, load_photo
from anyprobe.light.environment import MAP_HEIGHT, rotate, shrink
from anyprobe.light.main_light import find_main_light

COLUMNS = ("photo", "mask", "map", "lamp", "fov_deg", "gain", "kind", "normals")
MAP_NEEDS = ("photo", "mask", "map", "fov_deg", "gain", "kind")
LAMP_NEEDS = ("photo", "mask", "lamp", "kind")
KINDS = ("specular", "diffuse")
NEEDS_NORMALS = ("meka",)
"""Methods that are told true normals: they are scored where a photo has them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RealPair:
    """A photo's crop [128, 128, 4] and the measured map [64, 128, 3] in the crop's frame and exposure.

    normals: [128, 128, 3] measured ones in the crop's frame, zero where unknown; None where the folder has none.
    """

    name: str
    kind: str
    crop: np.ndarray
    tan_half: float
    radiance: np.ndarray
    normals: np.ndarray | None = None


def read_real(folder: Path) -> list[dict[str, str]]:
    """Rows of manifest.csv, checked: a map or a lamp, every file there, numbers positive, kinds known.

    Raises:
        InputError: with the row's number and what was expected.
    """
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


def load_real(folder: Path, rows: Iterable[Mapping[str, str]]) -> Iterator[RealPair]:
    """The photos of the rows that have a map, cropped; the maps turned to the crop and in the photo's exposure."""
    for row in rows:
        if not row.get("map"):
            continue
        normals = folder / row["normals"] if row.get("normals") else None
        photo = load_photo(
            folder / row["photo"],
            fov_deg=float(row["fov_deg"]),
            mask=folder / row["mask"],
            normals=normals,
        )
        crop = crop_object(photo)
        measured = read_radiance(folder / row["map"]) * float(row["gain"])
        yield RealPair(
            name=row["photo"],
            kind=row["kind"],
            crop=crop.image,
            tan_half=crop.tan_half,
            radiance=shrink(rotate(_fit(measured), crop.camera_from_crop.T), MAP_HEIGHT).astype(np.float32),
            normals=None if crop.normals is None else crop.normals.repeat(2, axis=0).repeat(2, axis=1),
        )


def score_real(
    pairs: Iterable[RealPair],
    methods: Mapping[str, Method],
    watch: Callable[[RealPair, dict[str, Estimate]], None] | None = None,
) -> dict[str, dict]:
    """Group ("specular", "diffuse") -> {"pairs", "rows"}, as fig13.json has them.

    A method of NEEDS_NORMALS has a row in the groups all of whose photos have normals. watch sees each pair with its
    estimates as it is done.
    """
    scores: dict[str, dict[str, list[dict[str, float]]]] = {}
    for pair in pairs:
        true_ldr = response(pair.radiance)
        true_light = find_main_light(pair.radiance).direction
        estimates = {name: method(pair) for name, method in methods.items() if can_see(name, pair)}
        if watch is not None:
            watch(pair, estimates)
        for name, one in estimates.items():
            row = ball_scores(one.ldr, true_ldr) | ldr_scores(one.ldr, true_ldr)
            if one.radiance is not None:
                row["main_light_deg"] = direction_error_deg(
                    find_main_light(one.radiance).direction, true_light
                )
            scores.setdefault(pair.kind, {}).setdefault(name, []).append(row)
    counts = {kind: max(map(len, by_method.values())) for kind, by_method in scores.items()}
    return {
        kind: {
            "pairs": counts[kind],
            "rows": [
                {"design": name}
                | {key: round(float(np.mean([row[key] for row in rows])), 5) for key in rows[0]}
                for name, rows in by_method.items()
                if len(rows) == counts[kind]
            ],
        }
        for kind, by_method in scores.items()
    }


def can_see(name: str, photo) -> bool:
    """Whether a real photo has what a method must be told."""
    return name not in NEEDS_NORMALS or getattr(photo, "normals", None) is not None


def _check(row: Mapping[str, str], folder: Path, place: str) -> None:
    """One row of the manifest: a map with its field of view and gain, or a lamp."""
    has_map, has_lamp = bool(row.get("map")), bool(row.get("lamp"))
    if has_map == has_lamp:
        raise InputError(f"{place}: expected a map or a lamp, got {'both' if has_map else 'neither'}")
    missing = [name for name in (MAP_NEEDS if has_map else LAMP_NEEDS) if not row.get(name)]
    if missing:
        raise InputError(f"{place}: expected a value for {', '.join(missing)}, got none")
    files = ("photo", "mask", "map") if has_map else ("photo", "mask")
    for name in (*files, *(["normals"] if row.get("normals") else [])):
        if not (folder / row[name]).is_file():
            raise InputError(f"{place}: expected the file {row[name]}, found none")
    if row["kind"] not in KINDS:
        raise InputError(f"{place}: expected kind {' or '.join(KINDS)}, got {row['kind']!r}")
    for name in ("fov_deg", "gain") if has_map else ("fov_deg",):
        if row.get(name) and not _positive(row[name]):
            raise InputError(f"{place}: expected {name} > 0, got {row[name]!r}")
    if has_lamp and read_direction(row["lamp"]) is None:
        raise InputError(
            f"{place}: expected lamp as three numbers such as 0 0 1, not all zero, got {row['lamp']!r}"
        )


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

"""The available maps and shapes: reading them, and their licences in the manifest.csv beside them."""

import csv
import hashlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import bilinear, pixel_solid_angles
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.files.objects import MESH_SUFFIXES, read_mesh
from anyprobe.files.paths import visible_files
from anyprobe.light.environment import reduced
from anyprobe.maps.radiance import read_radiance
from anyprobe.render.mesh import Mesh

MAP_ROWS = 256
"""Rows of a map in memory; larger ones are averaged down."""

DARKEST = 1e-8
"""Mean luminance below which a map counts as black."""

MAP_SUFFIXES = (".exr", ".hdr")

Report = Callable[[str], None]
Asset = TypeVar("Asset", "MapAsset", "ShapeAsset")

_OPEN = re.compile(
    r"cc ?0\b|creative commons zero\b|public domain\b|own\b"
    r"|(cc by|(cc|creative commons) attribution)( licence)?(?= v?\d|[;,(]|$)"
    r"|(the )?mit( licence| repository)?$"
    r"|apache( licence)?,?( version)? 2(\.0)?( licence)?$"
    r"|0bsd\b|bsd (style|\d)\b"
)
"""Beginnings of licences that allow commercial use; whole texts where more words could refer to something else."""
_CLOSED = re.compile(
    r"commercial|\b(nc|nd|sa)\b|no ?deriv|share ?alike|resale|\b(not|only|unknown|unclear|probably)\b|\?"
    r"|\b(research|academic|educational|editorial|personal|private) (use|purpose)|examples licence"
)
"""Words that withdraw or qualify a licence, anywhere in its text."""


def allows_commercial_use(licence: str) -> bool:
    """Return whether shipped weights may learn from an asset under this licence text.

    CC0, public domain, CC BY, MIT, Apache, BSD, by their short, long and SPDX names. Anything unclear is
    refused, as are files whose repository is open but whose own origin is not stated.
    """
    text = re.sub(r"[\s_\u2010-\u2015-]+", " ", licence.casefold()).strip().replace("license", "licence")
    return bool(_OPEN.match(text)) and not _CLOSED.search(text)


@dataclass(frozen=True, kw_only=True, slots=True)
class MapAsset:
    """A real map: radiance [256, 512, 3], mean luminance 1 over the sphere; id as of file_id.

    lifted: whether its light above white was made up, as of a map that had 8 bits; category: both as the manifest says.
    """

    name: str
    id: str
    licence: str
    indoor: bool
    radiance: np.ndarray
    lifted: bool = False
    category: str = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class ShapeAsset:
    """A shape in the unit sphere, +Y up; id as of file_id."""

    name: str
    id: str
    licence: str
    mesh: Mesh


def file_id(path: str | Path) -> str:
    """Return the first 8 hex digits of SHA-256 of the file's bytes: the same asset under any name."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:8]


def load_maps(folder: Path, *, commercial_only: bool = False, report: Report | None = None) -> list[MapAsset]:
    """Load every map of a folder, normalised; `category` of the manifest says indoor or outdoor.

    Args:
        commercial_only: leave out what allows_commercial_use refuses.
        report: called with one line for each file that cannot be used, and for those left out;
            the others go on. Without it the first bad file raises.
    Raises:
        InputError: no folder, a damaged manifest, or no file that can be used.
    """

    def load(path: Path, row: dict[str, str]) -> MapAsset:
        radiance = read_radiance(path)
        mean = mean_luminance(radiance)
        if not DARKEST <= mean < np.inf:
            raise InvalidEnvironment(
                f"expected light, got a mean luminance of {mean:.2g}; export it again", source=path.name
            )
        return MapAsset(
            name=path.stem,
            id=file_id(path),
            licence=row["licence"],
            indoor=row.get("category", "") in ("indoor", "studio"),
            radiance=normalize_map(_fit(radiance)),
            lifted=row.get("lifted", "0") == "1",
            category=row.get("category", ""),
        )

    return _load(Path(folder), MAP_SUFFIXES, load, commercial_only, report)


def load_shapes(folder: Path, *, commercial_only: bool = False, report: Report | None = None) -> list[ShapeAsset]:
    """Load every mesh of a folder; arguments and errors as in load_maps."""

    def load(path: Path, row: dict[str, str]) -> ShapeAsset:
        return ShapeAsset(name=path.stem, id=file_id(path), licence=row["licence"], mesh=read_mesh(path))

    return _load(Path(folder), MESH_SUFFIXES, load, commercial_only, report)


def normalize_map(radiance: np.ndarray) -> np.ndarray:
    """Scale a map to mean luminance 1 over the sphere; maps have no scale of their own."""
    return np.asarray(radiance / max(mean_luminance(radiance), DARKEST), dtype=np.float32)


def mean_luminance(radiance: np.ndarray) -> float:
    """Return the mean luminance over the sphere; infinite where float32 overflows."""
    weights = pixel_solid_angles(radiance.shape[0])
    with np.errstate(over="ignore"):
        return (luminance(radiance) * weights).sum() / (4 * np.pi)


def _fit(radiance: np.ndarray) -> np.ndarray:
    """Bring a map to MAP_ROWS rows; a height that is no multiple of it is interpolated up to one first."""
    height = radiance.shape[0]
    multiple = -(-height // MAP_ROWS) * MAP_ROWS
    if multiple != height:
        v, u = ((np.arange(n, dtype=np.float32) + 0.5) / n for n in (multiple, 2 * multiple))
        bands = [np.stack(np.meshgrid(u, rows), axis=-1) for rows in np.split(v, MAP_ROWS // 8)]
        radiance = np.concatenate([bilinear(radiance, uv) for uv in bands])
    return reduced(radiance, MAP_ROWS)


def _load(
    folder: Path,
    suffixes: tuple[str, ...],
    load: Callable[[Path, dict[str, str]], Asset],
    commercial_only: bool,
    report: Report | None,
) -> list[Asset]:
    """Load the usable files and report the rest."""
    assets: list[Asset] = []
    num_bad = num_refused = 0
    for path, row in listed_rows(folder, suffixes):
        try:
            if commercial_only and not allows_commercial_use(row["licence"]):
                num_refused += 1
                continue
            assets.append(load(path, row))
        except InputError as error:
            if report is None:
                raise
            report(" ".join(str(error).splitlines()))
            num_bad += 1
    if num_bad and not assets:
        raise InputError(
            f"expected usable {'/'.join(suffixes)} files, got {num_bad} unusable ones; see the lines above",
            source=folder,
        )
    if num_refused and report is not None:
        report(
            f"{folder}: {num_refused} files left out, as their licence does not allow commercial use "
            "or is not stated in manifest.csv"
        )
    return assets


def listed_rows(folder: Path, suffixes: tuple[str, ...]) -> Iterator[tuple[Path, dict[str, str]]]:
    """Yield each file of the folder with its row of the manifest (the folder's own or its parent's)."""
    if not folder.is_dir():
        raise InputError(f"expected a folder of {'/'.join(suffixes)} files, found none; check the path", source=folder)
    files = {path.name for path in visible_files(folder, suffixes)}
    place = folder.resolve()
    rows: dict[str, dict[str, str]] = {}
    for home in (place, place.parent):
        for row in read_table(home / "manifest.csv")[1]:
            listed = Path(row["file"])
            folders = (row.get("split", ""), listed.parent.name if home != place else "")
            if any(name not in ("", place.name) for name in folders):
                continue
            ours = home == place or place.name in folders  # a parent's row without either may be anybody's
            if listed.name in files or (ours and listed.name):
                rows.setdefault(listed.name, row)
    if not files | set(rows):
        raise InputError(f"expected {'/'.join(suffixes)} files, found none; check the path", source=folder)
    for name in sorted(files | set(rows)):
        yield folder / name, {"licence": "not stated"} | rows.get(name, {})


Row = dict[str, str]


def read_table(path: Path) -> tuple[list[str], list[Row]]:
    """Read the columns and rows of a manifest.csv; none if there is no file. Fields missing in short rows are empty.

    InputError: no table in UTF-8 with the column file.
    """
    if not path.is_file():
        return [], []
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:  # spreadsheets put a mark before
            reader = csv.DictReader(stream)
            rows = [{key: value or "" for key, value in row.items() if key} for row in reader]
            columns = [name for name in reader.fieldnames or [] if name]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"expected a table in UTF-8, got a damaged file ({error}); repair it", source=path) from error
    if "file" not in columns:
        raise InputError("expected a table with the column file, got none; add it, or move the table away", source=path)
    return columns, rows

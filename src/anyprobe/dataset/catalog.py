"""Which maps and shapes there are, whose they are, and how they are read."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.core.color import luminance
from anyprobe.core.latlong import pixel_solid_angles
from anyprobe.errors import InputError
from anyprobe.files.meshes import read_mesh
from anyprobe.files.radiance import read_radiance
from anyprobe.light.environment import shrink
from anyprobe.render.mesh import Mesh

MAP_ROWS = 256
"""Rows of a map in memory; larger ones are averaged down."""

_OPEN = re.compile(
    r"^(CC0|public domain|CC BY \d|CC BY$|MIT$|MIT repository$|Apache-2\.0$|BSD-style|BSD-\d|own\b)",
    re.IGNORECASE,
)
_CLOSED = re.compile(
    r"not stated|unknown|non-commercial|no commercial|BY-NC|BY-SA|examples licen[cs]e", re.IGNORECASE
)


def allows_commercial_use(licence: str) -> bool:
    """Whether shipped weights may learn from an asset under this licence text.

    CC0, public domain, CC BY, MIT, Apache, BSD. Anything unclear is refused, as are
    files whose repository is open but whose own origin is not stated.
    """
    return bool(_OPEN.match(licence.strip())) and not _CLOSED.search(licence)


@dataclass(frozen=True, kw_only=True, slots=True)
class MapAsset:
    """A real map: radiance [256, 512, 3], mean luminance 1 over the sphere."""

    name: str
    indoor: bool
    radiance: np.ndarray


@dataclass(frozen=True, kw_only=True, slots=True)
class ShapeAsset:
    """A shape in the unit sphere, +Y up."""

    name: str
    mesh: Mesh


def _rows(folder: Path, suffixes: tuple[str, ...]) -> list[dict[str, str]]:
    """Rows of the folder's manifest (its own or its parent's), else one per file."""
    if not folder.is_dir():
        raise InputError(
            f"{folder}: expected a folder of {'/'.join(suffixes)} files, found none; check the path"
        )
    files = {path.name: path for path in sorted(folder.iterdir()) if path.suffix.lower() in suffixes}
    if not files:
        raise InputError(f"{folder}: expected {'/'.join(suffixes)} files, found none; check the path")
    rows = {}
    for manifest in (folder / "manifest.csv", folder.parent / "manifest.csv"):
        if manifest.is_file():
            with manifest.open(newline="", encoding="utf-8") as stream:
                for row in csv.DictReader(stream):
                    name = Path(row["file"]).name
                    if name in files and row.get("split", folder.name) in ("", folder.name):
                        rows.setdefault(name, row)
    return [
        {"licence": "not stated", **rows.get(name, {}), "path": str(path)} for name, path in files.items()
    ]


def load_maps(folder: Path, *, commercial_only: bool = False) -> list[MapAsset]:
    """Every map of a folder, normalised; `category` of the manifest says indoor or outdoor."""
    assets = []
    for row in _rows(Path(folder), (".exr", ".hdr")):
        if commercial_only and not allows_commercial_use(row["licence"]):
            continue
        radiance = read_radiance(row["path"])
        if radiance.shape[0] > MAP_ROWS and radiance.shape[0] % MAP_ROWS == 0:
            radiance = shrink(radiance, MAP_ROWS)
        indoor = row.get("category", "") in ("indoor", "studio")
        assets.append(MapAsset(name=Path(row["path"]).stem, indoor=indoor, radiance=normalize_map(radiance)))
    return assets


def normalize_map(radiance: np.ndarray) -> np.ndarray:
    """Scale a map to mean luminance 1 over the sphere; maps have no scale of their own."""
    weights = pixel_solid_angles(radiance.shape[0])
    mean = (luminance(radiance) * weights).sum() / (4 * np.pi)
    return np.asarray(radiance / max(mean, 1e-8), dtype=np.float32)


def load_shapes(folder: Path, *, commercial_only: bool = False) -> list[ShapeAsset]:
    """Every mesh of a folder."""
    assets = []
    for row in _rows(Path(folder), (".ply", ".obj", ".glb", ".stl")):
        if commercial_only and not allows_commercial_use(row["licence"]):
            continue
        assets.append(ShapeAsset(name=Path(row["path"]).stem, mesh=read_mesh(row["path"])))
    return assets

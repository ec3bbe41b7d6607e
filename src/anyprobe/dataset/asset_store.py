"""The maps and shapes that recipes name: real ones from a folder, and procedural ones."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np

from anyprobe.dataset.catalog import (
    MAP_SUFFIXES,
    MESH_SUFFIXES,
    Asset,
    MapAsset,
    ShapeAsset,
    allows_commercial_use,
    file_id,
    listed_rows,
    load_maps,
    load_shapes,
)
from anyprobe.dataset.room import room
from anyprobe.dataset.sky import sky, studio
from anyprobe.errors import InputError
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS
from anyprobe.render.shapes import draw_shape


def draw_map(rng: np.random.Generator, height: int = 256) -> tuple[np.ndarray, bool]:
    """One map of a random family and whether it is indoor."""
    kind = rng.integers(3)
    return [sky, room, studio][kind](rng, height), bool(kind > 0)


PROCEDURAL_VERSION = 2
"""Raised whenever the generators give other maps or shapes for the same seed."""


class AssetStore:
    """Maps and shapes by their eight-digit ids."""

    def __init__(self, maps: Iterable[MapAsset], shapes: Iterable[ShapeAsset] = ()) -> None:
        self.maps = {asset.id: asset for asset in maps}
        self.shapes = {asset.id: asset for asset in shapes}
        self.pyramid = lru_cache(maxsize=64)(self._pyramid)

    def _pyramid(self, map_id: str) -> Pyramid:
        return build_pyramid(self.map(map_id).radiance, emitters=NUM_EMITTERS)

    def map(self, map_id: str) -> MapAsset:
        """The map of that id, or InputError."""
        return _named("map", map_id, self.maps)

    def shape(self, shape_id: str) -> ShapeAsset:
        """The shape of that id, or InputError."""
        return _named("shape", shape_id, self.shapes)


def _named(what: str, key: str, known: dict[str, Asset]) -> Asset:
    if key not in known:
        raise InputError(
            f"{what} {key}: expected one of the {len(known)} {what}s given, got another; "
            "give the folder that the recipe was made from"
        )
    return known[key]


def _own_id(what: str, seed: int, index: int) -> str:
    return hashlib.sha256(f"{what} {PROCEDURAL_VERSION} {seed} {index}".encode()).hexdigest()[:8]


def own_map(seed: int, index: int) -> MapAsset:
    """Procedural map number index of a seed."""
    radiance, indoor = draw_map(np.random.default_rng((seed, 1, index)))
    return MapAsset(
        id=_own_id("map", seed, index), name=f"own-map-{seed}-{index}", licence="own", indoor=indoor, radiance=radiance
    )


def own_shape(seed: int, index: int) -> ShapeAsset:
    """Procedural shape number index of a seed."""
    return ShapeAsset(
        id=_own_id("shape", seed, index),
        name=f"own-shape-{seed}-{index}",
        licence="own",
        mesh=draw_shape(np.random.default_rng((seed, 2, index))),
    )


def load_asset_store(
    data: Path | None,
    split: str,
    *,
    commercial_only: bool = True,
    extra: bool = True,
    procedural_maps: int = 0,
    procedural_shapes: int = 0,
    with_shapes: bool = True,
    seed: int = 5,
    report: Callable[[str], None] | None = None,
) -> AssetStore:
    """Assets of data/{hdri,meshes}/<split>, with `extra` those of hdri/train_extra too, and so many of our own.

    Where shapes are not asked for, data has to have none. Without data everything is our own; test assets are then
    drawn from another seed.
    """
    maps: list[MapAsset] = []
    shapes: list[ShapeAsset] = []
    if data is not None:
        folders = [data / "hdri" / split]
        if extra and split == "train" and (data / "hdri" / "train_extra").is_dir():
            folders.append(data / "hdri" / "train_extra")
        for folder in folders:
            maps += load_maps(folder, commercial_only=commercial_only, report=report)
        if with_shapes:
            shapes = load_shapes(data / "meshes" / split, commercial_only=commercial_only, report=report)
    own_seed = seed if split == "train" else seed + 1_000_000
    maps += [own_map(own_seed, index) for index in range(procedural_maps)]
    shapes += [own_shape(own_seed, index) for index in range(procedural_shapes)]
    return AssetStore(maps, shapes)


def load_left_out(data: Path) -> AssetStore:
    """The training assets whose licence keeps shipped weights from learning of them: to choose by, not to learn from.

    Maps with made-up light sources are not among them: choosing by them would favour the same invention.

    Raises:
        InputError: there are none.
    """
    everything, learned = (load_asset_store(data, "train", commercial_only=only) for only in (False, True))
    maps = [asset for key, asset in everything.maps.items() if key not in learned.maps and not asset.lifted]
    shapes = [asset for key, asset in everything.shapes.items() if key not in learned.shapes]
    if not maps or not shapes:
        raise InputError(
            f"{data}: expected maps and shapes that shipped weights do not learn from, "
            f"got {len(maps)} maps and {len(shapes)} shapes; leave the calibration out"
        )
    return AssetStore(maps, shapes)


FOLDERS = {
    "hdri/train": ("Maps", MAP_SUFFIXES),
    "hdri/train_extra": ("Maps", MAP_SUFFIXES),
    "meshes/train": ("Shapes", MESH_SUFFIXES),
}
"""Those of load_asset_store, what they hold, and in which files."""

NOT_STATED = "not stated"

PAGE = """\
# Assets that weights learned from

The {count} files of a data folder that training takes, as the folder's manifests state them; written by
`anyprobe data assets`. A file whose licence forbids commercial use, or is not clear, is not taken
(`anyprobe.dataset.catalog.allows_commercial_use`). None of these files is in the package: networks learned from
pictures made of them, with maps turned, blended and relit, and shapes turned, mirrored, drawn out, bent and joined.
[CC BY 3.0](https://creativecommons.org/licenses/by/3.0/) and
[4.0](https://creativecommons.org/licenses/by/4.0/) ask to name the author, as MIT, BSD and Apache licences do.

Beside these, training draws maps and shapes of anyprobe's own from seeds (`anyprobe.dataset.sky`,
`anyprobe.dataset.room`, `anyprobe.render.shapes`): they have no files, and are anyprobe's, Apache-2.0.
"""

_NAMES_NOBODY = re.compile(r"cc[\s_-]?0\b|creative commons zero\b|public domain\b|own\b", re.IGNORECASE)


def asset_page(data: Path, report: Callable[[str], None] | None = None) -> str:
    """The page, in Markdown, of all that load_asset_store takes of a data folder for weights that ship.

    Args:
        report: as of load_asset_store.
    Raises:
        InputError: as load_asset_store.
    """
    store = load_asset_store(data, "train", commercial_only=True, report=report)
    taken = {*store.maps, *store.shapes}
    tables = {name: list(_credits(data / name, suffixes, taken)) for name, (_, suffixes) in FOLDERS.items()}
    parts = [PAGE.format(count=sum(map(len, tables.values())))]
    for name, credits in tables.items():
        if credits:
            parts.append(f"## {FOLDERS[name][0]} of `{name}`: {len(credits)}\n\n{_table(credits)}")
    return "\n".join(parts)


CREDIT = ("file", "name", "source", "licence", "author")
"""Of a file; author: as its licence asks to be named, else empty."""


def _credits(folder: Path, suffixes: tuple[str, ...], taken: set[str]) -> Iterator[tuple[str, ...]]:
    """CREDIT of the files of a folder whose ids are among those taken, by name."""
    for path, row in listed_rows(folder, suffixes, ()) if folder.is_dir() else ():
        if allows_commercial_use(row["licence"]) and path.is_file() and file_id(path) in taken:
            name = row.get("name") or row.get("slug") or path.stem
            yield path.name, name, _source(row), row["licence"], _author(row)


def _source(row: dict[str, str]) -> str:
    """Repository and path, else an address."""
    stated = ": ".join(row[key] for key in ("source_repo", "source_path") if row.get(key))
    return stated or row.get("source") or row.get("url") or NOT_STATED


def _author(row: dict[str, str]) -> str:
    """Of a column of its own, else what follows the licence's name, as in "CC BY 4.0; Jane Doe"."""
    if _NAMES_NOBODY.match(row["licence"].strip()):
        return ""
    _, *rest = re.split(r"[;(]", row["licence"], maxsplit=1)
    return row.get("authors") or row.get("author") or "".join(rest).strip(" )") or NOT_STATED


def _table(credits: list[tuple[str, ...]]) -> str:
    rows = [CREDIT, ["---"] * len(CREDIT), *credits]
    cells = ([" ".join(text.replace("|", "\\|").split()) for text in row] for row in rows)
    return "".join(f"| {' | '.join(row)} |\n" for row in cells)

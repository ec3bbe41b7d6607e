"""Maps, procedural places and covers, prepared once in a folder and shared by all processes through its files."""

import re
from collections import Counter
from dataclasses import dataclass
from itertools import cycle, islice
from pathlib import Path

import numpy as np

from anyprobe_train.dataset.catalog import MAP_ROWS, allows_commercial_use, load_maps
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import sky, studio
from anyprobe_train.world.covers import draw_cover
from anyprobe_train.world.kept import kept

PLACES = 96
"""Procedural places kept; each is seen turned, mirrored and with other lamps."""
PLACE_ROWS = 128
COVERS = 96
COVER_PX = 128
OUTDOORS = {"outdoor": 1.0, "indoor": 0.0, "studio": 0.0}
MAP = np.dtype([("radiance", "f4", (MAP_ROWS, 2 * MAP_ROWS, 3)), ("outdoors", "f4"), ("name", "U255")])
PLACE = np.dtype([("radiance", "f4", (PLACE_ROWS, 2 * PLACE_ROWS, 3)), ("outdoors", "f4")])
COVER = np.dtype(
    [("albedo", "f4", (COVER_PX, COVER_PX, 3)), ("alpha", "f4"), ("side", "f4"), ("plain", "?")], align=True
)
"""Rows of the files that are kept: of real maps, procedural places and covers, whose floats lie aligned."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Maps:
    """Light and surfaces to draw from.

    real: [M, 256, 512, 3] of mean luminance 1; outdoors: [M] 1, 0 or NaN; weights: [M] of all of them, grounds: [M] of
    those that have a ground. places: [K] PLACE. covers: [C] COVER.
    """

    names: tuple[str, ...]
    real: np.ndarray
    outdoors: np.ndarray
    weights: np.ndarray
    grounds: np.ndarray
    places: np.ndarray
    covers: np.ndarray


def open_maps(data: Path, cache: Path, part: str) -> Maps:
    """Open what is drawn from; a part is "train", or "left-out": maps that shipped weights may not learn from.

    Maps made from 8 bits are in no part: their light sources are invented.
    """
    real = kept(cache / f"maps-{part}.npy", lambda: _real(data, part))
    names = tuple(real["name"].tolist())
    series = [re.sub(r"[_\d]+[a-z]?$", "", name) for name in names]
    sizes = Counter(series)
    weights = np.array([sizes[one] ** -0.6 for one in series])
    has_ground = np.array([not re.search("puresky|skyhdri", name) for name in names])
    return Maps(
        names=names,
        real=real["radiance"],
        outdoors=real["outdoors"],
        weights=weights / weights.sum(),
        grounds=weights * has_ground / (weights * has_ground).sum(),
        places=kept(cache / "places-1.npy", _places),
        covers=kept(cache / "covers-1.npy", _covers),
    )


def _real(data: Path, part: str) -> np.ndarray:
    folders = [folder for folder in (data / "hdri" / "train", data / "hdri" / "train_extra") if folder.is_dir()]
    measured = [one for folder in folders for one in load_maps(folder) if not one.lifted]
    unique = {one.id: one for one in measured if allows_commercial_use(one.licence) == (part == "train")}
    chosen = sorted(unique.values(), key=lambda one: one.name)
    return np.array([(one.radiance, OUTDOORS.get(one.category, np.nan), one.name) for one in chosen], MAP)


def _places() -> np.ndarray:
    kinds = [(room, 0.0), (room, 0.0), (sky, 1.0), (studio, np.nan)]
    rng = np.random.default_rng(20)
    return np.array([(make(rng, PLACE_ROWS), known) for make, known in islice(cycle(kinds), PLACES)], PLACE)


def _covers() -> np.ndarray:
    rng = np.random.default_rng(21)
    drawn = [draw_cover(rng, "plain" if k % 3 == 0 else None) for k in range(COVERS)]
    size = len(drawn[0].albedo) // COVER_PX
    small = [one.albedo.reshape(COVER_PX, size, COVER_PX, size, 3).mean(axis=(1, 3)) for one in drawn]
    rest = ((one.alpha, one.side, one.kind == "plain") for one in drawn)
    return np.array([(albedo, *more) for albedo, more in zip(small, rest, strict=True)], COVER)

"""Maps, procedural places and covers, prepared once in a folder and shared by all processes through its files."""

import fcntl
import json
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from anyprobe.files.atomic import atomic_path
from anyprobe_train.dataset.catalog import allows_commercial_use, load_maps
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import sky, studio
from anyprobe_train.world.covers import draw_cover

PLACES = 96
"""Procedural places kept; each is seen turned, mirrored and with other lamps."""
PLACE_ROWS = 128
COVERS = 96
COVER_PX = 128
OUTDOORS = {"outdoor": 1.0, "indoor": 0.0, "studio": 0.0}


@dataclass(frozen=True, kw_only=True, slots=True)
class Maps:
    """Light and surfaces to draw from.

    real: [M, 256, 512, 3] of mean luminance 1; outdoors: [M] 1, 0 or NaN; weights: [M] of all of them, grounds: [M] of
    those that have a ground. places: "places" [K, 128, 256, 3] and "outdoors" [K]. covers: "albedo" [C, T, T, 3],
    "alpha", "side" and "plain" [C].
    """

    names: tuple[str, ...]
    real: np.ndarray
    outdoors: np.ndarray
    weights: np.ndarray
    grounds: np.ndarray
    places: dict[str, np.ndarray]
    covers: dict[str, np.ndarray]


def open_maps(data: Path, cache: Path, part: str) -> Maps:
    """Open what is drawn from; a part is "train", or "left-out": maps that shipped weights may not learn from.

    Maps made from 8 bits are in no part: their light sources are invented.
    """
    real = _kept(cache, f"maps-{part}", lambda: _real(data, part))
    names = tuple(json.loads(str(real["names"])))
    series = [re.sub(r"[_\d]+[a-z]?$", "", name) for name in names]
    sizes = Counter(series)
    weights = np.array([sizes[one] ** -0.6 for one in series])
    has_ground = np.array([not re.search("puresky|skyhdri", name) for name in names])
    return Maps(
        names=names,
        real=real["real"],
        outdoors=real["outdoors"],
        weights=weights / weights.sum(),
        grounds=weights * has_ground / (weights * has_ground).sum(),
        places=_kept(cache, "places-1", _places),
        covers=_kept(cache, "covers-1", _covers),
    )


def _kept(cache: Path, name: str, make: Callable[[], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return arrays of a folder, made if it is missing; large ones stay on disk."""
    folder = cache / name
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "done").is_file():
            for key, values in make().items():
                with atomic_path(folder / f"{key}.npy") as temporary, open(temporary, "wb") as stream:
                    np.save(stream, values)
            (folder / "done").touch()
    return {path.stem: np.load(path, mmap_mode="r") for path in sorted(folder.glob("*.npy"))}


def _real(data: Path, part: str) -> dict[str, np.ndarray]:
    folders = [folder for folder in (data / "hdri" / "train", data / "hdri" / "train_extra") if folder.is_dir()]
    measured = [one for folder in folders for one in load_maps(folder) if not one.lifted]
    unique = {one.id: one for one in measured if allows_commercial_use(one.licence) == (part == "train")}
    chosen = sorted(unique.values(), key=lambda one: one.name)
    return {
        "real": np.stack([one.radiance for one in chosen]),
        "names": np.array(json.dumps([one.name for one in chosen])),
        "outdoors": np.array([OUTDOORS.get(one.category, np.nan) for one in chosen], np.float32),
    }


def _places() -> dict[str, np.ndarray]:
    kinds = [(room, 0.0), (room, 0.0), (sky, 1.0), (studio, np.nan)]
    rng = np.random.default_rng(20)
    made = [kinds[k % 4][0](rng, PLACE_ROWS).astype(np.float32) for k in range(PLACES)]
    return {"places": np.stack(made), "outdoors": np.array([kinds[k % 4][1] for k in range(PLACES)], np.float32)}


def _covers() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(21)
    drawn = [draw_cover(rng, "plain" if k % 3 == 0 else None) for k in range(COVERS)]
    size = drawn[0].albedo.shape[0] // COVER_PX
    small = [one.albedo.reshape(COVER_PX, size, COVER_PX, size, 3).mean(axis=(1, 3)) for one in drawn]
    return {
        "albedo": np.stack(small).astype(np.float32),
        "alpha": np.array([one.alpha for one in drawn], np.float32),
        "side": np.array([one.side for one in drawn], np.float32),
        "plain": np.array([one.kind == "plain" for one in drawn]),
    }

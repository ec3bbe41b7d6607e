"""The maps and shapes that recipes name: real ones from a folder, and procedural ones."""

import hashlib
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from anyprobe.errors import InputError
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.render.integrate import NUM_EMITTERS
from anyprobe_train.dataset.catalog import Asset, MapAsset, ShapeAsset, load_maps, load_shapes
from anyprobe_train.dataset.drawn_shapes import draw_shape
from anyprobe_train.dataset.room import room
from anyprobe_train.dataset.sky import sky, studio


def draw_map(rng: np.random.Generator, height: int = 256) -> tuple[np.ndarray, bool]:
    """Draw a map of a random family; return it and whether it is indoor."""
    kind = rng.integers(3)
    return [sky, room, studio][kind](rng, height), bool(kind > 0)


PROCEDURAL_VERSION = 2
"""Version of the generators, raised whenever the same seed gives other maps or shapes."""


class AssetStore:
    """Maps and shapes by their eight-digit ids."""

    def __init__(self, maps: Iterable[MapAsset], shapes: Iterable[ShapeAsset] = ()) -> None:
        self.maps = {asset.id: asset for asset in maps}
        self.shapes = {asset.id: asset for asset in shapes}
        self.pyramid = lru_cache(maxsize=64)(self._pyramid)

    def _pyramid(self, map_id: str) -> Pyramid:
        return build_pyramid(self.map(map_id).radiance, emitters=NUM_EMITTERS)

    def map(self, map_id: str) -> MapAsset:
        """Return the map of that id, or InputError."""
        return _lookup("map", map_id, self.maps)

    def shape(self, shape_id: str) -> ShapeAsset:
        """Return the shape of that id, or InputError."""
        return _lookup("shape", shape_id, self.shapes)


def _lookup(kind: str, key: str, known: dict[str, Asset]) -> Asset:
    if key not in known:
        raise InputError(
            f"{kind} {key}: expected the id of one of the {len(known)} given {kind}s, got an unknown one; "
            "give the folder that the recipe was made from"
        )
    return known[key]


def _own(kind: str, seed: int, index: int) -> dict[str, Any]:
    digest = hashlib.sha256(f"{kind} {PROCEDURAL_VERSION} {seed} {index}".encode()).hexdigest()
    return {"id": digest[:8], "name": f"own-{kind}-{seed}-{index}", "licence": "own"}


def own_map(seed: int, index: int) -> MapAsset:
    """Generate procedural map number `index` of a seed."""
    radiance, indoor = draw_map(np.random.default_rng((seed, 1, index)))
    return MapAsset(**_own("map", seed, index), indoor=indoor, radiance=radiance)


def own_shape(seed: int, index: int) -> ShapeAsset:
    """Generate procedural shape number `index` of a seed."""
    return ShapeAsset(**_own("shape", seed, index), mesh=draw_shape(np.random.default_rng((seed, 2, index))))


def load_asset_store(
    data: Path | None,
    split: str,
    *,
    commercial_only: bool = True,
    procedural_maps: int = 0,
    procedural_shapes: int = 0,
    with_shapes: bool = True,
    seed: int = 5,
    report: Callable[[str], None] | None = None,
) -> AssetStore:
    """Load the assets of data/{hdri,meshes}/<split>, for training those of hdri/train_extra, and procedural ones.

    Where shapes are not asked for, data has to have none. Without data everything is our own; test assets are then
    drawn from another seed.
    """
    maps: list[MapAsset] = []
    shapes: list[ShapeAsset] = []
    if data is not None:
        folders = [data / "hdri" / split]
        if split == "train" and (data / "hdri" / "train_extra").is_dir():
            folders.append(data / "hdri" / "train_extra")
        for folder in folders:
            maps += load_maps(folder, commercial_only=commercial_only, report=report)
        if with_shapes:
            shapes = load_shapes(data / "meshes" / split, commercial_only=commercial_only, report=report)
    own_seed = seed if split == "train" else seed + 1_000_000
    maps += [own_map(own_seed, index) for index in range(procedural_maps)]
    shapes += [own_shape(own_seed, index) for index in range(procedural_shapes)]
    return AssetStore(maps, shapes)

"""Stock (noun): the maps and shapes that recipes name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np

from anyprobe.dataset.catalog import MapAsset, ShapeAsset, load_maps, load_shapes
from anyprobe.dataset.procedural_light import draw_map
from anyprobe.errors import InputError
from anyprobe.light.octahedral import Pyramid, build_pyramid
from anyprobe.render.integrate import NUM_LAMPS
from anyprobe.render.shapes import draw_shape

PROCEDURAL_VERSION = 2
"""Raised whenever the generators give other maps or shapes for the same seed."""


class Stock:
    """Maps and shapes by their eight-digit ids."""

    def __init__(self, maps: Iterable[MapAsset], shapes: Iterable[ShapeAsset] = ()) -> None:
        self.maps = {asset.id: asset for asset in maps}
        self.shapes = {asset.id: asset for asset in shapes}
        self.pyramid = lru_cache(maxsize=64)(self._pyramid)

    def _pyramid(self, map_id: str) -> Pyramid:
        return build_pyramid(self.map(map_id).radiance, lamps=NUM_LAMPS)

    def map(self, map_id: str) -> MapAsset:
        """The map of that id, or InputError."""
        if map_id not in self.maps:
            raise InputError(
                f"map {map_id}: expected one of the {len(self.maps)} maps given, got another; "
                "give the folder that the recipe was made from"
            )
        return self.maps[map_id]

    def shape(self, shape_id: str) -> ShapeAsset:
        """The shape of that id, or InputError."""
        if shape_id not in self.shapes:
            raise InputError(
                f"shape {shape_id}: expected one of the {len(self.shapes)} shapes given, got another; "
                "give the folder that the recipe was made from"
            )
        return self.shapes[shape_id]


def _own_id(what: str, seed: int, index: int) -> str:
    return hashlib.sha256(f"{what} {PROCEDURAL_VERSION} {seed} {index}".encode()).hexdigest()[:8]


def own_map(seed: int, index: int) -> MapAsset:
    """Procedural map number index of a seed."""
    radiance, indoor = draw_map(np.random.default_rng((seed, 1, index)))
    return MapAsset(
        id=_own_id("map", seed, index),
        name=f"own-map-{seed}-{index}",
        licence="own",
        indoor=indoor,
        radiance=radiance,
    )


def own_shape(seed: int, index: int) -> ShapeAsset:
    """Procedural shape number index of a seed."""
    return ShapeAsset(
        id=_own_id("shape", seed, index),
        name=f"own-shape-{seed}-{index}",
        licence="own",
        mesh=draw_shape(np.random.default_rng((seed, 2, index))),
    )


def load_stock(
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
) -> Stock:
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
    return Stock(maps, shapes)


def load_left_out(data: Path) -> Stock:
    """The training assets whose licence keeps shipped weights from learning of them: to choose by, not to learn from.

    Maps whose lights are made up are not among them: who chooses by them chooses what is made up alike.

    Raises:
        InputError: there are none.
    """
    everything, learned = (load_stock(data, "train", commercial_only=only) for only in (False, True))
    maps = [asset for key, asset in everything.maps.items() if key not in learned.maps and not asset.lifted]
    shapes = [asset for key, asset in everything.shapes.items() if key not in learned.shapes]
    if not maps or not shapes:
        raise InputError(
            f"{data}: expected maps and shapes that shipped weights do not learn from, "
            f"got {len(maps)} maps and {len(shapes)} shapes; leave the calibration out"
        )
    return Stock(maps, shapes)

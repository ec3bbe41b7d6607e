"""Kept pairs: rendered once, then read from a folder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from anyprobe.files.atomic import atomic_path
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.pair import Pair, Trace, render_pair
from anyprobe_train.dataset.recipe import Recipe

ARRAYS = ("photo", "irradiance", "radiance", "map_from_camera", "gain", "normals")
NAMES = ("tan_half", "map_name", "shape_name", "indoor")


def kept_pairs(
    recipes: list[Recipe], store: AssetStore, kept: Path | None = None, trace: Trace | None = None
) -> Iterator[Pair]:
    """The pairs of recipes in order; those that the folder `kept` lacks are rendered and put there.

    trace: as in render_pair; such pairs need a folder of their own.
    """
    for recipe in recipes:
        path = None if kept is None else kept / f"{recipe.to_hex()}.npz"
        if path is not None and path.is_file():
            yield read_pair(path)
            continue
        pair = render_pair(recipe, store, trace)
        if path is not None:
            write_pair(path, pair)
        yield pair


def write_pair(path: Path, pair: Pair) -> None:
    """Arrays as they are, the rest as JSON."""
    rest = {name: getattr(pair, name) for name in NAMES}
    rest |= {"recipe": pair.recipe.to_hex(), "alpha": float(pair.material.alpha)}
    with atomic_path(path) as temporary, open(temporary, "wb") as stream:
        np.savez(
            stream,
            **{name: getattr(pair, name) for name in ARRAYS},
            albedo=pair.material.albedo,
            f0=pair.material.f0,
            rest=json.dumps(rest),
        )


def read_pair(path: Path) -> Pair:
    """The pair that write_pair wrote."""
    with np.load(path, allow_pickle=False) as stored:
        rest = json.loads(str(stored["rest"]))
        material = Material(albedo=stored["albedo"], f0=stored["f0"], alpha=rest.pop("alpha"))
        recipe = Recipe.from_hex(rest.pop("recipe"))
        return Pair(recipe=recipe, material=material, **{name: stored[name] for name in ARRAYS}, **rest)

"""Lists of recipes in files, and the frozen test set among them."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np

from anyprobe.dataset.asset_store import AssetStore
from anyprobe.dataset.mask_errors import narrow, pierce, widen
from anyprobe.dataset.pair import Pair, Trace, render_pair
from anyprobe.dataset.recipe import Recipe, digest
from anyprobe.errors import InputError
from anyprobe.files.atomic import atomic_path
from anyprobe.scatter.materials import Material

ERROR_PX = 3
HOLES = 0.05
"""Share of the object that holes take."""


def noisy_mask(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A mask [S, S] bool too wide or too narrow by ERROR_PX, and pierced until HOLES of it is gone."""
    edge = widen(mask, ERROR_PX) if rng.random() < 0.5 else narrow(mask, ERROR_PX)
    if not edge.any():
        return mask
    pierced = edge
    while pierced.sum() > (1 - HOLES) * edge.sum():
        pierced = pierce(pierced, 1, rng)
    return pierced if pierced.any() else edge


def with_noisy_mask(pair: Pair) -> Pair:
    """The pair cut out so; where the mask is too wide the photo is black, as behind a pair it always is."""
    rng = np.random.default_rng(pair.recipe.seed % 2**32)
    mask = noisy_mask(pair.photo[..., 3] > 0, rng)
    photo = pair.photo.copy()
    photo[..., 3] = mask * np.uint8(255)
    photo[..., :3] *= mask[..., None]
    return replace(pair, photo=photo)


FROZEN = Path(str(resources.files("anyprobe") / "evaluate" / "frozen.txt"))
"""1,000 recipes over held-out maps and shapes; they never change."""


def read_recipes(path: str | os.PathLike[str]) -> list[Recipe]:
    """One recipe a line, the first line `# <digest>`; raises InputError if the digest is another."""
    try:
        lines = Path(path).read_text(encoding="ascii").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: expected a text file of recipes, one a line, got none readable") from error
    recipes = [Recipe.from_hex(line.strip()) for line in lines[1:] if line.strip()]
    if lines[0] != f"# {digest(recipes)}":
        raise InputError(
            f"{path}: expected the first line '# {digest(recipes)}', got {lines[0][:40]!r}; "
            "the list was edited or cut short"
        )
    return recipes


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

"""Cut-outs as `anyprobe-train evaluate` renders them, from any height of the camera, as the light network sees them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from anyprobe.estimate.ground import up_of
from anyprobe.estimate.light_graph import INPUTS, graph_inputs
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import MapAsset
from anyprobe_train.dataset.pair import Pair, fibonacci_viewpoint, render_pair
from anyprobe_train.dataset.recipe import WORLD, balanced_recipes
from anyprobe_train.light.given import Given
from anyprobe_train.light.light_views import LightViews
from research.scenes.light_pairs import ASSUMED_DEG, keep_rows, row_of_inputs
from research.scenes.parts import VariedStore, store_of

OF_A_LIGHT, IN_FILE = 8, 64
"""Pairs that share a light, and pairs in a file."""
LENS_KNOWN = 0.7
"""Share of them whose lens is said."""
CONDITIONS = (0, 1, WORLD)


def make_cut_outs(data: Path, out: Path, count: int, part: str = "train", first: int = 0) -> Iterator[Path]:
    """Render pairs of a part from number `first` on, training shapes under varied training lights, into files of
    LightBatch's fields; yield each. Files that are there stay."""
    torch.set_num_threads(1)
    store, views = store_of(data, part, out.parent / "world"), LightViews()
    for start in range(first, first + count, IN_FILE):
        path = out / f"cut_{start:06d}.npz"
        if path.is_file():
            continue
        made = []
        for number in range(start, start + IN_FILE, OF_A_LIGHT):
            rng = np.random.default_rng((number, 23))
            few = _under_one_light(store, rng) if isinstance(store, VariedStore) else store
            conditions = CONDITIONS[rng.integers(len(CONDITIONS))]
            shapes = sorted(few.shapes)
            for recipe in balanced_recipes(few, OF_A_LIGHT, seed=number, conditions=conditions):
                chosen = replace(recipe, shape_id=shapes[rng.integers(len(shapes))])
                made.append(row_of_pair(views, render_pair(chosen, few), rng))
        yield keep_rows(path, made)


def _under_one_light(store: VariedStore, rng: np.random.Generator) -> AssetStore:
    name, radiance = store.light(rng, "real")
    light = MapAsset(id="00000000", name=name, licence="", indoor=False, radiance=radiance)
    return AssetStore([light], store.shapes.values())


def row_of_pair(views: LightViews, pair: Pair, rng: np.random.Generator) -> dict:
    """Return the arrays of a pair, as LightBatch has them without the first axis."""
    mask = np.asarray(pair.crop[..., 3], np.float32)
    rgb = pair.crop[..., :3] / np.maximum(mask[..., None], 1e-3)
    fov_deg = 2.0 * float(np.degrees(np.arctan(pair.tan_half)))
    known = rng.random() < LENS_KNOWN
    lens = {"long_fov_deg": fov_deg if known else ASSUMED_DEG, "is_lens_known": known}
    named = graph_inputs(rgb.clip(0.0, 1.0), mask, cover=mask, normals=pair.normals, **lens)
    given = Given.of([torch.from_numpy(named[name]) for name in INPUTS])
    up = up_of(float(np.degrees(fibonacci_viewpoint(pair.recipe.view)[1])))
    albedo, f0 = (np.broadcast_to(one, 3) for one in (pair.material.albedo, pair.material.f0))
    material = np.array([not albedo.any(), *(f0 + (1 - f0) * albedo)])
    return row_of_inputs(views, given, pair.radiance, fov_deg, up, "cut_out", np.nan, material)

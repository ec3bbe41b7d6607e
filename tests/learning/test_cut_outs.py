"""Cut-outs that the light network learns from: what the evaluation renders, and nothing beside the object."""

from dataclasses import fields

import numpy as np
import pytest

pytest.importorskip("torch")

from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.dataset.pair import render_pair
from anyprobe_train.dataset.recipe import VIEWPOINTS, balanced_recipes
from anyprobe_train.light.light_views import LightViews
from anyprobe_train.world.batch import PHOTO_FAMILIES, LightBatch
from research.scenes.cut_outs import row_of_pair


def test_a_pair_becomes_a_row_without_surroundings():
    store = load_asset_store(None, "train", procedural_maps=1, procedural_shapes=1)
    (recipe,) = balanced_recipes(store, 1)
    pair = render_pair(recipe, store)
    row = row_of_pair(LightViews(), pair, np.random.default_rng(0))
    assert set(row) == {one.name for one in fields(LightBatch)}
    assert PHOTO_FAMILIES[row["family"]] == "cut_out"
    share, mask = (row[name][..., 3].mean() / 255 for name in ("crop", "context"))
    assert share > 0.1
    assert mask == pytest.approx(pair.crop[..., 3].mean(), abs=0.02)
    assert row["context"][..., 4].mean() == pytest.approx(255 * mask, abs=2)
    np.testing.assert_allclose(row["truth"], np.minimum(pair.radiance, 6e4), rtol=2e-3, atol=1e-6)
    assert row["up"][2] == pytest.approx((recipe.view + 0.5) / VIEWPOINTS, abs=1e-3)
    normals = row["normals"] / 127
    known = np.linalg.norm(normals, axis=-1) > 0.5
    assert known.mean() == pytest.approx(share, abs=0.05)
    seen = pair.normals[np.linalg.norm(pair.normals, axis=-1) > 0.5]
    np.testing.assert_allclose(normals[known].mean(axis=0), seen.mean(axis=0), atol=0.05)
    assert row["material"][0] == (not np.any(pair.material.albedo))
    assert (0 < row["material"][1:]).all()
    assert (row["material"][1:] <= 1).all()

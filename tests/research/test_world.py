"""The world test set: its lists, what its recipes are made of, and what is handed to the path tracer."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.errors import InputError
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import total_reflectance
from anyprobe_train.dataset import distributions
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import MapAsset, ShapeAsset
from anyprobe_train.dataset.pair import render_pair
from anyprobe_train.dataset.recipe import WORLD, Recipe, read_recipes
from anyprobe_train.evaluate.scoring import FROZEN
from research.world import pairs as world

RECIPE = Recipe(map_id="0" * 8, shape_id="1" * 8, material=3, view=4, conditions=WORLD, seed=9)


RADIANCE = np.exp(np.random.default_rng(3).normal(0, 1, (64, 128, 3))).astype(np.float32)
STORE = AssetStore(
    [MapAsset(id="0" * 8, name="map", licence="own", indoor=True, radiance=RADIANCE)],
    [ShapeAsset(id="1" * 8, name="sphere", licence="own", mesh=sphere(16))],
)


class _AskedError(Exception):
    """Ends the drawing of a pair where the path tracer is asked."""


def material(**changes):
    """What the path tracer gets for a recipe; nothing is photographed."""

    def trace(recipe, mesh, camera, radiance, given):
        raise _AskedError(given)

    with pytest.raises(_AskedError) as asked:
        render_pair(replace(RECIPE, **changes), STORE, trace)
    return asked.value.args[0]


def test_a_recipe_of_the_world_comes_back_and_no_other_kind_has_such_conditions():
    assert Recipe.from_hex(RECIPE.to_hex()) == RECIPE
    text = RECIPE.to_hex()
    for flags in ("05", "06"):
        with pytest.raises(InputError):
            Recipe.from_hex(text[:2] + flags + text[4:])


def test_the_lists_are_balanced_and_share_no_asset_with_each_other():
    test, left_out = (world.recipes_of(part) for part in world.PARTS)
    for recipes in (test, left_out):
        assert Counter(recipe.material for recipe in recipes) == dict.fromkeys(range(8), 25)
        assert {recipe.conditions for recipe in recipes} == {WORLD}
    assets = [{i for one in recipes for i in (one.map_id, one.shape_id)} for recipes in (test, left_out)]
    assert not assets[0] & assets[1]
    assert {recipe.map_id for recipe in read_recipes(FROZEN)} >= {recipe.map_id for recipe in test}


@pytest.mark.ci
def test_materials_are_of_the_recipe_s_kind_and_half():
    for kind in range(4):
        value = []
        for brighter in (0, 4):
            for seed in range(2):
                given = material(material=kind + brighter, seed=seed)
                low, high = distributions.ALPHA[kind][[0, -1]]
                assert low <= given.alpha <= high
                assert np.any(given.albedo) == (kind > 0)
                value.append(luminance(total_reflectance(given.albedo, given.f0)).mean())
        assert max(value[:2]) < min(value[2:]) + 0.1
        assert np.mean(value[:2]) < np.mean(value[2:])

"""Whole photos: their lists, how their scenes stand, and how they are exposed."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from PIL import Image

from anyprobe.cli.app import main
from anyprobe.core.response import inverse_response
from anyprobe.errors import InputError
from anyprobe.light.environment import MAP_HEIGHT
from anyprobe.maps.radiance import write_exr
from anyprobe_train.dataset.asset_store import AssetStore
from anyprobe_train.dataset.catalog import MapAsset, ShapeAsset
from anyprobe_train.dataset.random_shapes import lathe
from anyprobe_train.dataset.recipe import WORLD, balanced_recipes
from research.world import whole as whole_command
from research.world import whole_photos as whole
from research.world.whole_render import Render
from research.world.whole_scenes import draw_scene
from research.world.whole_scores import score, summary

RADIANCE = np.exp(np.random.default_rng(3).normal(0, 1, (64, 128, 3))).astype(np.float32)
STORE = AssetStore(
    [MapAsset(id="0" * 8, name="map", licence="own", indoor=True, radiance=RADIANCE)],
    [ShapeAsset(id="1" * 8, name="vase", licence="own", mesh=lathe(np.random.default_rng(3), rows=12))],
)
RECIPES = balanced_recipes(STORE, 24, 7, WORLD)
SCENES = [draw_scene(recipe, STORE) for recipe in RECIPES]


def test_the_lists_are_balanced_and_share_no_asset_with_each_other():
    test, left_out = (whole.recipes_of(part) for part in whole.LISTS)
    assert whole.recipes_of("test", count=5) == test[:5]
    for recipes in (test, left_out):
        assert len(recipes) == whole.COUNT
        assert {recipe.conditions for recipe in recipes} == {WORLD}
        assert set(Counter(recipe.material for recipe in recipes).values()) == {12, 13}
    assets = [{i for one in recipes for i in (one.map_id, one.shape_id)} for recipes in (test, left_out)]
    assert not assets[0] & assets[1]
    with pytest.raises(InputError, match="expected one of test, left-out"):
        whole.recipes_of("all")


def test_the_object_stands_on_the_table_whole_in_the_photo():
    for scene in SCENES:
        positions = scene.thing.mesh.positions
        assert abs(positions[:, 1].min()) < 1e-5
        pixels = scene.phone.pixels(positions)
        assert (pixels >= 0).all()
        assert (pixels <= [scene.phone.width, scene.phone.height]).all()


def test_a_scene_is_a_function_of_its_recipe():
    again = draw_scene(RECIPES[5], STORE)
    np.testing.assert_array_equal(again.thing.mesh.positions, SCENES[5].thing.mesh.positions)
    assert again.phone.pitch_deg == SCENES[5].phone.pitch_deg != SCENES[6].phone.pitch_deg


def _photo(scene, recipe):
    height, width = scene.phone.height, scene.phone.width
    mask = np.zeros((height, width), np.float32)
    mask[height // 3 : height // 2, width // 3 : width // 2] = 1
    picture = np.full((height, width, 3), 3.0, np.float32)
    truth = np.full((MAP_HEIGHT, 2 * MAP_HEIGHT, 3), 3.0, np.float32)
    return whole.photograph(recipe, scene, Render(picture=picture, mask=mask, truth=truth), STORE)


@pytest.mark.ci
def test_photo_and_truth_are_in_the_same_units():
    ratios = []
    for scene, recipe in zip(SCENES, RECIPES, strict=True):
        photo = _photo(scene, recipe)
        assert photo.picture.dtype == np.uint8
        assert photo.picture.shape[:2] == photo.mask.shape
        seen = inverse_response(photo.picture[photo.mask][:, :3] / 255.0).mean(axis=0)
        ratios.append(np.log2(seen.mean() / photo.truth.mean()))
    assert abs(np.median(ratios)) < 0.15  # camera curves differ
    assert np.std([_photo(s, r).truth.mean() for s, r in zip(SCENES[:6], RECIPES[:6], strict=True)]) > 0


@pytest.mark.ci
def test_own_maps_of_whole_photos_score_as_the_row_itself(tmp_path, monkeypatch, command):
    """Photos are written with what a method may know; maps that are read back have the figures of those written."""
    photos = [_photo(scene, recipe) for scene, recipe in zip(SCENES[:12], RECIPES[:12], strict=True)]
    photos = [replace(one, truth=RADIANCE * (k + 1)) for k, one in enumerate(photos)]
    monkeypatch.setattr(whole_command, "whole_photos", lambda data, part, kept, count: iter(photos))
    monkeypatch.setattr(whole_command, "recipes_of", lambda part, count: RECIPES[:12])
    run = partial(command, main=lambda: main(whole_command.app))
    written = run("write-photos", *folders(tmp_path), "-o", tmp_path / "p")
    assert written.status == 0, written.err
    (tmp_path / "program").mkdir()
    scored = {}
    for photo in photos:
        key = photo.recipe.key
        said = json.loads((tmp_path / "p" / f"{key}.json").read_text())
        assert said["fov_deg"] == (photo.long_fov_deg if photo.fov_known else None)
        with Image.open(tmp_path / "p" / said["photo"]) as picture:
            np.testing.assert_array_equal(np.asarray(picture), photo.picture)
        estimate = np.roll(photo.truth, 7, axis=1)
        write_exr(tmp_path / "program" / said["prediction"], estimate, half=False)
        scored[key] = score(photo, {"program": estimate})["program"]
    arguments = ["score", *folders(tmp_path), "--predictions", tmp_path / "program"]
    ended = run(*arguments, "-o", tmp_path / "scores.json")
    assert ended.status == 0, ended.err
    groups = json.loads((tmp_path / "scores.json").read_text())["groups"]
    for group, cut_out in (("photos", False), ("cut-outs", True)):
        own = [scored[one.recipe.key] for one in photos if bool(one.cut_out) == cut_out]
        if own:
            assert set(groups[group]["rows"]) == {"mean map", "program"}
            expected = summary(own, ["map"] * len(own))
            for name, value in groups[group]["rows"]["program"].items():
                assert value == (
                    None if np.isnan(expected[name]) else pytest.approx(expected[name], rel=1e-3, abs=1e-5)
                )


def folders(path):
    return "--data", path, "--kept", path

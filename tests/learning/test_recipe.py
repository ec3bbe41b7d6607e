"""Recipes and the pairs they give."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from anyprobe.core.response import inverse_response
from anyprobe.core.sampling import hammersley
from anyprobe.errors import InputError
from anyprobe.light.environment import rotate
from anyprobe.render.shapes import sphere
from anyprobe_train.dataset import pair as pair_module
from anyprobe_train.dataset.asset_store import AssetStore, load_asset_store
from anyprobe_train.dataset.catalog import MapAsset, ShapeAsset
from anyprobe_train.dataset.pair import fibonacci_viewpoint, render_pair, shot_of
from anyprobe_train.dataset.recipe import VIEWPOINTS, Recipe, balanced_recipes, digest

RECIPE = Recipe(map_id="00c0ffee", shape_id="deadbeef", material=5, view=22, conditions=1, seed=2**63 + 7)


def _map(map_id: str, indoor: bool, radiance: np.ndarray) -> MapAsset:
    return MapAsset(id=map_id, name=map_id, licence="own", indoor=indoor, radiance=radiance)


@pytest.fixture(scope="module")
def store() -> AssetStore:
    """Three maps (one indoor) and two spheres."""
    rng = np.random.default_rng(3)
    maps = [_map(f"{i:08x}", i == 0, np.exp(rng.normal(0, 1, (64, 128, 3))).astype(np.float32)) for i in range(3)]
    return AssetStore(
        maps, [ShapeAsset(id=f"{i:08x}", name=f"sphere{i}", licence="own", mesh=sphere(16)) for i in range(2)]
    )


@pytest.fixture
def few_samples(monkeypatch) -> None:
    """Pairs shaded roughly, where it does not matter how."""
    monkeypatch.setattr(pair_module, "hammersley", lambda count: hammersley(4))


def test_a_recipe_is_twenty_bytes_and_comes_back() -> None:
    assert len(RECIPE.to_bytes()) == 20
    assert Recipe.from_hex(RECIPE.to_hex()) == RECIPE


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "got 0 characters"),
        ("xyz", "got 3 characters"),
        (RECIPE.to_hex() + "00", "got 42 characters"),
        ("ff" + RECIPE.to_hex()[2:], "expected version 2, got 255"),
        (replace(RECIPE, material=8).to_hex(), "material < 8"),
        ("02" + "02" + RECIPE.to_hex()[4:], "conditions 0, 1 or 4"),
        (replace(RECIPE, view=23).to_hex(), "view < 23"),
    ],
)
def test_a_bad_recipe_is_refused(text: str, complaint: str) -> None:
    with pytest.raises(InputError, match=complaint):
        Recipe.from_hex(text)


def test_the_test_set_is_balanced(store) -> None:
    recipes = balanced_recipes(store, 48)
    assert Counter(r.material % 2 for r in recipes) == {0: 24, 1: 24}
    assert Counter(store.maps[r.map_id].indoor for r in recipes) == {True: 24, False: 24}
    assert set(Counter(r.shape_id for r in recipes).values()) == {24}
    assert digest(recipes) != digest(recipes[::-1])


@pytest.mark.ci
def test_a_pair_is_the_same_whatever_the_threads() -> None:
    """Clean and worldly, rendered anew in two processes with another number of threads: bit for bit."""
    script = (
        "import hashlib; from anyprobe_train.dataset.asset_store import load_asset_store;"
        "from anyprobe_train.dataset.recipe import balanced_recipes;"
        "from anyprobe_train.dataset.pair import render_pair;"
        "stock = load_asset_store(None, 'train', procedural_maps=1, procedural_shapes=1);"
        "pairs = [render_pair(*balanced_recipes(stock, 1, conditions=c), stock) for c in (0, 1)];"
        "parts = [(p.photo, p.irradiance, p.radiance, p.map_from_camera, p.gain) for p in pairs];"
        "print(*(hashlib.sha256(b''.join(p.tobytes() for p in some)).hexdigest() for some in parts))"
    )
    printed = [
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in "12"
    ]
    assert printed[0] == printed[1]
    assert len(set(printed[0].split())) == 2


def test_the_stored_rotation_and_gain_give_the_map(store, few_samples) -> None:
    """radiance = gain * map seen from the camera."""
    pair = render_pair(*balanced_recipes(store, 1), store)
    again = rotate(store.maps[pair.recipe.map_id].radiance, pair.map_from_camera.T)
    np.testing.assert_allclose(pair.radiance, again * pair.gain, rtol=1e-6)


@pytest.mark.ci
def test_photo_and_map_have_one_exposure() -> None:
    """In a white world an object sends back its albedo times the map, a rough one less (single scattering)."""
    white = AssetStore(
        [_map("0" * 8, False, np.ones((64, 128, 3), np.float32))],
        [ShapeAsset(id="0" * 8, name="sphere", licence="own", mesh=sphere(16))],
    )
    for recipe in balanced_recipes(white, 8):
        pair = render_pair(recipe, white)
        shown = np.median(pair.photo[pair.photo[..., 3] > 0][:, :3], axis=0)
        seen = inverse_response(shown / 255.0, shot_of(recipe).curve)
        albedo = pair.material.f0 + (1 - pair.material.f0) * pair.material.albedo
        ratio = seen / (albedo * pair.radiance.mean(axis=(0, 1)))
        assert (ratio > (0.95 if pair.specular else 0.4)).all()
        assert (ratio < 1.05).all()


@pytest.mark.ci
def test_own_assets_depend_on_seed_and_split_alone() -> None:
    first, again, other, held_out = (
        load_asset_store(None, split, procedural_maps=0, procedural_shapes=3, seed=seed)
        for split, seed in (("train", 5), ("train", 5), ("train", 6), ("test", 5))
    )
    assert list(first.shapes) == list(again.shapes)
    assert not set(first.shapes) & (set(other.shapes) | set(held_out.shapes))
    for one, two in zip(first.shapes.values(), again.shapes.values(), strict=True):
        np.testing.assert_array_equal(one.mesh.positions, two.mesh.positions)


def test_viewpoints_are_spread_evenly_over_the_upper_hemisphere() -> None:
    """23 directions of 2 pi / 23 sr each: mean height 1/2, and none nearer to another than 0.6 of a cap's width."""
    angles = np.array([fibonacci_viewpoint(index) for index in range(VIEWPOINTS)])
    yaw, elevation = angles.T
    assert ((elevation > 0) & (elevation < np.pi / 2)).all()
    d = np.stack([np.cos(elevation) * np.sin(yaw), np.sin(elevation), np.cos(elevation) * np.cos(yaw)], axis=1)
    np.testing.assert_allclose(d.mean(axis=0), [0, 0.5, 0], atol=0.05)
    apart = np.arccos(np.clip(d @ d.T, -1, 1)) + 9 * np.eye(VIEWPOINTS)
    assert apart.min() > 0.6 * 2 * np.arccos(1 - 1 / VIEWPOINTS)


def test_material_numbers_say_what_the_material_is(store, few_samples) -> None:
    for material in range(8):
        pair = render_pair(replace(*balanced_recipes(store, 1), material=material), store)
        assert (pair.material.alpha >= 0.5) == (not pair.specular) == bool(material & 1)
        assert (np.max(pair.material.albedo) == 0) == bool(material & 2)

"""research.compare: the pairs that it takes."""

from __future__ import annotations

import json

import pytest
from support.refused import refused
from support.some_pair import sphere_pair

from anyprobe_train.dataset.asset_store import AssetStore, own_map, own_shape
from anyprobe_train.dataset.recipe import balanced_recipes, digest
from research.compare import __main__ as compare

FIGURES = dict.fromkeys(compare.AHEAD, 1.0)


@pytest.fixture
def cheap(monkeypatch) -> None:
    monkeypatch.setattr(compare, "load_maps", lambda folder: [own_map(1, 1)])
    monkeypatch.setattr(compare, "load_shapes", lambda folder: [own_shape(1, 1)])
    monkeypatch.setattr(compare, "kept_pairs", lambda recipes, *_: [sphere_pair(k) for k in range(len(recipes))])
    monkeypatch.setattr(
        compare, "score_pair", lambda pair, methods: {name: dict.fromkeys(compare.AHEAD, 1.0) for name in methods}
    )


@pytest.mark.ci
def test_a_list_takes_the_place_of_the_frozen_pairs(cheap, tmp_path):
    recipes = balanced_recipes(AssetStore([own_map(1, 1)], [own_shape(1, 1)]), 3, 5)
    listed = tmp_path / "list.txt"
    listed.write_text("\n".join([f"# {digest(recipes)}", *(one.to_hex() for one in recipes)]))
    out = tmp_path / "compare.json"
    compare.compare(hdri=tmp_path, meshes=tmp_path, pairs=2, out=out, recipes=listed)
    assert json.loads(out.read_text())["recipes"] == digest(recipes[:2])


@pytest.mark.ci
def test_the_frozen_pairs_need_their_own_assets(cheap, tmp_path):
    with refused(source=compare.FROZEN.name, naming="--recipes DIR/frozen_public.txt"):
        compare.compare(hdri=tmp_path, meshes=tmp_path, pairs=2, out=tmp_path / "compare.json")

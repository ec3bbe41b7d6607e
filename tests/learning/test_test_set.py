"""Lists of recipes in files, and the frozen one."""

from __future__ import annotations

from collections import Counter

import pytest
from support.refused import refused

from anyprobe_train.dataset.recipe import Recipe, digest, read_recipes
from anyprobe_train.evaluate.scoring import FROZEN

RECIPES = [Recipe(map_id="00000001", shape_id="00000002", material=3, view=k, seed=k) for k in range(5)]


def write_recipes(path, recipes):
    path.write_text("\n".join([f"# {digest(recipes)}", *(recipe.to_hex() for recipe in recipes)]) + "\n")


def test_a_list_comes_back(tmp_path):
    write_recipes(tmp_path / "list.txt", RECIPES)
    assert read_recipes(tmp_path / "list.txt") == RECIPES


@pytest.mark.parametrize("damage", ["a line less", "two lines swapped", "no digest", "not text", "not there"])
def test_a_list_that_is_not_whole_is_refused(tmp_path, damage):
    path = tmp_path / "list.txt"
    write_recipes(path, RECIPES)
    lines = path.read_text().splitlines()
    if damage == "a line less":
        path.write_text("\n".join(lines[:-1]))
    elif damage == "two lines swapped":
        path.write_text("\n".join([lines[0], lines[2], lines[1], *lines[3:]]))
    elif damage == "no digest":
        path.write_text("\n".join(lines[1:]))
    elif damage == "not text":
        path.write_bytes(b"\xff\xfe\x00")
    else:
        path.unlink()
    with refused(source="list.txt"):
        read_recipes(path)


def test_the_frozen_set_is_a_thousand_balanced_pairs_none_twice():
    recipes = read_recipes(FROZEN)
    assert len({recipe.key for recipe in recipes}) == 1000
    assert Counter(recipe.material % 2 for recipe in recipes) == {0: 500, 1: 500}
    assert {recipe.conditions for recipe in recipes} == {0}
    assert FROZEN.read_text().startswith("# 850806407c831d54\n")

"""Rendered pairs kept in a folder: each kind in its place, rendered once."""

from __future__ import annotations

import numpy as np
import pytest
from support.some_pair import sphere_pair

from research import kept_pairs as module
from research.kept_pairs import kept_pairs

RECIPES = [sphere_pair(seed).recipe for seed in (1, 2)]


@pytest.fixture
def rendered(monkeypatch) -> list[int]:
    """Seeds of what was rendered."""
    calls = []

    def render_pair(recipe, store, trace):
        calls.append(recipe.seed)
        return sphere_pair(recipe.seed)

    monkeypatch.setattr(module, "render_pair", render_pair)
    return calls


def test_what_is_kept_is_not_rendered_again(rendered, tmp_path):
    first, again = (list(kept_pairs(RECIPES, None, tmp_path)) for _ in range(2))
    assert rendered == [1, 2]
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.photo, other.photo)
        assert one.recipe == other.recipe


def test_nothing_is_kept_without_a_folder(rendered):
    for _ in range(2):
        list(kept_pairs(RECIPES[:1], None))
    assert rendered == [1] * 2

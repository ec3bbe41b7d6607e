"""Rendered pairs kept in a folder: each kind in its place, rendered once."""

from __future__ import annotations

import numpy as np
import pytest
from support.some_pair import ball_pair

from anyprobe.evaluate import kept_pairs as module
from anyprobe.evaluate.kept_pairs import kept_pairs

RECIPES = [ball_pair(seed).recipe for seed in (1, 2)]


@pytest.fixture
def rendered(monkeypatch) -> list[tuple]:
    """What was rendered: seed, laboratory, textured. A textured object's photo is black."""
    calls = []

    def render_pair(recipe, stock, trace=None, laboratory=False, textured=False):
        calls.append((recipe.seed, laboratory, textured))
        pair = ball_pair(recipe.seed)
        if textured:
            pair.photo[..., :3] = 0
        return pair

    monkeypatch.setattr(module, "render_pair", render_pair)
    return calls


def test_what_is_kept_is_not_rendered_again(rendered, tmp_path):
    first, again = (list(kept_pairs(RECIPES, None, tmp_path)) for _ in range(2))
    assert rendered == [(1, False, False), (2, False, False)]
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.photo, other.photo)
        assert one.recipe == other.recipe


def test_textured_objects_are_not_taken_for_uniform_ones(rendered, tmp_path):
    """Their recipes are the same, and so would the names of their files be."""
    uniform = list(kept_pairs(RECIPES, None, tmp_path))
    textured = list(kept_pairs(RECIPES, None, tmp_path, textured=True))
    assert rendered[2:] == [(1, False, True), (2, False, True)]
    for _ in range(2):
        assert [pair.photo[..., :3].any() for pair in textured] == [False, False]
        assert [pair.photo[..., :3].any() for pair in uniform] == [True, True]
        textured = kept_pairs(RECIPES, None, tmp_path, textured=True)
        uniform = kept_pairs(RECIPES, None, tmp_path)
    assert len(rendered) == 4
    assert sorted(path.name for path in (tmp_path / "textured").iterdir()) == sorted(
        path.name for path in tmp_path.glob("*.npz")
    )


def test_nothing_is_kept_without_a_folder(rendered):
    for _ in range(2):
        list(kept_pairs(RECIPES[:1], None, textured=True, laboratory=True))
    assert rendered == [(1, True, True)] * 2

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
    """What was rendered: seed and laboratory."""
    calls = []

    def render_pair(recipe, stock, trace=None, laboratory=False):
        calls.append((recipe.seed, laboratory))
        return ball_pair(recipe.seed)

    monkeypatch.setattr(module, "render_pair", render_pair)
    return calls


def test_what_is_kept_is_not_rendered_again(rendered, tmp_path):
    first, again = (list(kept_pairs(RECIPES, None, tmp_path)) for _ in range(2))
    assert rendered == [(1, False), (2, False)]
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.photo, other.photo)
        assert one.recipe == other.recipe


def test_nothing_is_kept_without_a_folder(rendered):
    for _ in range(2):
        list(kept_pairs(RECIPES[:1], None, laboratory=True))
    assert rendered == [(1, True)] * 2

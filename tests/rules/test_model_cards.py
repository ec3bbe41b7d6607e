"""A model card that names an id names that of the graphs beside it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from anyprobe.estimate.runtime import model_id

CARDS = sorted((Path(__file__).parents[2] / "src" / "anyprobe" / "weights").glob("*/README.md"))


def other_ids(text: str, name: str) -> list[str]:
    """The ids of a model that a text names and the model has not."""
    stated = re.findall(rf"\b{name}-[0-9a-f]{{8}}\b", text)
    return [one for one in stated if one != model_id(name)]


@pytest.mark.parametrize("card", CARDS, ids=lambda card: card.parent.name)
def test_a_card_names_the_model_beside_it(card):
    assert other_ids(card.read_text(encoding="utf-8"), card.parent.name) == []

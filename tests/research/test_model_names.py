"""Two models never share a row."""

import pytest

from anyprobe.errors import InputError
from research.model_names import titles_of


def test_models_of_one_name_are_refused():
    assert titles_of(["lift", "runs/new"]) == ["lift", "new"]
    with pytest.raises(InputError, match="--model: expected models of different names, got two of lift"):
        titles_of(["lift", "runs/lift"])

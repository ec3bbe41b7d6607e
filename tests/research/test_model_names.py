"""Two models never share a row."""

from support.refused import refused

from research.model_names import titles_of


def test_models_of_one_name_are_refused():
    assert titles_of(["lift", "runs/new"]) == ["lift", "new"]
    with refused("model", naming="lift"):
        titles_of(["lift", "runs/lift"])

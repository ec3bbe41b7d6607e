"""anyprobe evaluate: what it writes and prints, on pairs that a stub renders."""

from __future__ import annotations

import json

import pytest
from support.folders import snapshot
from support.some_pair import sphere_pair

from anyprobe.dataset import catalog
from anyprobe.dataset import pair as pair_module
from anyprobe.dataset.asset_store import own_map, own_shape
from anyprobe.evaluate import methods, scoring

ASSETS = ("--hdri", "h", "--meshes", "m", "--pairs", "4")
ALPHAS = (0.05, 0.6, 0.2, 0.9)


@pytest.fixture
def rendered(monkeypatch) -> list[dict]:
    """How each pair was asked for; spheres in turn indoors and out, shiny and dull."""
    calls = []

    def render_pair(recipe, store, trace=None, laboratory=False, textured=False):
        calls.append({"trace": trace, "textured": textured, "conditions": recipe.conditions})
        k = len(calls) - 1
        return sphere_pair(k, ALPHAS[k % 4], indoor=bool(k // 2 % 2), material=k % 2)

    monkeypatch.setattr(pair_module, "render_pair", render_pair)
    monkeypatch.setattr(catalog, "load_maps", lambda folder, report: [own_map(1, 1)])
    monkeypatch.setattr(catalog, "load_shapes", lambda folder, report: [own_shape(1, 1)])
    return calls


@pytest.fixture
def scored_quickly(monkeypatch) -> None:
    """Every figure 1: the spheres that most are of take a second a pair."""
    monkeypatch.setattr(scoring, "score", lambda estimate, truth: dict.fromkeys(scoring.METRICS, 1.0))


def written(folder) -> dict:
    return json.loads((folder / "evaluation" / "scores.json").read_text())


def test_every_group_has_every_method_and_its_confidence(work, command, rendered):
    """In the file and in print: the baselines, all groups that occur, and a constant beside what is claimed."""
    ended = command("evaluate", *ASSETS, "--conditions", "world", "--noisy-masks")
    assert ended.status == 0, ended.err
    assert [call["conditions"] for call in rendered] == [1] * 4
    scores = written(work)["scores"]
    assert list(scores) == ["lift", "lift, emitters expected", "mean map", "chrome sphere"]
    groups = list(scores["lift"])
    assert {"all", "specular", "diffuse", "indoor", "outdoor", "alpha 0-0.1", "alpha 0.75-1"} <= set(groups)
    tables, printed = ended.out.split("confidence, in brackets")
    titles = [line.strip() for line in tables.splitlines()]
    for name in scores:
        assert list(scores[name]) == groups
        assert sum(line.startswith(f"│ {name} ") for line in titles) == len(groups)
    assert all(titles.count(group) == 1 for group in groups)
    assert "…" not in ended.out
    confidence = written(work)["confidence"]
    assert {"error", "claimed", "right", "bins"} <= set(confidence), "what readers had before"
    assert confidence["constant"]["claimed"] == confidence["right"]
    assert set(confidence["groups"]) == {*groups, "seen half", "unseen half"} - {"all"}
    (row,) = [line for line in printed.splitlines() if line.startswith("│ indoor ")]
    indoor = confidence["groups"]["indoor"]
    for name in ("error", "brier", "log_loss"):
        assert f"{indoor[name]:.3f} ({indoor['constant'][name]:.3f})" in row


def test_what_is_told_has_a_confidence_of_its_own(work, command, rendered, scored_quickly, monkeypatch):
    """Two of the five things that are: the others take as long again."""
    monkeypatch.setattr(
        methods, "GIVEN_HINTS", {name: methods.GIVEN_HINTS[name] for name in ("normals", "surroundings")}
    )
    ended = command("evaluate", *ASSETS, "--hints", "--textured")
    assert [call["textured"] for call in rendered] == [True] * 4
    given, alone = written(work)["confidence_with_hints"], written(work)["confidence"]
    assert list(given) == ["lift, normals given", "lift, surroundings given"]
    assert given["lift, surroundings given"]["right"] > alone["right"] + 0.01
    assert given["lift, normals given"] != alone
    (row,) = [
        line
        for line in ended.out.split("confidence, in brackets")[1].splitlines()
        if line.startswith("│ lift, surroundings given ")
    ]
    assert f"{given['lift, surroundings given']['auc']:.3f} (0.500)" in row


def test_a_model_that_claims_nothing_has_no_confidence(work, command, rendered, scored_quickly):
    ended = command("evaluate", *ASSETS, "--model", "paper")
    assert (written(work)["confidence"], written(work)["confidence_with_hints"]) == (None, {})
    assert "confidence" not in ended.out
    assert [call["textured"] for call in rendered] == [False] * 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [((*ASSETS, "--textured", "--path-traced"), "--textured: expected photos that anyprobe shades")],
)
def test_textured_objects_are_refused_where_they_cannot_be(work, command, arguments, words):
    before = snapshot(work)
    assert words in command("evaluate", *arguments).complaint
    assert snapshot(work) == before

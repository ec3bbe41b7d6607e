"""anyprobe-train evaluate: what it writes and prints, on pairs that a stub renders."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.estimate.runtime import Models
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.maps.radiance import write_exr
from anyprobe.pictures.images import read_image
from anyprobe_train.dataset import catalog
from anyprobe_train.dataset import pair as pair_module
from anyprobe_train.dataset.asset_store import AssetStore, own_map, own_shape
from anyprobe_train.dataset.recipe import WORLD, balanced_recipes, digest
from anyprobe_train.evaluate import methods, scoring

TRUTH = ["one flat colour", "truth blurred by 15 degrees", "truth blurred by 30 degrees"]
ASSETS = ("--hdri", "h", "--meshes", "m", "--pairs", "4")
ALPHAS = (0.05, 0.6, 0.2, 0.9)


@pytest.fixture
def rendered(monkeypatch) -> list[dict]:
    """How each pair was asked for; spheres in turn indoors and out, shiny and dull."""
    calls = []

    def render_pair(recipe, store):
        calls.append({"conditions": recipe.conditions})
        k = len(calls) - 1
        pair = sphere_pair(k, ALPHAS[k % 4], indoor=bool(k // 2 % 2), material=k % 2)
        return replace(pair, recipe=recipe)

    monkeypatch.setattr(pair_module, "render_pair", render_pair)
    monkeypatch.setattr(catalog, "load_maps", lambda folder, report: [own_map(1, 1)])
    monkeypatch.setattr(catalog, "load_shapes", lambda folder, report: [own_shape(1, 1)])
    return calls


@pytest.fixture
def scored_quickly(monkeypatch) -> None:
    """Every figure 1: the spheres that most are of take a second a pair, as do those of the pictures."""
    without_pictures(monkeypatch)
    monkeypatch.setattr(scoring, "score", lambda estimate, truth: dict.fromkeys(scoring.METRICS, 1.0))


def without_pictures(monkeypatch) -> None:
    monkeypatch.setattr("anyprobe_train.cli.evaluate._cells", lambda pair, estimates: np.zeros((8, 8, 3)))


@pytest.fixture
def cheap_spheres(monkeypatch) -> None:
    """Pieces of the map in the place of rendered spheres, which take a second a pair."""
    monkeypatch.setattr(
        scoring, "sphere_images", lambda radiance: dict.fromkeys(("diffuse", "silver", "mirror"), radiance[:, :64])
    )


def written(folder) -> dict:
    return json.loads((folder / "evaluation" / "scores.json").read_text())


@pytest.mark.ci
def test_every_group_has_every_method_and_its_confidence(work, command, rendered, cheap_spheres):
    """In the file and in print: the baselines, all groups that occur, and a constant beside what is claimed."""
    ended = command("evaluate", *ASSETS, "--conditions", "world")
    assert ended.status == 0, ended.err
    assert [call["conditions"] for call in rendered] == [1] * 4
    scores = written(work)["scores"]
    assert list(scores) == ["lift", "mean map", "chrome sphere", *TRUTH]
    groups = list(scores["lift"])
    assert {"all", "specular", "diffuse", "indoor", "outdoor", "alpha 0-0.1", "alpha 0.75-1"} <= set(groups)
    tables, printed = ended.out.split("confidence, in brackets")
    titles = [line.strip() for line in tables.splitlines()]
    for name in scores:
        assert list(scores[name]) == groups
        assert sum(line.startswith(f"│ {name} ") for line in titles) == len(groups) + 1, "and its errors"
    assert all(titles.count(group) == 1 for group in groups)
    assert "…" not in ended.out
    confidence = written(work)["confidence"]
    assert {"error", "claimed", "right", "bins"} <= set(confidence), "what readers had before"
    assert confidence["constant"]["claimed"] == confidence["right"]
    assert set(confidence["groups"]) == {*groups} - {"all"}
    (row,) = [line for line in printed.splitlines() if line.startswith("│ indoor ")]
    indoor = confidence["groups"]["indoor"]
    for name in ("error", "brier", "log_loss"):
        assert f"{indoor[name]:.3f} ({indoor['constant'][name]:.3f})" in row


def own_maps(photos, maps, gain: float = 1.0) -> None:
    """A stranger's program: reads the photos that were written, writes a map for each."""
    models = Models(DEFAULT_MODEL)
    for path in photos.glob("*.json"):
        given = json.loads(path.read_text())
        layers = np.dstack([read_image(photos / given[name], as_data=name == "mask").rgb for name in ("photo", "mask")])
        pair = SimpleNamespace(crop=layers[..., :4], tan_half=np.tan(np.radians(given["fov_deg"] / 2)))
        outputs = methods.run_with_hints(models, pair, ())
        write_exr(maps / given["prediction"], outputs.radiance * gain, half=False)


@pytest.mark.ci
def test_own_maps_score_as_the_model_itself(work, command, rendered, cheap_spheres, monkeypatch):
    without_pictures(monkeypatch)
    assert command("evaluate", *ASSETS).status == 0
    itself = written(work)
    rendered.clear()
    assert command("evaluate", *ASSETS, "--write-photos", "photos").status == 0
    (work / "maps").mkdir()
    own_maps(work / "photos", work / "maps")
    rendered.clear()
    ended = command("evaluate", *ASSETS, "--predictions", "maps")
    assert ended.status == 0, ended.err
    theirs = written(work)
    assert theirs["scores"]["maps"] == itself["scores"]["lift"]
    assert theirs["standard_errors"]["maps"] == itself["standard_errors"]["lift"]
    assert theirs["scores"]["mean map"] == itself["scores"]["mean map"]
    assert list(theirs["scores"]) == ["maps", "mean map", "chrome sphere", *TRUTH]
    assert (theirs["irradiance"], theirs["confidence"], theirs["model"]) == (None, None, "maps")
    own_maps(work / "photos", work / "maps", gain=2.0)
    rendered.clear()
    assert command("evaluate", *ASSETS, "--predictions", "maps").status == 0
    brighter = written(work)["scores"]["maps"]["all"]
    assert brighter["ldr_rmse"] != itself["scores"]["lift"]["all"]["ldr_rmse"]
    assert brighter["ldr_gain_rmse"] == pytest.approx(itself["scores"]["lift"]["all"]["ldr_gain_rmse"], abs=1e-4)


def test_written_photos_are_all_that_a_method_is_given(work, command, rendered):
    """Photo, mask and camera; no truth, and no name of map or shape."""
    ended = command("evaluate", *ASSETS, "--write-photos", "photos")
    assert ended.status == 0, ended.err
    assert not (work / "evaluation").exists()
    said = [json.loads(path.read_text()) for path in (work / "photos").glob("*.json")]
    assert len(said) == 4
    assert {path.name for path in (work / "photos").iterdir()} == {
        name for one in said for name in (one["photo"], one["mask"], one["photo"].replace(".png", ".json"))
    }
    for one in said:
        assert one["fov_deg"] == pytest.approx(2 * np.degrees(np.arctan(0.1)))
        assert not {"map", "shape", "radiance"} & set(one)
        assert read_image(work / "photos" / one["photo"]).rgb.shape[:2] == (one["height"], one["width"])


@pytest.mark.ci
def test_a_list_of_recipes_keeps_its_conditions(work, command, rendered, scored_quickly):
    recipes = balanced_recipes(AssetStore([own_map(1, 1)], [own_shape(1, 1)]), 5, 3, WORLD)
    (work / "list.txt").write_text("\n".join([f"# {digest(recipes)}", *(one.to_hex() for one in recipes)]))
    assert command("evaluate", *ASSETS, "--recipes", "list.txt").status == 0
    assert [call["conditions"] for call in rendered] == [WORLD] * 4
    assert written(work)["recipes"] == digest(recipes[:4])

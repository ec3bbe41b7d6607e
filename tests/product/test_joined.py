"""Rows that come later: put into files that hold more, only where they are of the same pairs."""

import json

import pytest
from support.some_pair import ball_pair

from anyprobe.errors import InputError
from anyprobe.evaluate.joined import join_file
from anyprobe.evaluate.report import write_report
from anyprobe.evaluate.study import Study
from anyprobe.evaluate.tables import result_files

ABOUT = {"command": "anyprobe compare --run designs", "commit": "abc", "recipes": "0123"}
LATER = {
    "command": "anyprobe compare --join",
    "commit": "def",
    "recipes": "0123",
    "lift": {"model": "lift-2"},
}


def scored(about, **ssim):
    """Result files of two pairs with the given ldr_ssim."""
    study = Study()
    for index in range(2):
        study.add(ball_pair(index), {name: {"ldr_ssim": values[index]} for name, values in ssim.items()})
    return result_files(study, about)


@pytest.fixture
def kept(tmp_path):
    """What a comparison of designs left: ours, a model, no baseline."""
    files = scored(ABOUT | {"lift": {"model": "lift-1"}}, meka=(0.1, 0.2), ours=(0.3, 0.5), lift=(0.6, 0.6))
    for name, content in files.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    return tmp_path


def test_rows_take_the_place_of_their_own_and_all_else_stays(kept):
    before = json.loads((kept / "table1.json").read_text())
    after = join_file(kept / "table1.json", scored(LATER, lift=(0.8, 0.6), lift_spread=(0.2, 0.4))["table1"])
    assert [row["design"] for row in after["rows"]] == ["meka", "ours", "lift", "lift_spread"]
    assert after["rows"][:2] == before["rows"][:2]
    assert [row["ldr_ssim"] for row in after["rows"][2:]] == pytest.approx([0.7, 0.3])
    assert (after["order"], after["command"], after["commit"]) == (before["order"], ABOUT["command"], "abc")
    assert after["lift"] == {"model": "lift-2"}
    assert after["joined"] == {"lift": {"model": "lift-2", "command": LATER["command"], "commit": "def"}}


def test_every_group_gets_its_rows(kept):
    after = join_file(kept / "splits.json", scored(LATER, lift=(0.8, 0.6))["splits"])
    assert set(after["groups"]) == set(json.loads((kept / "splits.json").read_text())["groups"])
    for group in after["groups"].values():
        values = {row["design"]: row["ldr_ssim"] for row in group["rows"]}
        assert values["lift"] in (0.8, 0.6, 0.7)
        assert values["ours"] in (0.3, 0.5, 0.4)


def test_other_pairs_are_refused(kept):
    other = scored(LATER | {"recipes": "4567"}, lift=(0.8, 0.6))["table1"]
    with pytest.raises(InputError, match="table1.json: expected recipes 4567, got 0123; rows of other pairs"):
        join_file(kept / "table1.json", other)
    with pytest.raises(InputError, match="expected pairs 3, got 2"):
        join_file(kept / "table1.json", scored(LATER, lift=(0.8, 0.6))["table1"] | {"pairs": 3})
    with pytest.raises(InputError, match="expected a result file"):
        join_file(kept / "fig99.json", other)


def test_page_says_which_rows_came_later(kept):
    joined = join_file(kept / "table1.json", scored(LATER, lift=(0.8, 0.6))["table1"])
    page = kept / "page"
    page.mkdir()
    (page / "table1.json").write_text(json.dumps(joined))
    text = write_report(page, kept.parent / "results.md").read_text()
    assert (
        "Rows of `lift` are those of lift-2, joined later by `anyprobe compare --join`\nat commit def" in text
    )

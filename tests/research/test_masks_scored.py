"""The research on masks scores what it says it scores."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from PIL import Image

from anyprobe.masks.find import FoundMask
from research.masks import __main__ as command
from research.masks.cases import iou, make_case, photo_cases
from research.masks.scoring import Row, figures, score, warned


@pytest.fixture
def folder(tmp_path):
    """Two photos of a red disc; the manifest names one object, gives one click and one box."""
    photos = tmp_path / "photos"
    photos.mkdir()
    rows, columns = np.mgrid[0:120, 0:160]
    for name, x in (("a", 60), ("b", 100)):
        inside = np.hypot(columns - x, rows - 60) < 35
        rgb = np.where(inside[..., None], (210, 60, 40), (90, 110, 130)).astype(np.uint8)
        Image.fromarray(rgb).save(photos / f"{name}.png")
        Image.fromarray(inside).save(photos / f"{name}_mask.png")
    (photos / "manifest.csv").write_text('id,group,click,box\na,disc,"70,50","10,11,120,110"\nb,disc,,\n')
    return photos


@pytest.fixture
def red_is_found(monkeypatch):
    """What is red is the object, without a network; by a box, its left half alone."""

    def find(pixels, *, box=None, **_):
        mask = (pixels.rgb[..., 0] > 0.6).astype(np.float32)
        if box is not None:
            mask[:, round((box[0] + box[2]) / 2) :] = 0
        return FoundMask(mask=mask, source="network", confidence=0.9)

    monkeypatch.setattr("research.masks.scoring.find_mask", find)


def test_prompts_come_from_the_manifest_or_from_the_mask(folder):
    first, second = photo_cases(folder)
    assert (first.group, first.click, first.box) == ("disc", (70.0, 50.0), (10.0, 11.0, 120.0, 110.0))
    assert second.group == "disc"
    np.testing.assert_allclose(second.click, (100, 60), atol=4)
    np.testing.assert_allclose(second.box, (66 - 2.8, 26 - 2.8, 135 + 2.8, 95 + 2.8), atol=1.1)
    assert not second.box_is_whole
    assert make_case("c", first.rgb, first.mask, (1, 1), (0, 0, 160, 120)).box_is_whole


def row(group: str, value: float, warning: str = "") -> Row:
    return Row(name=group, group=group, segmenter="", prompt="", iou=value, expected=None, warning=warning, mask=None)


def test_photos_of_one_object_count_as_one_and_warnings_as_many():
    rows = [row("a", 0.2, "bad"), row("a", 0.4), row("b", 0.9), row("c", 0.88, "doubt")]
    assert figures(rows) == "mean 0.693, median 0.880, under 0.5 1 of 3"
    assert warned(rows) == "warned of 1 of 2 bad, 1 of 2 good"


def test_a_refused_photo_scores_nothing_and_counts_as_warned():
    grey = make_case("grey", np.full((64, 64, 3), 0.5, np.float32), np.eye(64), (32, 32), (9, 9, 50, 50))
    refused = score(grey, "auto", "anyprobe", None)
    assert refused.iou == 0.0
    assert refused.warning


def test_the_command_writes_a_table_and_a_sheet(folder, red_is_found, tmp_path, capsys):
    out = tmp_path / "out"
    options = {"data": None, "scenes": 1, "seed": 0, "segmenter": None}
    command.masks([folder], **options, before=None, out=out)
    rows = json.loads((out / "masks.json").read_text())["rows"]["photos"]
    assert [one["prompt"] for one in rows] == ["auto", "click", "box"] * 2
    with Image.open(out / "photos.jpg") as sheet:
        assert sheet.width > 1000
    command.masks([folder], **options, before=out / "masks.json", out=tmp_path / "again")
    mean = np.mean([one["iou"] for one in rows if one["prompt"] == "box"])
    assert f"({mean:.2f})" in capsys.readouterr().out


def test_several_folders_are_summed_up_too(folder, red_is_found, tmp_path, capsys):
    shutil.copytree(folder, tmp_path / "more")
    options = {"data": None, "scenes": 1, "seed": 0, "segmenter": None, "before": None}
    command.masks([folder, tmp_path / "more"], **options, out=tmp_path / "out")
    printed = capsys.readouterr().out
    assert printed.count("of 1; warned") == 3 * 3  # one object, three prompts, in each folder and in all
    assert "all sets, anyprobe box: mean" in printed


def test_calibration_asks_for_either_of_two_objects_where_none_is_marked(monkeypatch, capsys):
    pytest.importorskip("torch", reason="needs ./train[torch]")
    from research.masks import calibrate

    rows, columns = np.mgrid[0:240, 0:320]
    discs = [np.hypot(columns - 100 - 6 * k, rows - 120) < 40 + 2 * k for k in range(12)]
    scenes = [
        make_case(
            str(k),
            np.where(disc[..., None], (0.8, 0.2, 0.1), 0.05 * k).astype(np.float32),
            disc,
            (100 + 6 * k, 120),
            (0, 0, 9, 9),
        )
        for k, disc in enumerate(discs)
    ]
    monkeypatch.setattr("anyprobe_train.dataset.asset_store.load_asset_store", lambda *_, **__: None)
    monkeypatch.setattr("research.masks.scenes.rendered_cases", lambda *_: scenes)
    both = list(calibrate._cases("", 12, [], 6, 1))
    assert [other is None for _, _, other in both].count(False) == 12
    first, second = next((case, other) for _, case, other in both if other is not None)

    class Right:
        name, takes_prompts = "small", True

        def cover(self, rgb, *_):
            return second.mask

    assert next(calibrate.ask(Right(), first, second))[1] > next(calibrate.ask(Right(), first))[1]
    calibrate.calibrate("", scenes=12, clutter=0, seed=1, small=True)
    printed = capsys.readouterr().out
    assert "below 0.88: contract" in printed
    assert '"small": { "offset": ' in printed


def test_iou_of_nothing():
    assert iou(None, np.ones((4, 4))) == 0.0
    assert iou(np.zeros((4, 4)), np.zeros((4, 4))) == 0.0

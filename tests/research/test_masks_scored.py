"""The research on masks scores what it says it scores."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image

from anyprobe.masks.find import FoundMask
from research.masks import __main__ as command
from research.masks.cases import make_case, photo_cases
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
    command.masks(photos=[folder], **options, before=None, out=out)
    rows = json.loads((out / "masks.json").read_text())["rows"]["photos"]
    assert [one["prompt"] for one in rows] == ["auto", "click", "box"] * 2
    with Image.open(out / "photos.jpg") as sheet:
        assert sheet.width > 1000
    command.masks(photos=[folder], **options, before=out / "masks.json", out=tmp_path / "again")
    mean = np.mean([one["iou"] for one in rows if one["prompt"] == "box"])
    assert f"({mean:.2f})" in capsys.readouterr().out

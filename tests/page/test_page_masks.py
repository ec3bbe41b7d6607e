"""The page finds the objects of still photos that the package finds, and their lights."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from support.page_masks import PageAnswer, can_run, page_masks

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.pictures.images import read_image
from research.masks.cases import iou, photo_cases

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = [
    pytest.mark.ci,
    pytest.mark.skipif(not can_run(), reason="needs Node.js and the packages of web/ (cd web && npm ci)"),
]


@pytest.fixture(scope="module")
def vase() -> np.ndarray:
    return read_image(EXAMPLES / "vase.png").rgb


def differences(page: PageAnswer, estimator: Estimator, rgb: np.ndarray, **given) -> str:
    """What is not the same; empty for masks of IoU .99 and a light within a degree and a hundredth."""
    photo = load_photo(read_image(rgb).rgb, **given)
    own = estimator.from_photo(photo).dominant_light()
    same = iou(page.mask, photo.mask)
    away_deg = np.degrees(np.arccos(np.clip(own.direction @ page.direction, -1, 1)))
    off = np.abs(page.irradiance / own.irradiance - 1).max()
    is_same = same >= 0.99 and away_deg < 1 and off < 0.01
    return "" if is_same else f"masks of IoU {same:.3f}, lights {away_deg:.2f} degrees and {off:.1%} apart"


def test_page_and_package_find_the_same_vase_and_light(vase, tmp_path):
    """Without a prompt, by a click and by a box; with the weights that are there."""
    height, width = vase.shape[:2]
    click, box = (width / 2, height / 2), (width * 0.1, height * 0.05, width * 0.9, height * 0.97)
    clicks, boxes = [[], [click], []], [None, None, box]
    estimator = Estimator()
    for page, on, corners in zip(
        page_masks(tmp_path, [vase] * 3, clicks, boxes, light=True), clicks, boxes, strict=True
    ):
        assert differences(page, estimator, vase, click=on or None, box=corners) == ""


@pytest.mark.slow
@pytest.mark.skipif("ANYPROBE_PHOTOS" not in os.environ, reason="ANYPROBE_PHOTOS names folders of photos and masks")
@pytest.mark.parametrize("given", ["nothing", "click"])
def test_page_and_package_agree_on_photos_of_others(tmp_path, given):
    folders = map(Path, os.environ["ANYPROBE_PHOTOS"].split(os.pathsep))
    cases = [case for folder in folders for case in photo_cases(folder)]
    clicks = [[case.click] if given == "click" else [] for case in cases]
    pages = page_masks(tmp_path, [case.rgb for case in cases], clicks, light=True)
    estimator = Estimator()
    found = {
        case.name: differences(page, estimator, case.rgb, click=on or None)
        for case, page, on in zip(cases, pages, clicks, strict=True)
    }
    assert {name: line for name, line in found.items() if line} == {}

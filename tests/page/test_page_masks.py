"""The page finds the objects of still photos that the package finds."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from support.page_masks import can_run, page_masks

from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.photo import load_photo
from anyprobe.files.images import read_image
from anyprobe.masks.find import find_mask
from research.masks.cases import Case, iou, photo_cases

EXAMPLES = Path(__file__).parents[2] / "examples"

pytestmark = pytest.mark.skipif(not can_run(), reason="needs Node.js and the packages of web/ (cd web && npm ci)")


@pytest.fixture(scope="module")
def vase() -> np.ndarray:
    return read_image(EXAMPLES / "vase.png").rgb


def test_page_and_package_find_the_same_vase(vase, tmp_path):
    """Without a prompt, by a click and by a box; with the weights that are there."""
    height, width = vase.shape[:2]
    click, box = (width / 2, height / 2), (width * 0.1, height * 0.05, width * 0.9, height * 0.97)
    clicks, boxes = [[], [click], []], [None, None, box]
    pages, _ = page_masks(tmp_path, [vase] * 3, clicks, boxes)
    for page, on, corners in zip(pages, clicks, boxes, strict=True):
        assert iou(page, find_mask(read_image(vase), click=on or None, box=corners).mask) >= 0.99


@pytest.mark.slow
@pytest.mark.skipif("ANYPROBE_PHOTOS" not in os.environ, reason="ANYPROBE_PHOTOS names folders of photos and masks")
def test_page_and_package_agree_on_photos_of_others(tmp_path):
    """IoU, and the light: within a degree and a hundredth."""
    folders = map(Path, os.environ["ANYPROBE_PHOTOS"].split(os.pathsep))
    cases: list[Case] = [case for folder in folders for case in photo_cases(folder)]
    pages, _ = page_masks(tmp_path, [case.rgb for case in cases], [[]] * len(cases))
    estimator = Estimator()
    for case, page in zip(cases, pages, strict=True):
        own = find_mask(read_image(case.rgb)).mask
        assert iou(page, own) >= 0.99, case.name
        lights = [estimator.from_photo(load_photo(case.rgb, mask=mask)).dominant_light() for mask in (own, page)]
        a, b = (light.direction for light in lights)
        assert np.degrees(np.arccos(np.clip(a @ b, -1, 1))) < 1.0, case.name
        np.testing.assert_allclose(lights[0].irradiance, lights[1].irradiance, rtol=0.01, err_msg=case.name)

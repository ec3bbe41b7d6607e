"""The page cuts objects out of still photos as well as the command line: our own scenes through both."""

from __future__ import annotations

import numpy as np
import pytest
from support.page_masks import can_run, page_masks

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.dataset.asset_store import draw_map  # noqa: E402
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.files.images import read_image  # noqa: E402
from anyprobe.masks.find import find_mask  # noqa: E402
from research.mask_network.foregrounds import TexturePool, ViewSource  # noqa: E402
from research.masks.cases import iou  # noqa: E402
from research.masks.scenes import drawn_cases  # noqa: E402

pytestmark = pytest.mark.slow

SCENES = 6


@pytest.fixture(scope="module")
def cases():
    """Photos of made shapes under made maps, 480 pixels across."""
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=4, size=384))
    return list(drawn_cases(ViewSource(illuminator, surfaces, TexturePool(0, 24), seed=0), SCENES, seed=0))


def test_page_cuts_out_as_well_as_the_package(cases, tmp_path):
    if not can_run():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    clicks = [on for case in cases for on in ([], [case.click])]
    photos = [case.rgb for case in cases for _ in range(2)]
    pages, _ = page_masks(tmp_path, photos, clicks)
    ours = [find_mask(read_image(rgb), click=on or None).mask for rgb, on in zip(photos, clicks, strict=True)]
    _check_alike(pages, ours, [case.mask for case in cases for _ in range(2)])


def test_page_cuts_out_of_a_box_as_well_as_the_package(cases, tmp_path):
    if not can_run():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    photos, boxes = [case.rgb for case in cases], [case.box for case in cases]
    pages, _ = page_masks(tmp_path, photos, [[]] * len(photos), boxes)
    ours = [find_mask(read_image(rgb), box=box).mask for rgb, box in zip(photos, boxes, strict=True)]
    _check_alike(pages, ours, [case.mask for case in cases])


def _check_alike(pages: list[np.ndarray], ours: list[np.ndarray], true: list[np.ndarray]) -> None:
    """Each cuts out in its own way from the same proposal: mostly the same, and neither is worse on the whole."""
    agreements = [iou(page, own) for page, own in zip(pages, ours, strict=True)]
    gained = [iou(page, mask) - iou(own, mask) for page, own, mask in zip(pages, ours, true, strict=True)]
    assert np.median(agreements) >= 0.85, np.round(agreements, 2)
    assert abs(np.mean(gained)) <= 0.08, np.round(gained, 2)

"""The page cuts objects out of still photos as OpenCV does for the command line: our own scenes through both."""

from __future__ import annotations

import numpy as np
import pytest
from support.page_masks import can_run, page_masks

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("cv2", reason="needs the box extra")

from anyprobe.dataset.asset_store import draw_map  # noqa: E402
from anyprobe.dataset.backdrops import TexturePool  # noqa: E402
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.sprites import ViewSource  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe.evaluate.mask_scenes import drawn_cases  # noqa: E402
from anyprobe.evaluate.masks import iou  # noqa: E402
from anyprobe.masks.grabcut import cut_seeded, mask_from_box  # noqa: E402
from anyprobe.masks.propose import shared_network  # noqa: E402

pytestmark = pytest.mark.slow

SCENES = 6


@pytest.fixture(scope="module")
def cases():
    """Photos of made shapes under made maps, 480 pixels across."""
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=4, size=384))
    return list(
        drawn_cases(ViewSource(illuminator, surfaces, seed=0), TexturePool(0, count=24), SCENES, seed=0)
    )


def test_page_cuts_out_what_the_package_cuts_out(cases, tmp_path):
    if not can_run():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    clicks = [on for case in cases for on in ([], [case.click])]
    photos = [case.rgb for case in cases for _ in range(2)]
    pages, _ = page_masks(tmp_path, photos, clicks)
    agreements = []
    for rgb, on, page in zip(photos, clicks, pages, strict=True):
        own = cut_seeded(rgb, shared_network().propose(rgb, on).cover, on)
        agreements.append(iou(page, np.zeros(page.shape) if own is None else own))
    assert np.mean(agreements) >= 0.9, np.round(agreements, 2)


def test_page_cuts_out_of_a_box_what_the_package_cuts_out(cases, tmp_path):
    if not can_run():
        pytest.skip("needs Node.js and the packages of web/ (cd web && npm ci)")
    photos, boxes = [case.rgb for case in cases], [case.box for case in cases]
    pages, _ = page_masks(tmp_path, photos, [[]] * len(photos), boxes)
    agreements = [
        iou(page, mask_from_box(rgb, box)) for rgb, box, page in zip(photos, boxes, pages, strict=True)
    ]
    assert np.mean(agreements) >= 0.9, np.round(agreements, 2)

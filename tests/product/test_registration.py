"""Where a known object lies in another picture, of those that JavaScript's registration is held to as well."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest
from support.registration_cases import FILE

from anyprobe.video.registration import Motion, _motion_of, begin_key, locate_key

pytest.importorskip("cv2", reason="needs the video extra")

CASES = json.loads(FILE.read_text(encoding="utf-8"))
ABOUT = CASES["key"]


def bytes_of(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), np.uint8).reshape(ABOUT["height"], ABOUT["width"]).astype(np.float32)


def motion_of(words: list[float]) -> Motion:
    x, y, angle, scale = words
    return Motion(x=x, y=y, angle=angle, scale=scale)


@pytest.fixture(scope="module")
def key():
    return begin_key(bytes_of(ABOUT["picture"]), bytes_of(ABOUT["mask"]) / 255)


def corners(motion: Motion, radius: float) -> np.ndarray:
    """[4, 2] where places at the object's radius come to lie."""
    about = radius * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    return about @ motion.matrix().T + (motion.x, motion.y)


@pytest.mark.parametrize("case", CASES["cases"], ids=lambda case: case["name"])
def test_an_object_is_where_it_was_moved_to(key, case):
    found = locate_key(key, bytes_of(case["picture"]), motion_of(case["start"]), tuple(case["offset"]))
    assert found.is_sure == (case["truth"] is not None)
    if case["truth"] is None:
        return
    off = np.abs(corners(found.motion, ABOUT["radius"]) - corners(motion_of(case["truth"]), ABOUT["radius"])).max()
    assert off < (0.9 if "shadow" in case["name"] else 0.3)
    assert found.error_px < 1.5


@pytest.mark.parametrize("warp", [[[1, 0, 0], [0, -1, 0]], [[0, 0, 0], [0, 0, 0]], [[np.nan, 0, 0], [0, 1, 0]]])
def test_a_warp_that_is_no_motion_of_an_object_is_none(key, warp):
    assert _motion_of(key, np.array(warp, np.float64), np.zeros(2)) is None

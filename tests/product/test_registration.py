"""Where a known object lies in another picture: the vectors that JavaScript is held to as well."""

from __future__ import annotations

import base64
import json

import numpy as np
import pytest
from support.registration_cases import FILE

from anyprobe.video.registration import Motion, begin_key, locate_key

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


def corners(motion: Motion, key) -> np.ndarray:
    """[4, 2] where places at the object's radius come to lie."""
    about = key.radius * np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    return about @ motion.matrix().T + (motion.x, motion.y)


def test_the_key_is_that_of_the_vectors(key):
    np.testing.assert_allclose(key.center, ABOUT["center"])
    assert (key.radius, key.fine, key.coarse) == (pytest.approx(ABOUT["radius"]), ABOUT["fine"], ABOUT["coarse"])
    for level, wanted in zip(key.levels, ABOUT["levels"], strict=True):
        assert len(level.rows) == wanted["points"]
        np.testing.assert_allclose(level.rows.sum(axis=0), wanted["rows_sum"], rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("case", CASES["cases"], ids=lambda case: case["name"])
def test_an_object_is_where_the_vectors_have_it(key, case):
    found = locate_key(key, bytes_of(case["picture"]), motion_of(case["start"]), tuple(case["offset"]))
    assert found.is_sure == case["is_sure"]
    if case["truth"] is None:
        assert not found.is_sure
        return
    assert np.abs(corners(found.motion, key) - corners(motion_of(case["motion"]), key)).max() < 0.01
    off = np.abs(corners(found.motion, key) - corners(motion_of(case["truth"]), key)).max()
    assert off < (0.5 if "shadow" in case["name"] else 0.2)
    for part in ("alike", "inside", "agreed", "error_px"):
        assert getattr(found, part) == pytest.approx(case[part], abs=0.005), part

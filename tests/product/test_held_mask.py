"""A mask that is found once and moved with its object."""

from __future__ import annotations

import numpy as np
import pytest
from support.refused import refused

from anyprobe.errors import InvalidMask
from anyprobe.notices import give
from anyprobe.video import following
from anyprobe.video.clip import Frame
from anyprobe.video.following import MaskFollower
from anyprobe.video.held_mask import follow, found_in, hold, mask_in, narrowed
from anyprobe.video.registration import Motion

SHAPE = (240, 320)


def frame(motion: Motion | None = None, seed: int = 1, lit: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """A shaded egg before a bright wall, [240, 320, 3] uint8, and where it is, [240, 320] bool; lit: from the right."""
    motion = motion or Motion()
    y, x = np.mgrid[0 : SHAPE[0], 0 : SHAPE[1]] + 0.5
    places = np.stack([x - 150 - motion.x, y - 120 - motion.y], axis=-1) @ np.linalg.inv(motion.matrix()).T
    u, v = np.moveaxis(places, -1, 0)
    inside = np.clip(50.0 - np.hypot(u, 1.3 * v) + 0.5, 0.0, 1.0)
    object_ = 90.0 + lit * u - 0.4 * v + 12.0 * np.sin(0.12 * u)
    seen = inside * object_ + (1.0 - inside) * (215.0 + 0.06 * x)
    seen = seen + np.random.default_rng(seed).normal(0.0, 2.0, SHAPE)
    return np.clip(np.round(seen), 0, 255).astype(np.uint8)[..., None].repeat(3, axis=-1), inside


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return float(((one > 0.5) & (other > 0.5)).sum() / ((one > 0.5) | (other > 0.5)).sum())


def test_a_mask_moves_with_its_object_by_fractions_of_a_pixel():
    held = hold(*frame())
    for index in range(1, 8):
        truth = Motion(x=3.3 * index, y=-1.7 * index, angle=0.015 * index, scale=0.012 * index)
        rgb, inside = frame(truth, seed=index)
        found = found_in(held, rgb)
        assert found.is_sure
        held = follow(held, rgb, found)
        beside = np.abs(mask_in(held, SHAPE) - inside)
        assert iou(mask_in(held, SHAPE), inside) > 0.985
        assert beside.max() < 0.6  # nowhere off by a pixel


def test_another_picture_is_not_taken_for_the_object(rng):
    held = hold(*frame())
    assert not found_in(held, rng.integers(0, 255, (*SHAPE, 3)).astype(np.uint8)).is_sure
    assert not found_in(held, np.full((*SHAPE, 3), 128, np.uint8)).is_sure


@pytest.mark.parametrize("pixels", [1.0, 2.0])
def test_a_narrowed_mask_lies_inside(pixels):
    inside = frame()[1]
    rows, columns = (np.flatnonzero((inside > 0.5).any(axis=axis)) for axis in (1, 0))
    narrow = narrowed(inside, pixels) > 0.5
    assert np.flatnonzero(narrow.any(axis=0))[0] == columns[0] + int(pixels)
    assert np.flatnonzero(narrow.any(axis=1))[-1] == rows[-1] - int(pixels)
    assert narrow.sum() > (narrowed(inside, pixels + 0.6) > 0.5).sum()


def test_an_object_looks_other_where_its_light_changes_and_where_it_changes_back():
    held, same = hold(*frame()), ""
    for index in range(1, 40):
        rgb, _ = frame(seed=index, lit=0.2 if 10 <= index < 25 else 0.5)
        held = follow(held, rgb, found_in(held, rgb))
        same += "y" if held.looks_same else "n"
    until = [same.index("n"), same.index("n", 15)]
    assert until == [9, 24], same
    assert same.count("n") <= 10, same


@pytest.mark.ci
def test_one_odd_frame_changes_nothing_after_it(rng, monkeypatch):
    looked = []

    def looked_for(rgb, last, segmenter):
        looked.append(last)
        return np.roll(frame()[1], 30, axis=1).astype(np.float32)

    monkeypatch.setattr(following, "_looked_for", looked_for)
    follower = MaskFollower({}, {"box": (95, 75, 205, 165)}, {})
    masks = []
    for index in range(5):
        rgb = frame(seed=index)[0] if index != 2 else rng.integers(0, 255, (*SHAPE, 3)).astype(np.uint8)
        masks.append(follower.photo(Frame(index=index, time_s=index / 15, rgb=rgb)).mask)
    assert len(looked) == 1
    assert iou(masks[1], masks[2]) < 0.8
    assert iou(masks[1], masks[3]) > 0.98
    assert iou(masks[1], masks[4]) > 0.98


def shown(rgb: np.ndarray, index: int = 0) -> Frame:
    return Frame(index=index, time_s=index / 15, rgb=rgb)


@pytest.fixture
def lost() -> MaskFollower:
    """A follower of four frames that loses the object in the fifth, which is of one colour."""
    follower = MaskFollower({}, {"box": (95, 75, 205, 165)}, {})
    for index in range(4):
        follower.photo(shown(frame(seed=index)[0], index))
    assert follower.looks_same
    with pytest.raises(InvalidMask) as error:
        follower.photo(shown(np.full((*SHAPE, 3), 128, np.uint8), 4))
    follower.error = error.value.notice
    return follower


@pytest.mark.ci
def test_a_lost_object_does_not_look_the_same(lost):
    assert not lost.looks_same
    lost.photo(shown(frame(seed=5)[0], 5))
    assert lost.looks_same


@pytest.mark.ci
def test_a_lost_object_is_not_called_a_wrong_click(lost):
    """Nobody clicked: the follower looked where the last mask was."""
    assert (lost.error.code, lost.error.source, lost.error.remedy) == ("no-object", "frame 4", give("mask"))
    assert "lost in this frame" in lost.error
    assert "click" not in lost.error


@pytest.mark.ci
@pytest.mark.parametrize("rgb", [np.zeros(SHAPE, np.uint8), np.zeros((*SHAPE, 3), np.float32), [[0]]])
def test_a_frame_of_other_pixels_is_refused(rgb):
    with refused("rgb", code="invalid-image", source="frame 3"):
        shown(rgb, 3)

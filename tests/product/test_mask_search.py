"""Which object is meant: windows, parts and prompts, with networks that are drawn instead of learned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.refused import refused

from anyprobe.core.resample import resample
from anyprobe.errors import InvalidMask
from anyprobe.masks.find import doubt, expected_iou, find_mask
from anyprobe.masks.search import Looks, Prompts, find_object
from anyprobe.pictures.images import read_image

HEIGHT, WIDTH = 240, 320


class Redness:
    """What is red stands out, at 320 x 320; least: share of the picture that it must cover to be seen."""

    name, warning, takes_prompts = "u2netp", "", False

    def __init__(self, least: float = 0.0) -> None:
        self.least, self.looks = least, []

    def cover(self, rgb, on=(), off=(), box=None):
        self.looks.append((rgb.shape[:2], tuple(on), tuple(off), box))
        small = resample(rgb, (320, 320), smooth=True)
        red = np.clip(2 * (small[..., 0] - small[..., 2]), 0, 1)
        return red if (red > 0.5).mean() > self.least else np.zeros_like(red)


def disc(x: float, y: float, radius: float, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    return np.clip(radius + 0.5 - np.hypot(columns - x, rows - y), 0, 1).astype(np.float32)


def photo(*objects: np.ndarray, color=(0.9, 0.2, 0.1)) -> np.ndarray:
    cover = np.max(objects, axis=0)[..., None]
    return (cover * np.float32(color) + (1 - cover) * np.float32((0.3, 0.35, 0.4))).astype(np.float32)


def iou(one: np.ndarray, other: np.ndarray) -> float:
    return ((one > 0.5) & (other > 0.5)).sum() / ((one > 0.5) | (other > 0.5)).sum()


def found(rgb: np.ndarray, network=None, **prompts) -> np.ndarray:
    return find_mask(read_image(rgb), segmenter=network or Redness(), **prompts).mask


LARGE, LITTLE = disc(100, 110, 60), disc(250, 150, 30)


def test_without_a_prompt_the_largest_part_is_the_object():
    assert iou(found(photo(LARGE, LITTLE)), LARGE) > 0.97


def test_a_click_chooses_the_part_under_it_and_an_excluding_one_takes_its_part_away():
    rgb = photo(LARGE, LITTLE)
    assert iou(found(rgb, click=(250, 150)), LITTLE) > 0.97
    assert iou(found(rgb, exclude=(100, 110)), LITTLE) > 0.97
    both = found(rgb, click=[(250, 150), (100, 110)])
    assert iou(both, np.maximum(LARGE, LITTLE)) > 0.97


def test_a_box_is_looked_at_with_a_margin_and_clips_the_answer():
    network = Redness()
    mask = found(photo(LARGE, LITTLE), network, box=(30, 40, 140, 200))
    (first, *_), (second, *_) = network.looks
    assert first == (160 + 2 * 20, 110 + 2 * 20)  # 12 % of 160 to every side, whole pixels
    assert second[1] < first[1]
    assert iou(mask[:, :140], LARGE[:, :140]) > 0.97
    assert mask[:, 142:].max() < 0.5
    assert mask[110, 139] > 0.5


def test_the_second_look_is_mirrored_and_gets_the_prompts_there():
    network = Redness()
    find_object(Looks(network, photo(LARGE)), Prompts(on=[(70, 110)]))
    (whole, on, *_), (window, mirrored, *_) = network.looks
    assert (whole, on) == ((HEIGHT, WIDTH), ((70, 110),))
    left, right = 40 - 0.12 * 120, 160 + 0.12 * 120
    assert window[1] == pytest.approx(right - left, abs=3)
    assert mirrored[0][0] == pytest.approx(right - 70, abs=2)


def test_what_a_box_cuts_off_is_known():
    looks = Looks(Redness(), photo(LARGE))
    whole, half = (find_object(looks, Prompts(box=box)).cut for box in ((30, 40, 170, 180), (30, 40, 100, 180)))
    assert whole == 0
    assert half == pytest.approx(0.27, abs=0.02)  # its straight side over the perimeter, in cells


def test_a_click_finds_what_only_stands_out_in_a_window_around_it():
    network = Redness(least=0.1)
    rgb = photo(LITTLE)
    with refused(code="no-object", source="array", kind=InvalidMask):
        found(rgb, network)
    assert iou(found(rgb, network, click=(250, 150)), LITTLE) > 0.95


def test_a_click_on_what_the_whole_look_missed_takes_two_looks_more():
    network = Redness(least=0.1)
    find_object(Looks(network, photo(disc(250, 150, 45))), Prompts(on=[(250, 150)]))
    assert len(network.looks) == 3


def test_a_further_click_takes_no_look_where_one_before_shows_the_object():
    network = Redness()
    looks = Looks(network, photo(LARGE, LITTLE, disc(20, 20, 8)))
    counts = []
    for on in ([], [(100, 110)], [(250, 150)], [(100, 110), (250, 150)], [(20, 20)]):
        mask = find_object(looks, Prompts(on=on)).mask(WIDTH, HEIGHT)
        counts.append(len(network.looks))
    assert counts == [2, 2, 2, 2, 3]  # what is small in them is looked at closer
    assert iou(mask, disc(20, 20, 8)) > 0.9


def test_a_further_click_on_what_was_found_around_the_last_one_takes_no_look():
    network = Redness(least=0.1)
    looks = Looks(network, photo(LITTLE))
    first = find_object(looks, Prompts(on=[(250, 150)]))
    taken = len(network.looks)
    again = find_object(looks, Prompts(on=[(262, 160)]))
    assert (len(network.looks), again.window) == (taken, first.window)


def test_an_excluding_click_on_the_one_part_cuts_it_along_colours():
    left, right = disc(110, 120, 50), disc(200, 120, 45)
    rgb = photo(left, right)
    rgb[right > left] = (0.95, 0.5, 0.1)  # they touch, and are of other reds
    assert iou(found(rgb, click=(100, 120)), np.maximum(left, right)) > 0.95
    mine, other = (right <= left) & (left > 0.5), right > left
    assert iou(found(rgb, click=(100, 120), exclude=(215, 120)), mine) > 0.9
    assert iou(found(rgb, click=(215, 120), exclude=(100, 120)), other & (right > 0.5)) > 0.9
    assert iou(found(rgb, exclude=(215, 120)), mine) > 0.9  # where nothing is clicked, what is farthest is meant


def test_a_handle_is_seen_through_and_pinholes_are_filled():
    ring = LARGE - disc(100, 110, 35)
    assert found(photo(ring))[110, 100] < 0.5
    pinned = LARGE * (1 - disc(100, 110, 4))
    assert found(photo(pinned))[110, 100] > 0.5


def test_edges_stay_as_soft_as_the_network_gives_them():
    mask = found(photo(LARGE))
    edge = mask[110, 150:170]
    assert ((edge > 0.05) & (edge < 0.95)).sum() >= 2
    assert np.all(np.diff(edge) <= 1e-6)


def test_another_look_that_disagrees_makes_a_mask_doubtful():
    class Fickle(Redness):
        def cover(self, rgb, on=(), off=(), box=None):
            red = super().cover(rgb, on, off, box)
            return red if len(self.looks) == 1 else red * (np.arange(320) < 70)

    sure, doubtful = (find_mask(read_image(photo(LARGE)), segmenter=one()) for one in (Redness, Fickle))
    assert sure.warnings == ()
    assert doubtful.confidence < sure.confidence - 0.1
    assert doubtful.warnings[0].code == "mask-doubtful"


def test_what_speaks_against_a_mask_lowers_what_to_expect_and_is_named():
    good = find_object(Looks(Redness(), photo(LARGE)), Prompts())
    bad = replace(good, cut=0.3, flat=0.3)
    assert expected_iou(good) > 0.9
    assert expected_iou(bad) < expected_iou(good) - 0.4
    assert "hardly changes" in doubt(replace(good, flat=0.3))
    assert "box cuts" in doubt(bad)
    assert "blurred" in doubt(replace(good, cover=good.cover / 2))


def test_an_outline_across_which_the_picture_hardly_changes_is_doubted():
    class Certain(Redness):
        def cover(self, rgb, on=(), off=(), box=None):
            return (super().cover(rgb) > 0.5).astype(np.float32)

    fading = LARGE * np.linspace(1.2, -1.2, WIDTH, dtype=np.float32).clip(0, 1)
    whole, half = (find_object(Looks(Certain(), photo(cover)), Prompts()) for cover in (LARGE, fading))
    assert (whole.flat, expected_iou(whole) > 0.9) == (0.0, True)
    assert half.flat > 0.2
    assert expected_iou(half) < expected_iou(whole) - 0.15
    assert "hardly changes" in doubt(half)

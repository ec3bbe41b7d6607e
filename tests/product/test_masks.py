"""Finding the object: by depth, by somebody else's function, by clicks, and by our own network."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from anyprobe.errors import InvalidMask, ModelError
from anyprobe.estimate.outputs import EDGE, draw_overlay
from anyprobe.estimate.photo import load_photo
from anyprobe.files.images import read_image
from anyprobe.masks import find
from anyprobe.masks.cut import Cut, cut_out, tidy
from anyprobe.masks.depth import mask_from_depth, read_depth
from anyprobe.masks.find import find_mask, require_plausible
from anyprobe.masks.prompts import BOX_LEVEL, check_clicks, draw_prompts
from anyprobe.masks.propose import SIZE, Letterbox, MaskNetwork, Proposal, keep_large_parts, shared_network
from anyprobe.masks.quality import DOUBTFUL, Evidence, _apart, examine
from anyprobe.masks.refine import box_mean, refine, resize
from anyprobe.masks.regions import fill_holes, label_parts

GREY = np.full((120, 160, 3), 0.5, np.float32)


def disc(height: int, width: int, x: float, y: float, radius: float) -> np.ndarray:
    rows, columns = np.mgrid[0:height, 0:width] + 0.5
    return (np.hypot(columns - x, rows - y) < radius).astype(np.float32)


def overlap(one: np.ndarray, other: np.ndarray) -> float:
    a, b = one > 0.5, other > 0.5
    return (a & b).sum() / (a | b).sum()


def vase(project_root) -> tuple[np.ndarray, np.ndarray]:
    """The bundled example as an opaque photo, and its true mask."""
    pixels = read_image(project_root / "examples" / "vase.png")
    return pixels.rgb, pixels.alpha


@pytest.fixture
def project_root(request):
    return request.config.rootpath


# Depth


def test_depth_is_cut_between_near_and_far():
    depth = np.full((60, 80), 2000, np.uint16)
    depth[10:50, 20:60] = 800  # the object
    depth[50:, :] = 500  # something in front
    depth[20, 30] = 0  # not measured
    mask = mask_from_depth(depth, (120, 160), near=600, far=900)
    assert mask.shape == (120, 160)
    assert mask[20:100, 40:120].mean() == pytest.approx(1 - 4 / 6400)  # one depth pixel covers four
    assert mask.sum() == 6396
    assert mask_from_depth(depth, (120, 160), far=900)[119, 0] == 1.0
    assert mask_from_depth(depth, (120, 160), near=900).sum() == 120 * 160 - 6400 - 20 * 160


def test_depth_files_agree(tmp_path):
    depth = np.full((48, 64), 3.0, np.float32)
    depth[10:40, 10:40] = 1.0
    np.save(tmp_path / "depth.npy", depth)
    Image.fromarray((depth * 1000).astype(np.uint16)).save(tmp_path / "depth.png")
    Image.fromarray(depth).save(tmp_path / "depth.tiff")
    for name in ("Z", "Depth.V", "R"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {name: depth}).write(str(tmp_path / f"{name}.exr"))
    for path in tmp_path.iterdir():
        unit = 1000 if path.suffix == ".png" else 1
        np.testing.assert_allclose(read_depth(path), depth * unit)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"near": None, "far": None}, ("--near", "--far")),
        ({"near": 5.0, "far": 2.0}, ("near < far", "5", "2")),
        ({"near": 10.0, "far": 20.0}, ("found none", "1 to 3")),
        ({"shape": (48, 48)}, ("48 x 48", "64 x 48")),
        ({"source": np.zeros((48, 64, 3), np.float32)}, ("one depth a pixel",)),
        ({"source": np.zeros((48, 64), np.float32)}, ("none above zero",)),
        ({"source": "gone.png"}, ("gone.png", "no such file")),
    ],
)
def test_unusable_depth_is_one_line(change, words):
    depth = np.full((48, 64), 3.0, np.float32)
    depth[10:40, 10:40] = 1.0
    with pytest.raises(InvalidMask) as caught:
        mask_from_depth(**{"source": depth, "shape": (48, 64), "near": 0.5, "far": 1.5, **change})
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_depth_that_is_no_picture(tmp_path):
    for name in ("a.png", "a.exr", "a.npy", "a.txt"):
        (tmp_path / name).write_text("nothing")
        with pytest.raises(InvalidMask, match=name):
            read_depth(tmp_path / name)


# Somebody else's function


@pytest.mark.parametrize("kind", [bool, np.uint8, np.float32, np.int64])
def test_a_function_gets_bytes_and_gives_the_mask(kind):
    true = disc(120, 160, 60, 50, 30)
    seen = []

    def segment(rgb):
        seen.append(rgb)
        return (true * (255 if kind is np.uint8 else 1)).astype(kind)[None]

    photo = load_photo(GREY, mask=segment)
    assert photo.mask_source == "function"
    assert (seen[0].shape, seen[0].dtype) == ((120, 160, 3), np.uint8)
    assert seen[0].min() == seen[0].max() == 128
    np.testing.assert_array_equal(photo.mask > 0.5, true > 0.5)


@pytest.mark.parametrize("answer", [None, np.zeros((120, 160)), np.ones((60, 80)), np.ones((3, 120, 160))])
def test_a_function_that_gives_no_mask(answer):
    with pytest.raises(InvalidMask) as caught:
        load_photo(GREY, mask=lambda rgb: answer)
    assert "\n" not in str(caught.value)


# Prompts and where they go


def test_prompt_channel():
    hint = draw_prompts(SIZE, on=[(40.5, 30.5)], off=[(100.5, 90.5)], box=(20, 10, 60, 50))
    assert hint[30, 40] == 1.0
    assert hint[90, 100] == -1.0
    assert hint[30, 44] == pytest.approx(np.exp(-0.5))
    assert hint[90, 104] == pytest.approx(-np.exp(-0.5))
    assert hint[12, 58] == hint[10, 20] == hint[49, 59] == BOX_LEVEL
    assert hint[50, 60] == pytest.approx(0.0, abs=1e-6)
    assert draw_prompts(SIZE).any() == False  # noqa: E712


def test_letterbox_centres_the_photo_and_points_follow():
    rgb = np.zeros((300, 600, 3), np.float32)
    rgb[140:160, 290:310] = 1.0
    box = Letterbox.around((0, 0), (600, 300))
    square = box.square(rgb)
    assert square.shape == (SIZE, SIZE, 3)
    assert (square[:40] == 0.5).all()
    assert (square[120:] == 0.5).all()
    assert box.point(300, 150) == (80.0, 80.0)
    bright = np.argwhere(square[40:120, :, 0] > 0.5) + [40, 0]
    np.testing.assert_allclose(bright.mean(axis=0) + 0.5, (80, 80))
    assert box.cut(square[..., 0]).shape == (80, 160)


@pytest.mark.parametrize("clicks", [(200, 50), [(10, 10), (-1, 5)], "ab", [(1, 2, 3)], (np.nan, 4)])
def test_clicks_outside_are_refused(clicks):
    with pytest.raises(InvalidMask, match="X,Y"):
        check_clicks(clicks, 160, 120)


def test_one_click_or_several():
    assert check_clicks((3, 4), 160, 120) == [(3.0, 4.0)]
    assert check_clicks([(3, 4), (5, 6)], 160, 120) == [(3.0, 4.0), (5.0, 6.0)]
    assert check_clicks((), 160, 120) == []


# The network


def test_loose_specks_go_and_large_parts_stay():
    mask = np.zeros((60, 60), bool)
    mask[5:25, 5:25] = mask[35:50, 35:50] = mask[55:58, 2:5] = True
    kept = keep_large_parts(mask)
    assert kept[10, 10]
    assert kept[40, 40]
    assert not kept[56, 3]
    assert not keep_large_parts(np.zeros((8, 8), bool)).any()


def test_contract_of_the_graph():
    """Other programs run this file by these names and shapes."""
    onnxruntime = pytest.importorskip("onnxruntime")
    from anyprobe.masks.propose import default_graph

    assert 1e6 < default_graph().stat().st_size < 5e6
    session = onnxruntime.InferenceSession(str(default_graph()), providers=["CPUExecutionProvider"])
    (put,), (got,) = session.get_inputs(), session.get_outputs()
    assert (put.name, put.shape, put.type) == ("input", [1, 4, 160, 160], "tensor(float)")
    assert (got.name, got.shape, got.type) == ("output", [1, 1, 160, 160], "tensor(float)")
    answer = session.run(None, {"input": np.random.default_rng(0).random((1, 4, 160, 160), np.float32)})[0]
    assert 0.0 <= answer.min() <= answer.max() <= 1.0


def test_a_graph_of_another_contract_is_refused(tmp_path):
    from anyprobe.estimate.runtime import weights_folder

    with pytest.raises(ModelError, match="stage"):
        MaskNetwork(weights_folder("paper") / "hdr.onnx")
    (tmp_path / "mask.onnx").write_text("nothing")
    for path in (tmp_path / "mask.onnx", tmp_path / "gone.onnx"):
        with pytest.raises(ModelError, match="reinstall"):
            MaskNetwork(path)


def test_told_nothing_the_example_is_found(project_root):
    rgb, true = vase(project_root)
    photo = load_photo(rgb)
    assert photo.mask_source == "network"
    assert photo.mask_confidence > 0.6
    assert overlap(photo.mask, true) > 0.75


def test_a_click_and_a_box_find_it_too(project_root):
    rgb, true = vase(project_root)
    rows, columns = np.nonzero(true > 0.5)
    point = (float(columns.mean()), float(rows.mean()))
    box = (columns.min() - 5.0, rows.min() - 5.0, columns.max() + 6.0, rows.max() + 6.0)
    for given, source, least in (
        ({"click": point}, "click", 0.8),
        ({"box": box}, "box", 0.6),
        ({"click": point, "box": box}, "click", 0.95),
    ):
        found = find_mask(read_image(rgb), **given)
        assert found.source == source
        assert overlap(found.mask, true) > least


def two_colors(true: np.ndarray) -> np.ndarray:
    """[H, W, 3]: a reddish object on blue."""
    return np.where(true[..., None] > 0.5, (0.7, 0.3, 0.2), (0.3, 0.4, 0.5)).astype(np.float32)


def test_cutting_out_follows_the_photo_and_believes_clicks_and_the_box():
    true = disc(240, 320, 160, 120, 70)
    rgb = two_colors(true)
    rough = disc(60, 80, 41, 29.5, 16.5)
    assert overlap(resize(rough, 320, 240), true) < 0.9
    assert overlap(cut_out(rgb, rough).mask, true) > 0.97
    assert cut_out(rgb, np.zeros((60, 80), np.float32)) is None
    clicked = cut_out(rgb, rough, on=[(160, 120)], off=[(200, 120)]).mask
    assert clicked[120, 160] > 0.9
    assert clicked[120, 200] < 0.1
    boxed = cut_out(rgb, rough, box=(0, 0, 320, 120)).mask
    assert boxed[100, 160] > 0.9
    assert boxed[130:].max() < 0.1


def test_a_mask_is_one_object_without_pinholes():
    true = disc(240, 320, 120, 120, 70)
    cover = np.maximum(true, disc(240, 320, 290, 40, 12))
    cover[118:123, 100:105] = 0.0  # smaller than any handle's hole
    for cut in (cut_out(two_colors(cover), cover), tidy(two_colors(true), cover)):
        assert cut.mask[120, 102] > 0.5
        assert cut.mask[40, 290] < 0.5
        assert cut.loose == pytest.approx(disc(240, 320, 290, 40, 12).sum() / cover.sum(), abs=0.01)
    ring = true - disc(240, 320, 120, 120, 30)
    assert tidy(two_colors(ring), ring).mask[120, 120] < 0.5


def test_parts_are_those_that_touch(rng):
    pattern = rng.random((17, 23)) < 0.5
    labels, sizes = label_parts(pattern)
    assert sizes.sum() == pattern.size
    assert ((labels > 0) == pattern).all()
    for axis in (0, 1):
        near = [pattern.take(range(start, pattern.shape[axis] - 1 + start), axis) for start in (0, 1)]
        both = near[0] & near[1]
        one, other = (labels.take(range(start, pattern.shape[axis] - 1 + start), axis)[both] for start in (0, 1))
        np.testing.assert_array_equal(one, other)
    assert label_parts(np.eye(5, dtype=bool))[1].tolist() == [20, 1, 1, 1, 1, 1]  # corners do not touch
    spiral = np.ones((9, 9), bool)
    spiral[1, 1:8] = spiral[1:8, 7] = spiral[7, 2:8] = spiral[3:8, 2] = spiral[3, 2:6] = False
    assert len(label_parts(spiral)[1]) == 2
    assert fill_holes(spiral).sum() == spiral.sum()


def good_evidence(**worse) -> Evidence:
    names = ("expected", "mirrored", "darker", "kept", "one_part", "told_apart", "apart", "edge")
    good = dict.fromkeys(names, 0.95)
    return Evidence(**{**good, "border": 0.0, "small": 0.0, "large": 0.0, **worse})


def test_what_speaks_against_a_mask_lowers_what_to_expect():
    best = good_evidence().expected_iou()
    assert best > DOUBTFUL
    assert good_evidence().doubts() == []
    for name, value in (("mirrored", 0.1), ("apart", 0.3), ("expected", 0.3), ("edge", 0.2)):
        assert good_evidence(**{name: value}).expected_iou() < best, name
    assert good_evidence(mirrored=0.1, expected=0.5).expected_iou() < DOUBTFUL
    assert "in another way" in good_evidence(darker=0.1).doubts()[0]
    assert "same colours" in good_evidence(apart=0.5).doubts()[0]
    assert "several parts" in good_evidence(one_part=0.3).doubts()[0]


@pytest.mark.parametrize(("part", "apart"), [("whole", 1.0), ("half", 0.75), ("more", 0.75)])
def test_a_part_of_an_object_has_its_colours_beside_it(part, apart):
    """So has a mask that took surroundings in."""
    rows, columns = np.mgrid[0:120, 0:160]
    inside = np.hypot(columns - 80, rows - 60) < 35
    rng = np.random.default_rng(1)
    rgb = np.where(inside[..., None], (0.8, 0.3, 0.2), (0.3, 0.4, 0.5)) + 0.03 * rng.normal(size=(120, 160, 3))
    mask = {"whole": inside, "half": inside & (columns < 80), "more": inside | (columns > 100)}[part]
    found = _apart(np.clip(rgb, 0, 1).astype(np.float32), mask.astype(np.float32))
    assert (found > 0.97) if apart == 1 else (found < apart)


def test_a_doubtful_mask_comes_with_a_warning_that_says_what_to_do(project_root, monkeypatch):
    rgb, _ = vase(project_root)
    found = find_mask(read_image(rgb))
    assert found.warnings == ()
    assert require_plausible(found) is found
    monkeypatch.setattr(find, "DOUBTFUL", 1.1)
    found = find_mask(read_image(rgb))
    (warning,) = found.warnings
    for word in ("may be wrong", "--box X0,Y0,X1,Y1", "--click X,Y", "--mask FILE"):
        assert word in warning
    assert load_photo(rgb).warnings == (warning,)
    with pytest.raises(InvalidMask, match="may be wrong"):
        require_plausible(found)


def test_the_same_object_found_in_another_way_speaks_for_it(project_root):
    rgb, true = vase(project_root)
    network = shared_network()
    there = Cut(mask=true, loose=0.0, told_apart=1.0)
    corner = disc(*true.shape, 0.15 * true.shape[1], 0.15 * true.shape[0], 0.1 * true.shape[0])
    elsewhere = Cut(mask=corner, loose=0.0, told_apart=1.0)
    right, wrong = (examine(network, rgb, Proposal(cover=cut.mask, confidence=0.9), cut) for cut in (there, elsewhere))
    assert right.mirrored > 0.6
    assert wrong.mirrored < 0.2
    assert right.edge > wrong.edge
    assert right.expected_iou() > DOUBTFUL > wrong.expected_iou()


def test_nothing_to_find():
    with pytest.raises(InvalidMask, match="--click X,Y"):
        load_photo(GREY)


def test_near_without_depth():
    with pytest.raises(InvalidMask, match="near: expected depth with it"):
        load_photo(GREY, near=3.0)


# The edge


def test_box_mean_of_a_step():
    step = np.zeros((5, 9, 1))
    step[:, 4:] = 1.0
    np.testing.assert_allclose(box_mean(step, 1)[2, :, 0], [0, 0, 0, 1 / 3, 2 / 3, 1, 1, 1, 1], atol=1e-12)
    np.testing.assert_allclose(box_mean(np.ones((4, 7, 2)), 3), 1.0)


@pytest.mark.parametrize("size", [(300, 400), (900, 1200)])
def test_a_coarse_edge_moves_to_the_photos(size, rng):
    true = disc(*size, size[1] / 2, size[0] / 2, size[0] * 0.3)
    rgb = np.where(true[..., None] > 0.5, (0.7, 0.3, 0.2), (0.3, 0.4, 0.5)) + rng.normal(0, 0.02, (*size, 3))
    rgb = np.clip(rgb, 0, 1).astype(np.float32)
    coarse = disc(120, 160, 81, 59, 36)  # shifted by a pixel of 160
    assert overlap(resize(coarse, size[1], size[0]), true) < 0.955
    assert overlap(refine(rgb, coarse), true) > 0.97


def test_overlay_dims_the_rest_and_draws_the_edge():
    mask = disc(120, 160, 80, 60, 30)
    picture = draw_overlay(GREY, mask, on=[(80, 60)])
    assert picture[5, 5].max() < 0.3
    np.testing.assert_allclose(picture[60, 60], 0.5)
    np.testing.assert_allclose(picture[60, 109], EDGE)
    assert picture[60, 80].tolist() != [0.5] * 3


# The command


def test_mask_command_writes_a_mask_that_estimate_takes(tmp_path, monkeypatch, command, project_root):
    monkeypatch.chdir(tmp_path)
    rgb, true = vase(project_root)
    Image.fromarray((rgb * 255).round().astype(np.uint8)).save("vase.png")
    outcome = command("mask", "vase.png")
    assert outcome.status == 0
    assert "by network" in outcome.out
    assert {p.name for p in (tmp_path / "masks").iterdir()} == {"vase_mask.png", "vase_overlay.png"}
    assert overlap(np.asarray(Image.open("masks/vase_mask.png")) / 255, true) > 0.75
    assert command("estimate", "vase.png", "--mask", "masks", "-o", "light").status == 0
    assert json.loads((tmp_path / "light" / "vase.json").read_text())["mask"]["source"] == "mask"
    assert command("estimate", "vase.png", "-o", "light").status == 0
    stored = json.loads((tmp_path / "light" / "vase.json").read_text())["mask"]
    assert stored["source"] == "network"
    assert 0.5 < stored["confidence"] <= 1.0


def test_mask_command_by_depth(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (160, 120), "grey").save("a.png")
    depth = np.full((120, 160), 2000, np.uint16)
    depth[30:90, 40:100] = 700
    (tmp_path / "depths").mkdir()
    Image.fromarray(depth).save("depths/a_depth.png")
    outcome = command("mask", "a.png", "--depth", "depths", "--near", "500", "--far", "900")
    assert (outcome.status, "by depth" in outcome.out) == (0, True)
    np.testing.assert_array_equal(np.asarray(Image.open("masks/a_mask.png")) > 127, depth == 700)


def test_results_among_the_photos_are_not_photos(tmp_path, monkeypatch, command):
    """A second run over the folder does what the first did; an overlay of no photo is one."""
    monkeypatch.chdir(tmp_path)
    depth = np.full((120, 160), 2000, np.uint16)
    depth[30:90, 40:100] = 700
    for name in ("a", "b", "old_overlay"):
        Image.new("RGB", (160, 120), "grey").save(f"{name}.png")
        (tmp_path / "depths").mkdir(exist_ok=True)
        Image.fromarray(depth).save(f"depths/{name}_depth.png")
    for _ in range(2):
        outcome = command("mask", ".", "-o", ".", "--depth", "depths", "--far", "900")
        assert outcome.status == 0, outcome.err
        assert [line.split(":")[0] for line in outcome.out.splitlines()] == [
            "a_mask.png",
            "b_mask.png",
            "old_overlay_mask.png",
        ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--click", "10"), ("--click", "X,Y")),
        (("--depth", "a.png", "--near", "1", "--exclude", "5,5"), ("--exclude", "got --depth")),
        (("--click", "80,60", "--far", "9"), ("--far: expected --depth",)),
        (("--click", "500,10"), ("X < 160", "500,10")),
        (("--depth", "gone.png", "--near", "1"), ("gone.png",)),
        (("--depth", "a.png", "--box", "1,2,90,90"), ("--depth and --box",)),
        (("--near", "3"), ("--depth",)),
        ((), ("a.png", "--click X,Y")),
    ],
)
def test_mask_command_complains_in_one_line(tmp_path, monkeypatch, command, options, words):
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (160, 120), "grey").save("a.png")
    complaint = command("mask", "a.png", *options).complaint
    for word in words:
        assert word in complaint
    assert not (tmp_path / "masks").exists()


@pytest.mark.parametrize(
    ("whole_iou", "off", "expected"), [(0.9, (), "whole"), (0.3, (), "part"), (0.9, [(50, 30)], "part")]
)
def test_a_click_on_a_part_gets_the_whole_where_that_is_likelier(monkeypatch, whole_iou, off, expected):
    """The network alone finds the whole object, by the click a part of it; the better evidence counts, but never
    against a click beside the object."""
    whole, part = np.zeros((2, 48, 64), np.float32)
    whole[8:40, 8:56] = part[8:40, 8:34] = 1.0
    covers = {"whole": whole, "part": part}

    class Network:
        def propose(self, rgb, on=(), off=(), box=None):
            return Proposal(cover=covers["part" if on else "whole"], confidence=0.9)

    def examined(network, rgb, proposal, *given):
        likely = whole_iou if proposal.cover is whole else 0.6
        return SimpleNamespace(expected_iou=lambda: likely, doubts=list)

    monkeypatch.setattr(find, "shared_network", Network)
    monkeypatch.setattr(find, "cut_out", lambda rgb, cover, *given: Cut(mask=cover, loose=0.0, told_apart=1.0))
    monkeypatch.setattr(find, "examine", examined)
    photo = read_image(np.full((48, 64, 3), 128, np.uint8))
    found = find_mask(photo, click=(12, 12), exclude=off or None)
    np.testing.assert_array_equal(found.mask, covers[expected])

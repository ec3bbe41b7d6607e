"""Finding the object: by depth, by somebody else's function, by clicks, and by our own network."""

from __future__ import annotations

import json

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from support.refused import refused

from anyprobe.errors import ModelError
from anyprobe.estimate.photo import load_photo
from anyprobe.masks.check import look_at_given
from anyprobe.masks.depth import mask_from_depth, read_depth
from anyprobe.masks.find import find_mask
from anyprobe.masks.networks import SMALL_PX, SmallNetwork, default_graph
from anyprobe.masks.parts import fill_holes, label_parts
from anyprobe.masks.prompts import BOX_LEVEL, check_clicks, draw_prompts
from anyprobe.masks.sources import mask_from_file
from anyprobe.pictures.images import read_image

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


# Prompts and where they go


@pytest.mark.parametrize("given", [lambda soft: soft, lambda soft: lambda rgb: soft])
def test_floats_are_the_mask_as_they_are_as_in_javascript(given):
    soft = np.linspace(0, 1, 64 * 64, dtype=np.float32).reshape(64, 64)
    found = find_mask(read_image(np.zeros((64, 64, 3), np.uint8)), mask=given(soft)).mask
    np.testing.assert_allclose(found, soft, atol=1e-6)


def test_prompt_channel():
    hint = draw_prompts(SMALL_PX, on=[(40.5, 30.5)], off=[(100.5, 90.5)], box=(20, 10, 60, 50))
    assert hint[30, 40] == 1.0
    assert hint[90, 100] == -1.0
    assert hint[30, 44] == pytest.approx(np.exp(-0.5))
    assert hint[90, 104] == pytest.approx(-np.exp(-0.5))
    assert hint[12, 58] == hint[10, 20] == hint[49, 59] == BOX_LEVEL
    assert hint[50, 60] == pytest.approx(0.0, abs=1e-6)
    assert draw_prompts(SMALL_PX).any() == False  # noqa: E712


def test_the_small_network_sees_the_whole_photo_centred_and_prompts_follow(monkeypatch):
    rgb = np.zeros((300, 600, 3), np.float32)
    rgb[140:160, 290:310] = 1.0
    seen = []
    network = SmallNetwork()
    monkeypatch.setattr(network, "run", lambda square: seen.append(square) or square[..., 0])
    cover = network.cover(rgb, on=[(300, 150)], box=(0, 0, 300, 300))
    (square,) = seen
    assert square.shape == (SMALL_PX, SMALL_PX, 4)
    assert (square[:40, :, :3] == 0.5).all()
    assert (square[120:, :, :3] == 0.5).all()
    bright = np.argwhere(square[40:120, :, 0] > 0.5) + [40, 0]
    np.testing.assert_allclose(bright.mean(axis=0) + 0.5, (80, 80))
    assert square[80, 80, 3] > 0.9
    assert square[45, 10, 3] == BOX_LEVEL
    assert square[45, 150, 3] == 0
    assert cover.shape == (80, 160)


def test_one_click_or_several():
    assert check_clicks((3, 4), 160, 120) == [(3.0, 4.0)]
    assert check_clicks([(3, 4), (5, 6)], 160, 120) == [(3.0, 4.0), (5.0, 6.0)]
    assert check_clicks((), 160, 120) == []


# The network


def test_contract_of_the_graph():
    """Other programs run this file by these names and shapes."""
    onnxruntime = pytest.importorskip("onnxruntime")
    assert 1e6 < default_graph().stat().st_size < 5e6
    session = onnxruntime.InferenceSession(str(default_graph()), providers=["CPUExecutionProvider"])
    (put,), (got,) = session.get_inputs(), session.get_outputs()
    assert (put.name, put.shape, put.type) == ("input", [1, 4, 160, 160], "tensor(float)")
    assert (got.name, got.shape, got.type) == ("output", [1, 1, 160, 160], "tensor(float)")
    answer = session.run(None, {"input": np.random.default_rng(0).random((1, 4, 160, 160), np.float32)})[0]
    assert 0.0 <= answer.min() <= answer.max() <= 1.0


def test_a_graph_of_another_contract_is_refused(tmp_path):
    from anyprobe.estimate.runtime import weights_folder

    with refused(code="invalid-model", source="hdr.onnx", naming="contract"):
        SmallNetwork(weights_folder("paper") / "hdr.onnx")
    (tmp_path / "mask.onnx").write_text("nothing")
    for path in (tmp_path / "mask.onnx", tmp_path / "gone.onnx"):
        with pytest.raises(ModelError, match="reinstall"):
            SmallNetwork(path)


def test_the_small_network_finds_the_example_and_says_what_is_better(project_root):
    rgb, true = vase(project_root)
    photo = load_photo(rgb, segmenter="small")
    assert photo.mask_source == "network"
    assert overlap(photo.mask, true) > 0.75
    (warning,) = [line for line in photo.warnings if "small mask network" in line]
    assert "anyprobe mask --fetch" in warning


def test_a_click_and_a_box_find_it_too(project_root):
    rgb, true = vase(project_root)
    rows, columns = np.nonzero(true > 0.5)
    point = (float(columns.mean()), float(rows.mean()))
    box = (columns.min() - 5.0, rows.min() - 5.0, columns.max() + 6.0, rows.max() + 6.0)
    for given, source in (({"click": point}, "click"), ({"box": box}, "box"), ({"click": point, "box": box}, "click")):
        found = find_mask(read_image(rgb), segmenter="small", **given)
        assert found.source == source
        assert overlap(found.mask, true) > 0.75


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


def test_a_doubtful_mask_comes_with_a_warning_that_says_what_to_do(project_root, monkeypatch):
    rgb, _ = vase(project_root)
    monkeypatch.setattr("anyprobe.masks.find.DOUBTFUL", 1.1)
    found = find_mask(read_image(rgb), segmenter="small")
    warning = found.warnings[0]
    for word in ("may be wrong", "box=", "click=", "mask="):
        assert word in warning
    assert load_photo(rgb, segmenter="small").warnings == found.warnings
    assert (warning.code, warning.source) == ("mask-doubtful", "array")


def test_a_click_that_marks_nothing_is_said(project_root):
    rgb, mask = vase(project_root)
    inside = tuple(np.argwhere(mask > 0.5).mean(axis=0)[::-1])
    assert find_mask(read_image(rgb), click=[inside], segmenter="small").warnings[:-1] == ()
    both = find_mask(read_image(rgb), click=[inside, (3.0, 100.0)], segmenter="small")
    assert "the click at 3,100;" in both.warnings[0]


# Given masks


def test_an_inverted_mask_and_one_of_few_pixels_are_named():
    true = disc(120, 160, 80, 60, 30)
    assert look_at_given(true)[1] == []
    mask, (line,) = look_at_given(1 - true)
    assert "invert it" in line
    np.testing.assert_array_equal(mask, 1 - true)
    assert "28 x 28 pixels" in look_at_given(disc(120, 160, 80, 60, 14))[1][0]
    close_up = np.ones((120, 160), np.float32)
    close_up[:50] = 0.0  # an object that two thirds of the borders cut
    assert look_at_given(close_up)[1] == []


@pytest.mark.parametrize("color", [(255, 0, 0), (0, 0, 255), (128, 0, 0)])
@pytest.mark.parametrize("kind", ["RGB", "P"])
def test_a_mask_of_any_colour_on_black_is_the_object(color, kind):
    true = disc(120, 160, 80, 60, 30) > 0.5
    labels = Image.fromarray(true.astype(np.uint8), "P")
    labels.putpalette([0, 0, 0, *color])
    found = find_mask(read_image(GREY), mask=labels.convert(kind))
    np.testing.assert_array_equal(found.mask > 0.5, true)


def test_an_overlay_is_read_as_the_object_and_named():
    true = disc(120, 160, 80, 60, 30)
    mask, (line,) = look_at_given(np.float32(0.6) * true)
    assert "at most 0.60" in line
    np.testing.assert_allclose(mask, true, atol=1e-6)
    rgba = np.dstack([np.full((120, 160, 3), 0.5, np.float32), np.float32(0.6) * true])
    found = find_mask(read_image(GREY), mask=rgba)
    assert found.mask.max() == pytest.approx(1.0, abs=0.01)
    assert "overlay" in found.warnings[0]


def test_a_photo_in_the_place_of_a_mask_is_named(rng):
    grey = np.clip(rng.normal(0.5, 0.2, (60, 80)), 0, 1).astype(np.float32)
    assert "grey" in look_at_given(grey)[1][0]


# The command


@pytest.mark.ci
def test_mask_command_writes_a_mask_that_estimate_takes(tmp_path, monkeypatch, command, project_root, small_masks):
    monkeypatch.chdir(tmp_path)
    rgb, true = vase(project_root)
    Image.fromarray((rgb * 255).round().astype(np.uint8)).save("vase.png")
    said = json.loads(command("mask", "vase.png", "--json").out)
    assert [said[name] for name in ("photo", "mask", "source")] == ["vase.png", "masks/vase_mask.png", "network"]
    assert said["share"] == pytest.approx(float(true.mean()), abs=0.05)
    assert {p.name for p in (tmp_path / "masks").iterdir()} == {"vase_mask.png", "vase_overlay.png"}
    assert overlap(np.asarray(Image.open("masks/vase_mask.png")) / 255, true) > 0.75
    assert command("estimate", "vase.png", "--mask", "masks", "-o", "light").status == 0
    assert json.loads((tmp_path / "light" / "vase.json").read_text())["mask"]["source"] == "mask"
    assert command("estimate", "vase.png", "-o", "light").status == 0
    stored = json.loads((tmp_path / "light" / "vase.json").read_text())["mask"]
    assert stored["source"] == "network"
    assert 0.5 < stored["confidence"] <= 1.0
    assert said["confidence"] == stored["confidence"]


def test_mask_command_by_depth(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    Image.new("RGB", (160, 120), "grey").save("a.png")
    depth = np.full((120, 160), 2000, np.uint16)
    depth[30:90, 40:100] = 700
    (tmp_path / "depths").mkdir()
    Image.fromarray(depth).save("depths/a_depth.png")
    given = ("--depth", "depths", "--near", "500", "--far", "900")
    quiet = command("mask", "a.png", *given, "-q")
    assert (quiet.status, quiet.out, quiet.err) == (0, "", "")
    outcome = command("mask", "a.png", *given)
    assert (outcome.status, "by depth" in outcome.out) == (0, True)
    np.testing.assert_array_equal(np.asarray(Image.open("masks/a_mask.png")) > 127, depth == 700)


def test_a_warning_about_several_photos_is_one_line(tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    for name in ("a", "b"):
        Image.new("RGB", (160, 120), "grey").save(f"{name}.png")
        depth = np.zeros((120, 160), np.uint16)
        depth[30:60, 40:70] = 700
        Image.fromarray(depth).save(f"{name}_depth.png")
    outcome = command("mask", "a.png", "b.png", "--depth", ".", "--near", "500")
    assert outcome.status == 0
    (warning,) = outcome.err.splitlines()
    assert warning.startswith("warning: a.png, b.png: the object is only 30 x 30 pixels")


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


@pytest.mark.parametrize(("scale", "kind"), [(255, np.float32), (255, np.int64), (-1, np.float32)])
def test_numbers_that_are_no_mask_are_one_line(scale, kind):
    values = np.zeros((8, 8), kind)
    values[2:6, 2:6] = scale
    with refused("mask"):
        mask_from_file(values, (8, 8))

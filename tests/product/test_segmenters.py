"""Other segmenters: real loading code, on small ONNX files of the models' own signatures that are made here."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from support.refused import refused

from anyprobe.errors import InputError, ModelError
from anyprobe.masks import find, segmenters
from anyprobe.masks.segmenters import Sam, load_segmenter
from anyprobe.pictures.images import read_image

HEIGHT, WIDTH = 90, 160
OBJECT = (slice(20, 70), slice(60, 120))


@pytest.fixture
def photo() -> np.ndarray:
    """[H, W, 3] uint8: a red box on grey."""
    rgb = np.full((HEIGHT, WIDTH, 3), 110, np.uint8)
    rgb[OBJECT] = (220, 40, 30)
    return rgb


def overlap(mask: np.ndarray, area: tuple[slice, slice] = OBJECT) -> float:
    true = np.zeros(mask.shape, bool)
    true[area] = True
    return float(((mask > 0.5) & true).sum() / ((mask > 0.5) | true).sum())


def write_graph(path, nodes, inputs, outputs, constants) -> None:
    onnx = pytest.importorskip("onnx", reason="needs ./train[torch]")
    helper, numpy_helper = onnx.helper, onnx.numpy_helper
    graph = helper.make_graph(
        [helper.make_node(kind, ins, outs, **more) for kind, ins, outs, more in nodes],
        "small",
        [helper.make_tensor_value_info(name, 1, shape) for name, shape in inputs.items()],
        [helper.make_tensor_value_info(name, 1, shape) for name, shape in outputs.items()],
        [numpy_helper.from_array(np.asarray(value), name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    onnx.save(model, str(path))


def write_sam(folder, second: bool, preprocessed: bool = False) -> None:
    """A pair whose encoder keeps the picture's redness and whose decoder answers it, within 40 % of the square around
    the mean of all points that count; the likeliest of three masks is the middle one, the others are its opposite."""
    folder.mkdir()
    shape = [None, None, 3] if preprocessed else [1, 3, 1024, 1024]
    outputs = {"high_res_feats_0": None, "high_res_feats_1": None} if second else {}
    outputs |= {"image_embed" if second else "image_embeddings": None}
    rows = {"red": np.array([0], np.int64), "blue": np.array([2], np.int64)}
    nodes = []
    if preprocessed:  # as the published one: it normalises and pads by itself
        nodes += [
            ("Transpose", ["image"], ["planes"], {"perm": [2, 0, 1]}),
            ("Unsqueeze", ["planes", "zero"], ["batch"], {}),
            ("Shape", ["batch"], ["shape"], {}),
            ("Sub", ["full", "shape"], ["more"], {}),
            ("Concat", ["none", "more"], ["pads"], {"axis": 0}),
            ("Pad", ["batch", "pads"], ["padded"], {}),
        ]
        rows |= {"zero": np.array([0], np.int64), "full": np.array([1, 3, 1024, 1024], np.int64)}
        rows |= {"none": np.zeros(4, np.int64)}
    source = "padded" if preprocessed else "image"
    nodes += [
        ("Gather", [source, "red"], ["r"], {"axis": 1}),
        ("Gather", [source, "blue"], ["b"], {"axis": 1}),
        ("Sub", ["r", "b"], ["difference"], {}),
        ("AveragePool", ["difference"], ["features"], {"kernel_shape": [4, 4], "strides": [4, 4]}),
        *(("Identity", ["features"], [name], {}) for name in outputs),
    ]
    write_graph(
        folder / "small.encoder.onnx", nodes, {"image": shape}, {name: [1, 1, 256, 256] for name in outputs}, rows
    )
    inputs = dict.fromkeys(outputs, [1, 1, 256, 256]) | {
        "point_coords": [1, None, 2],
        "point_labels": [1, None],
        "mask_input": [1, 1, 256, 256],
        "has_mask_input": [1],
    }
    if not second:
        inputs["orig_im_size"] = [2]
    grid = np.stack(np.meshgrid(*[np.arange(256, dtype=np.float32) * 4 + 2] * 2))[None]
    used = "image_embed" if second else "image_embeddings"
    decoder = [
        ("Greater", ["point_labels", "nothing"], ["counts"], {}),
        ("Cast", ["counts"], ["weight"], {"to": 1}),
        ("Unsqueeze", ["weight", "last"], ["weights"], {}),
        ("Mul", ["point_coords", "weights"], ["weighted"], {}),
        ("ReduceSum", ["weighted", "one"], ["sum"], {"keepdims": 0}),
        ("ReduceSum", ["weights", "one"], ["count"], {"keepdims": 0}),
        ("Div", ["sum", "count"], ["mean"], {}),
        ("Reshape", ["mean", "corner"], ["centre"], {}),
        ("Sub", ["grid", "centre"], ["away"], {}),
        ("Abs", ["away"], ["distance"], {}),
        ("ReduceMax", ["distance"], ["far"], {"axes": [1], "keepdims": 1}),
        ("Sub", ["reach", "far"], ["near"], {}),
        ("Sub", [used, "threshold"], ["red_enough"], {}),
        ("Min", ["near", "red_enough"], ["inside"], {}),
        ("Mul", ["inside", "signs"], ["masks"], {}),
        ("Identity", ["scores"], ["iou_predictions"], {}),
    ]
    constants = {
        "nothing": np.float32(-0.5),
        "last": np.array([2], np.int64),
        "one": np.array([1], np.int64),
        "corner": np.array([1, 2, 1, 1], np.int64),
        "grid": grid,
        "reach": np.float32(410),
        "threshold": np.float32(30 if preprocessed else 0.5),
        "signs": np.array([-9.0, 9.0, -9.0], np.float32).reshape(1, 3, 1, 1),
        "scores": np.array([[0.2, 0.9, 0.5]], np.float32),
    }
    outputs = {"masks": [1, 3, 256, 256], "iou_predictions": [1, 3]}
    if not second:
        decoder.append(("Identity", ["masks"], ["low_res_masks"], {}))
        outputs["low_res_masks"] = [1, 3, 256, 256]
    write_graph(folder / "small.decoder.onnx", decoder, inputs, outputs, constants)


@pytest.mark.parametrize(
    ("second", "preprocessed"), [(False, False), (False, True), (True, False)], ids=["sam", "sam-hwc", "sam2"]
)
@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (WIDTH, HEIGHT)])
def test_sam_answers_where_the_prompt_is_whatever_the_photos_shape(tmp_path, photo, second, preprocessed, size):
    write_sam(tmp_path / "sam", second, preprocessed)
    turned = photo if size == (HEIGHT, WIDTH) else photo.transpose(1, 0, 2)
    area = OBJECT if turned is photo else OBJECT[::-1]
    sam = load_segmenter(f"sam:{tmp_path / 'sam'}")
    middle = ((area[1].start + area[1].stop) / 2, (area[0].start + area[0].stop) / 2)
    box = (area[1].start - 4, area[0].start - 4, area[1].stop + 4, area[0].stop + 4)
    assert overlap(sam.segment(turned, [middle], [], None), area) > 0.93
    assert overlap(sam.segment(turned, [], [], box), area) > 0.93
    assert not (sam.segment(turned, [(3.0, 3.0)], [], None) > 0.5)[area][-1, -1]  # far from the click


def test_sam_without_a_prompt_is_asked_with_our_networks_box(tmp_path, photo, monkeypatch):
    asked = []

    class Asked(Sam):
        def segment(self, rgb, on, off, box):
            asked.append(box)
            return super().segment(rgb, on, off, box)

    write_sam(tmp_path / "sam", second=True)
    cover = np.zeros((HEIGHT, WIDTH), np.float32)
    cover[OBJECT] = 1.0

    class Network:
        name, warning, takes_prompts = "u2netp", "", False

        def cover(self, rgb, on=(), off=(), box=None):
            return cover if rgb.shape[:2] == cover.shape else np.pad(np.ones((50, 60), np.float32), 9)

    monkeypatch.setattr(find, "shared_network", Network)
    found = find.find_mask(read_image(photo), segmenter=Asked(str(tmp_path / "sam")))
    ((x0, y0, x1, y1),) = asked
    np.testing.assert_allclose((x0, y0, x1, y1), (60, 20, 120, 70), atol=4)
    assert found.source == "segmenter"
    assert overlap(found.mask) > 0.93


def test_a_folder_that_is_no_pair(tmp_path, photo):
    for name in ("sam", f"sam:{tmp_path}"):
        with pytest.raises((InputError, ModelError), match="encoder"):
            load_segmenter(name)
    write_sam(tmp_path / "sam", second=False)
    (tmp_path / "sam" / "other.encoder.onnx").write_bytes(b"")
    with refused(code="invalid-model", source="sam", naming="2"):
        load_segmenter(f"sam:{tmp_path / 'sam'}")


def test_rembg_that_is_not_installed_names_the_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rembg", None)
    with refused(code="unsupported", naming="[rembg]"):
        load_segmenter("rembg")


class Plugged:
    """A plug-in as others write them."""

    needs_prompt = False

    def __init__(self, argument: str) -> None:
        self.argument = argument

    def segment(self, rgb, on, off, box):
        return (rgb[..., 0] > 200).astype(np.float32)


def plug(monkeypatch, load) -> None:
    entry = SimpleNamespace(name="mine", load=load)
    monkeypatch.setattr(segmenters, "entry_points", lambda group: [entry] if group == segmenters.GROUP else [])


@pytest.mark.usefixtures("small_masks")
def test_a_plug_in_is_found_by_name_and_gets_its_argument(monkeypatch, photo):
    plug(monkeypatch, lambda: Plugged)
    assert load_segmenter("mine:some:thing").argument == "some:thing"
    found = find.find_mask(read_image(photo), segmenter="mine")
    assert found.source == "segmenter"
    assert found.confidence is not None
    assert overlap(found.mask) > 0.99
    assert find.find_mask(read_image(photo), segmenter="mine", click=(90, 45)).source == "click"


@pytest.mark.usefixtures("small_masks")
def test_clicks_choose_among_a_segmenters_parts(photo):
    little = (slice(30, 60), slice(5, 40))
    photo[little] = (220, 40, 30)

    def found(**given):
        return find.find_mask(read_image(photo), segmenter=Plugged(""), **given).mask

    assert overlap(found()) > 0.99
    assert overlap(found(click=(20, 45)), little) > 0.99
    assert overlap(found(exclude=(90, 45)), little) > 0.99
    with refused(code="no-object"):
        found(click=(150, 5))


def test_what_is_no_segmenter(monkeypatch, photo):
    with refused("segmenter"):
        load_segmenter("nobody")
    plug(monkeypatch, lambda: 1 / 0)
    with refused("segmenter", code="invalid-model", source="mine"):
        load_segmenter("mine")
    wrong = Plugged("")
    for answer in (np.zeros((3, 4)), np.full((HEIGHT, WIDTH), np.nan)):
        wrong.segment = lambda *prompts, answer=answer: answer
        with refused("segmenter"):
            find.find_mask(read_image(photo), segmenter=wrong)


@pytest.mark.ci
def test_the_mask_command_takes_a_segmenter(tmp_path, monkeypatch, command, photo):
    plug(monkeypatch, lambda: Plugged)
    monkeypatch.chdir(tmp_path)
    Image.fromarray(photo).save("a.png")
    outcome = command("mask", "a.png", "--segmenter", "mine")
    assert "by segmenter" in outcome.out
    assert overlap(np.asarray(Image.open("masks/a_mask.png")) / 255) > 0.99
    assert "expected one of" in command("mask", "a.png", "--segmenter", "nobody").complaint

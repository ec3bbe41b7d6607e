"""The light network in one graph: what it sees of a photo's pixels, and what it says in the photo's frame."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.estimate.light_graph import INPUTS, OUTPUTS, graph_inputs  # noqa: E402
from anyprobe_train.light.given import Given  # noqa: E402
from anyprobe_train.light.light_export import LeanGraph, write_light  # noqa: E402
from anyprobe_train.light.light_views import LightViews  # noqa: E402
from anyprobe_train.light.network import LeanNet  # noqa: E402
from anyprobe_train.world.batch import ASSUMED_TANGENT  # noqa: E402

pytestmark = pytest.mark.ci


def photo_of(height: int, width: int, box: tuple[int, int, int, int] | None) -> tuple[np.ndarray, np.ndarray]:
    """Draw a smooth photo [H, W, 3], and a mask that fills a box (left, top, right, bottom)."""
    y, x = np.mgrid[:height, :width] / max(height, width)
    rgb = np.stack([0.2 + 0.6 * x, 0.3 + 0.5 * y, 0.5 + 0.3 * np.sin(6 * x + 3 * y)], axis=-1).astype(np.float32)
    mask = np.zeros((height, width), np.float32)
    if box is not None:
        mask[box[1] : box[3], box[0] : box[2]] = 1.0
    return rgb, mask


def given_of(named: dict[str, np.ndarray]) -> Given:
    return Given.of([torch.from_numpy(named[name]) for name in INPUTS])


def test_the_whole_photo_lies_in_the_middle_of_the_square_and_its_means_are_kept() -> None:
    rgb, mask = photo_of(384, 768, (300, 100, 500, 300))
    seen, _ = LightViews()(given_of(graph_inputs(rgb, mask, 50.0, is_lens_known=True)))
    context = seen.context[0]
    assert torch.allclose(context[4, 24:72], torch.ones(48, 96))
    assert float(context[4, :24].abs().max()) == 0.0
    means = rgb.reshape(48, 8, 96, 8, 3).mean(axis=(1, 3)).transpose(2, 0, 1)
    assert np.abs(context[:3, 24:72].numpy() - means).max() < 1e-4
    assert float(seen.lens[0, 0]) == pytest.approx(np.tan(np.radians(25.0)), rel=1e-5)


def test_the_crop_and_its_lens_agree_with_the_object_in_the_photo() -> None:
    rgb, mask = photo_of(600, 400, (60, 380, 160, 480))
    seen, _ = LightViews()(given_of(graph_inputs(rgb, mask, 40.0, is_lens_known=True)))
    half, right, up, side, known = (float(one) for one in seen.lens[0])
    per_pixel = np.tan(np.radians(20.0)) / 300
    assert right == pytest.approx((110 - 200) * per_pixel, abs=per_pixel / 2)
    assert up == pytest.approx(-(430 - 300) * per_pixel, abs=per_pixel / 2)
    assert side == pytest.approx(55 * per_pixel, rel=0.02)
    assert known == 1.0
    assert half == pytest.approx(np.tan(np.radians(20.0)))
    assert float(seen.crop[0, 3, 48, 48]) == pytest.approx(1.0, abs=1e-4)
    assert np.abs(seen.crop[0, :3, 48, 48].numpy() - rgb[430, 110]).max() < 0.01
    assert float(seen.crop[0, 3, 2, 48]) == 0.0


def test_what_is_seen_lies_where_a_pinhole_camera_sees_it_and_not_behind_the_object() -> None:
    rgb, mask = photo_of(480, 640, (280, 200, 360, 280))
    seen = LightViews()(given_of(graph_inputs(rgb, mask, 70.0, is_lens_known=True)))[0].seen[0]
    d = pixel_directions(64)
    focal = 320 / np.tan(np.radians(35.0))
    with np.errstate(divide="ignore"):
        column, row = 320 - focal * d[..., 0] / d[..., 2], 240 + focal * d[..., 1] / d[..., 2]
    inside = (d[..., 2] < -0.1) & (column > 12) & (column < 628) & (row > 12) & (row < 468)
    beside = inside & ((np.abs(column - 320) > 65) | (np.abs(row - 240) > 65))
    assert float(seen[3][torch.from_numpy(beside)].min()) > 0.99
    true = rgb[row[beside].astype(int), column[beside].astype(int)]
    assert np.abs(seen[:3].permute(1, 2, 0).numpy()[beside] - true).max() < 0.03
    hidden = inside & (np.abs(column - 320) < 30) & (np.abs(row - 240) < 30)
    assert float(seen[3][torch.from_numpy(hidden)].max()) < 1e-4
    assert float(seen[3][torch.from_numpy(d[..., 2] > 0)].max()) == 0.0


def test_without_a_lens_the_assumed_one_is_seen_whatever_the_host_assumes() -> None:
    rgb, mask = photo_of(200, 300, None)
    seen, _ = LightViews()(given_of(graph_inputs(rgb, mask, 65.0)))
    assert float(seen.lens[0, 0]) == pytest.approx(ASSUMED_TANGENT)
    assert torch.equal(seen.lens[0, 1:], torch.zeros(4))
    assert float(seen.crop.abs().max()) == 0.0


@pytest.mark.filterwarnings("ignore")  # torch's exporter warns about itself
def test_the_graph_says_all_of_its_outputs_and_a_mirrored_photo_gives_a_mirrored_answer(tmp_path) -> None:
    import onnx

    from anyprobe.files.graphs import onnxruntime

    torch.manual_seed(3)
    net = LeanNet().eval().requires_grad_(False)
    path = tmp_path / "light.onnx"
    assert write_light(net, path, {"name": "untrained", "step": 0}) < 0.03
    assert path.stat().st_size < 10e6
    nodes = onnx.load(str(path)).graph.node
    assert len({node.name for node in nodes}) == len(nodes)  # ONNX Runtime 1.20 opens no others
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    rgb, mask = photo_of(240, 320, (100, 60, 200, 160))
    said = dict(zip(OUTPUTS, session.run(None, graph_inputs(rgb, mask, 60.0)), strict=True))
    assert all(np.isfinite(value).all() for value in said.values())
    turned = graph_inputs(np.ascontiguousarray(rgb[:, ::-1]), np.ascontiguousarray(mask[:, ::-1]), 60.0)
    other = dict(zip(OUTPUTS, session.run(None, turned), strict=True))
    assert np.abs(said["radiance"] - other["radiance"][:, :, ::-1]).max() < 1e-3 * said["radiance"].max()
    assert np.allclose(said["sources"][0, :, 1:4] * [-1, 1, 1], other["sources"][0, :, 1:4], atol=1e-3)
    assert np.allclose(said["posture"] * [1, -1, 1], other["posture"], atol=1e-3)
    with torch.no_grad():
        empty = LeanGraph(net)(*(torch.from_numpy(one) for one in graph_inputs(rgb, 0 * mask, 60.0).values()))
    assert all(bool(torch.isfinite(one).all()) for one in empty)

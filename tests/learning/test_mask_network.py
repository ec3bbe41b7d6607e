"""Scenes for the mask network: what a hint points at is what the answer covers; a run goes on exactly."""

from __future__ import annotations

import csv
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("numba", reason="needs ./train[torch]")

from anyprobe.masks.check import object_box  # noqa: E402
from anyprobe.masks.networks import PADDING_GREY, SMALL_PX, SmallNetwork  # noqa: E402
from anyprobe_train.mask_network.examples import CLOSE_SIDES, MIN_TARGET_PX, PROMPTS, ask, part_around, unasked_target  # noqa: E402
from anyprobe_train.mask_network.mask_export import TOLERANCE, export_mask  # noqa: E402
from anyprobe_train.mask_network.mask_net import MaskNet  # noqa: E402
from anyprobe_train.mask_network.mask_training import MaskRunConfig, mask_loss, small_mask_run, train_mask  # noqa: E402
from anyprobe_train.mask_network.scenes import MaskPhoto, draw_scene, photograph  # noqa: E402
from anyprobe_train.train.checkpoint import load_trained, load_weights, read_init_weights  # noqa: E402


@pytest.fixture(scope="module")
def scenes(small_world):
    return [draw_scene(small_world, 1, number, SMALL_PX) for number in range(12)]


@pytest.fixture(scope="module")
def photos(scenes):
    rng = np.random.default_rng(1)
    return [photograph(rng, scene, scene.whole, SMALL_PX) for scene in scenes]


def two_discs() -> MaskPhoto:
    """A large dark disc left of the middle and a small bright one at the right, in a 3:2 photo."""
    rows, columns = np.mgrid[:SMALL_PX, :SMALL_PX] + 0.5
    large, small = (((rows - 80) ** 2 + (columns - x) ** 2 < r**2).astype(np.float32) for x, r in ((60, 30), (135, 12)))
    photo = np.where(small > 0, 0.95, np.where(large > 0, 0.1, 0.6))[..., None].repeat(3, axis=2)
    photo[:27] = photo[133:] = PADDING_GREY
    return MaskPhoto(photo=photo, covers=np.stack([small, large]), bounds=(27, 133, 0, 160))


@pytest.mark.ci
def test_a_photo_is_of_things_that_hide_one_another(photos):
    assert {len(shot.covers) for shot in photos} >= {1, 2, 3}
    for shot in photos:
        top, bottom, left, right = shot.bounds
        assert 0.0 <= shot.photo.min()
        assert shot.photo.max() <= 1.0
        beside = np.ones((SMALL_PX, SMALL_PX), bool)
        beside[top:bottom, left:right] = False
        assert (shot.photo[beside] == PADDING_GREY).all()
        assert (shot.covers[:, beside] == 0).all()
        assert (shot.covers.sum(axis=0) <= 1 + 1e-5).all()


@pytest.mark.ci
def test_the_same_number_gives_the_same_scene(small_world, scenes):
    again = draw_scene(small_world, 1, 3, SMALL_PX)
    assert np.array_equal(scenes[3].radiance, again.radiance)
    assert not np.array_equal(scenes[3].radiance, scenes[4].radiance)


@pytest.mark.ci
def test_a_close_up_shows_its_object(scenes):
    rng = np.random.default_rng(2)
    for scene in scenes:
        for number in np.flatnonzero(scene.covers.sum(axis=(1, 2)) >= MIN_TARGET_PX):
            shot = photograph(rng, scene, part_around(rng, scene, number), SMALL_PX)
            x0, y0, x1, y1 = object_box(shot.covers[number])
            assert max(x1 - x0, y1 - y0) > 0.7 * SMALL_PX / CLOSE_SIDES[1]


def test_told_nothing_the_large_central_one_is_meant():
    shot = two_discs()
    assert unasked_target(shot) == 1
    assert unasked_target(replace(shot, covers=shot.covers[:0])) is None
    twins = np.stack([shot.covers[1], shot.covers[1][:, ::-1]])
    assert unasked_target(replace(shot, covers=twins)) is None


@pytest.mark.ci
@pytest.mark.parametrize("kind", list(PROMPTS))
def test_a_hint_points_at_its_answer(kind, photos):
    rng = np.random.default_rng(0)
    for shot in [two_discs(), *photos]:
        hint, target = ask(rng, shot, kind)
        if not target.any():
            continue
        assert any(np.array_equal(target, cover) for cover in shot.covers)
        if kind in ("click", "clicks"):
            assert target[hint >= hint.max()].min() > 0.5
        if kind == "clicks" and hint.min() < -0.9:
            assert target[hint <= hint.min()].max() < 0.5
        if kind == "box":
            assert (target * (hint > 0)).sum() / target.sum() > 0.7


def test_what_covers_no_pixel_by_half_is_not_asked_for():
    shot = two_discs()
    faint = replace(shot, covers=0.4 * shot.covers)
    assert not any(one.any() for one in ask(np.random.default_rng(0), faint, "click", 0))


def test_loss_is_least_for_the_answer():
    target = torch.from_numpy(two_discs().covers[1])[None, None]
    sure = (target * 2 - 1) * 12
    assert mask_loss(sure, target) < 0.01
    assert mask_loss(sure, target) < mask_loss(torch.zeros_like(target), target) < mask_loss(-sure, target)
    assert mask_loss(torch.full_like(target, -12.0), torch.zeros_like(target)) < 0.01


@pytest.fixture(scope="module")
def run(small_world):
    """Train a few steps on tiny batches: run(folder, stop_after) -> checkpoint."""

    def call(folder, stop_after=None):
        config = small_mask_run(MaskRunConfig(), 4)
        return train_mask(config, data=None, runs=folder, last=stop_after, world=small_world)

    return call


@pytest.fixture(scope="module")
def checkpoint(run, tmp_path_factory):
    return run(tmp_path_factory.mktemp("straight"))


@pytest.mark.ci
def test_resumed_run_equals_the_straight_one_to_the_bit(run, checkpoint, tmp_path):
    straight = torch.load(checkpoint, weights_only=True)
    part = run(tmp_path, stop_after=2)
    resumed = torch.load(run(tmp_path), weights_only=True)
    assert straight["step"] == resumed["step"] == 4
    for kept in ("net", "moving"):
        for name, value in straight[kept].items():
            assert torch.equal(value, resumed[kept][name]), name
    steps = [row["step"] for row in csv.DictReader(part.with_name("log.csv").read_text().splitlines())]
    assert steps == ["2", "4"]


@pytest.mark.ci
def test_exported_graph_is_the_network(checkpoint, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        difference = export_mask(checkpoint, tmp_path / "mask.onnx")
    assert difference <= TOLERANCE
    net, _ = load_trained(MaskNet(), checkpoint)
    image = torch.rand(1, 4, SMALL_PX, SMALL_PX)
    with torch.no_grad():
        expected = net(image)[0, 0].numpy()
    graph = SmallNetwork(tmp_path / "mask.onnx")
    found = graph.run(image[0].permute(1, 2, 0).numpy())
    assert np.abs(found - expected).mean() < TOLERANCE
    assert (tmp_path / "mask.onnx").stat().st_size < 4_000_000


def test_weights_that_are_kept_of_the_shipped_network_begin_a_run():
    path = Path(__file__).parents[2] / "train" / "checkpoints" / "mask.pt"
    load_weights(MaskNet(), read_init_weights(path)[0], path)

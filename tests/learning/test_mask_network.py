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
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe.masks.networks import PADDING_GREY, SMALL_PX, SmallNetwork  # noqa: E402
from anyprobe_train.dataset.asset_store import AssetStore, draw_map  # noqa: E402
from anyprobe_train.dataset.catalog import MapAsset  # noqa: E402
from anyprobe_train.mask_network.composites import Scene, draw_scene  # noqa: E402
from anyprobe_train.mask_network.examples import PROMPTS, SceneSource, ask, unasked_target  # noqa: E402
from anyprobe_train.mask_network.foregrounds import TexturePool, ViewSource  # noqa: E402
from anyprobe_train.mask_network.mask_export import TOLERANCE, export_mask  # noqa: E402
from anyprobe_train.mask_network.mask_net import MaskNet  # noqa: E402
from anyprobe_train.mask_network.mask_training import (  # noqa: E402
    MaskRunConfig,
    load_mask_net,
    mask_loss,
    small_mask_run,
    train_mask,
)
from anyprobe_train.train.checkpoint import load_weights, read_init_weights  # noqa: E402


@pytest.fixture(scope="module")
def views():
    rng = np.random.default_rng(0)
    radiance = [draw_map(rng, height=32)[0] for _ in range(2)]
    maps = [MapAsset(name="", id=str(k), licence="own", indoor=True, radiance=one) for k, one in enumerate(radiance)]
    return ViewSource(AssetStore(maps), TexturePool(0, 6, radiance), seed=0, size=96)


@pytest.fixture(scope="module")
def scenes(views):
    rng = np.random.default_rng(1)
    view = views.view(0)
    return [draw_scene(rng, view, views.textures, SMALL_PX) for _ in range(30)]


def two_discs() -> Scene:
    """A large dark disc left of the middle and a small bright one at the right, in a 3:2 photo."""
    rows, columns = torch.meshgrid(torch.arange(SMALL_PX) + 0.5, torch.arange(SMALL_PX) + 0.5, indexing="ij")
    large = ((rows - 80) ** 2 + (columns - 60) ** 2 < 30**2).float()
    small = ((rows - 80) ** 2 + (columns - 135) ** 2 < 12**2).float()
    photo = torch.full((3, SMALL_PX, SMALL_PX), 0.6)
    photo = photo * (1 - large) + 0.1 * large
    photo = photo * (1 - small) + 0.95 * small
    photo[:, :27] = photo[:, 133:] = PADDING_GREY
    return Scene(photo=photo, covers=torch.stack([small, large]), bounds=(27, 133, 0, 160))


def test_a_scene_is_a_photo_of_things_that_hide_one_another(scenes):
    assert {len(scene.covers) for scene in scenes} >= {1, 2, 3}
    for scene in scenes:
        top, bottom, left, right = scene.bounds
        assert 0.0 <= scene.photo.min()
        assert scene.photo.max() <= 1.0
        beside = torch.ones(SMALL_PX, SMALL_PX, dtype=torch.bool)
        beside[top:bottom, left:right] = False
        assert (scene.photo[:, beside] == PADDING_GREY).all()
        assert (scene.covers[:, beside] == 0).all()
        assert (scene.covers.sum(dim=0) <= 1 + 1e-5).all()


@pytest.mark.ci
def test_the_same_number_gives_the_same_view(views):
    once, again, other = views.view(3), views.view(3), views.view(4)
    assert torch.equal(once.foregrounds, again.foregrounds)
    assert not torch.equal(once.foregrounds, other.foregrounds)


def test_told_nothing_the_large_central_one_is_meant():
    scene = two_discs()
    assert unasked_target(scene) == 1
    assert unasked_target(replace(scene, covers=scene.covers[:0])) is None
    twins = torch.stack([scene.covers[1], scene.covers[1].flip(-1)])
    assert unasked_target(replace(scene, covers=twins)) is None


@pytest.mark.parametrize("kind", list(PROMPTS))
def test_a_hint_points_at_its_answer(kind, scenes):
    rng = np.random.default_rng(0)
    for scene in [two_discs(), *scenes]:
        hint, target = ask(rng, scene, kind)
        if not len(scene.covers):
            assert target.max() == 0
            continue
        assert any(torch.equal(target, cover) for cover in scene.covers)
        if kind in ("click", "clicks"):
            assert target.numpy()[hint >= hint.max()].min() > 0.5
        if kind == "clicks" and hint.min() < -0.9:
            assert target.numpy()[hint <= hint.min()].max() < 0.5
        if kind == "box":
            inside = (target.numpy() * (hint > 0)).sum() / target.numpy().sum()
            assert inside > 0.7


def test_loss_is_least_for_the_answer():
    target = two_discs().covers[1][None, None]
    sure = (target * 2 - 1) * 12
    assert mask_loss(sure, target) < 0.01
    assert mask_loss(sure, target) < mask_loss(torch.zeros_like(target), target) < mask_loss(-sure, target)
    assert mask_loss(torch.full_like(target, -12.0), torch.zeros_like(target)) < 0.01


@pytest.fixture(scope="module")
def run(views):
    """Train a few steps on tiny batches: run(folder, stop_after) -> checkpoint."""

    def call(folder, stop_after=None):
        config = small_mask_run(MaskRunConfig(), 4)
        source = SceneSource(views, config.scenes)
        return train_mask(config, data=None, runs=folder, stop_after=stop_after, scenes=source)

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


def test_exported_graph_is_the_network(checkpoint, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        difference = export_mask(checkpoint, tmp_path)
    assert difference <= TOLERANCE
    net, _ = load_mask_net(checkpoint)
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

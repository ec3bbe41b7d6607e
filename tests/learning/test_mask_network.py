"""Scenes for the mask network: what a hint points at is what the answer covers; a run goes on exactly."""

from __future__ import annotations

import csv
import json
import warnings
from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.refused import refused
from typer.testing import CliRunner

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from anyprobe.errors import InputError, ModelError  # noqa: E402
from anyprobe.masks.networks import PADDING_GREY, SMALL_PX, SmallNetwork  # noqa: E402
from anyprobe_train.dataset.asset_store import AssetStore, draw_map  # noqa: E402
from anyprobe_train.dataset.catalog import MapAsset  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe_train.mask_network import mask_training as training  # noqa: E402
from anyprobe_train.mask_network.__main__ import app as commands  # noqa: E402
from anyprobe_train.mask_network.composites import Scene, draw_scene  # noqa: E402
from anyprobe_train.mask_network.examples import PROMPTS, MaskBatch, SceneSource, ask, retake, unasked_target  # noqa: E402
from anyprobe_train.mask_network.foregrounds import TexturePool, ViewSource, draw_pattern  # noqa: E402
from anyprobe_train.mask_network.mask_export import TOLERANCE, export_mask  # noqa: E402
from anyprobe_train.mask_network.mask_net import MaskNet  # noqa: E402
from anyprobe_train.mask_network.mask_training import (  # noqa: E402
    MaskRunConfig,
    load_mask_net,
    mask_loss,
    small_mask_run,
    train_mask,
)
from anyprobe_train.train.checkpoint import load_init_weights, save_init_weights  # noqa: E402


@pytest.fixture(scope="module")
def views():
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=2))
    return ViewSource(illuminator, surfaces, TexturePool(0, 6, illuminator.maps), seed=0)


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


def test_a_retake_moves_photo_and_answer_alike():
    """Wherever the disc goes, it is dark there and grey around it."""
    rng = np.random.default_rng(3)
    sizes = set()
    for _ in range(40):
        scene = retake(rng, two_discs(), SMALL_PX)
        top, bottom, left, right = scene.bounds
        sizes.add(scene.bounds)
        small, large = scene.covers
        inside = torch.zeros(SMALL_PX, SMALL_PX, dtype=torch.bool)
        inside[top:bottom, left:right] = True
        assert (scene.photo[:, ~inside] == PADDING_GREY).all()
        assert (scene.covers[:, ~inside] == 0).all()
        tone = scene.photo.mean(dim=0)
        rest = inside & (scene.covers.sum(dim=0) == 0)
        if (large > 0.99).any():
            assert tone[large > 0.99].max() < tone[rest].median()
        if (small > 0.99).any():
            assert tone[small > 0.99].min() > tone[rest].median()
    assert len(sizes) > 5


def test_loss_is_least_for_the_answer():
    target = two_discs().covers[1][None, None]
    sure = (target * 2 - 1) * 12
    assert mask_loss(sure, target) < 0.01
    assert mask_loss(sure, target) < mask_loss(torch.zeros_like(target), target) < mask_loss(-sure, target)
    assert mask_loss(torch.full_like(target, -12.0), torch.zeros_like(target)) < 0.01


@pytest.mark.ci
def test_network_learns_one_batch_and_sees_the_hint():
    torch.manual_seed(0)
    scene = two_discs()
    hints = torch.stack([cover * 0.5 for cover in scene.covers])
    image = torch.cat([scene.photo.expand(2, 3, SMALL_PX, SMALL_PX), hints[:, None]], dim=1)
    target = scene.covers[:, None]
    net = MaskNet(widths=(8, 8, 12, 16, 16))
    optimizer = torch.optim.Adam(net.parameters(), lr=1e-2)
    for _ in range(25):
        optimizer.zero_grad()
        mask_loss(net.logits(image), target).backward()
        optimizer.step()
    assert (((net(image) > 0.5) == (target > 0.5)).float().mean(dim=(1, 2, 3)) > 0.98).all()


def test_an_objects_patterns_change_its_colour_and_nothing_else(views):
    rng = np.random.default_rng(0)
    normals = torch.zeros(3, 64, 64)
    normals[2] = 1.0
    drawn = [draw_pattern(rng, normals, views.textures) for _ in range(60)]
    assert sum(bool((one == 1).all()) for one in drawn) > 5  # some are plain
    strong = sum(float(one.amax() / one.amin()) > 3 for one in drawn)
    assert strong > 15
    for one in drawn:
        assert one.shape == (3, 64, 64)
        assert one.isfinite().all()
        assert one.min() > 0


def test_the_mean_of_the_weights_is_kept(checkpoint):
    stored = torch.load(checkpoint, weights_only=True)
    torch.manual_seed(MaskRunConfig().seed)
    first = MaskNet().state_dict()["head.weight"]
    kept, moving = (stored[name]["head.weight"] for name in ("net", "moving"))
    assert not torch.equal(moving, first)
    assert (kept - moving).abs().max() < (first - moving).abs().max()


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


def test_a_checkpoint_of_other_weights_is_one_clear_line(tmp_path):
    config = replace(MaskRunConfig(), name="mask")
    path = tmp_path / "mask" / "checkpoint.pt"
    path.parent.mkdir()
    weights = MaskNet().state_dict()
    stored = {"step": 1, "config": json.dumps(asdict(config)), "optimizer": {}}
    torch.save(stored | {"net": {"other": torch.zeros(1)}}, path)
    for load in (lambda: load_mask_net(path), lambda: train_mask(config, data=None, runs=tmp_path)):
        with pytest.raises(ModelError, match=f"with {next(iter(weights))} .*, got none"):
            load()
    with refused(code="invalid-model", source="checkpoint.pt", naming="without nets"):
        save_init_weights(path, tmp_path / "start.pt")
    save_init_weights(path, tmp_path / "start.pt", holds="net")
    assert set(torch.load(tmp_path / "start.pt", weights_only=True)) == {"other"}


def changed(path, **parts):
    """Write a checkpoint anew with other parts, None for those that it shall lack."""
    stored = torch.load(path, weights_only=True) | parts
    torch.save({name: value for name, value in stored.items() if value is not None}, path)


@pytest.mark.ci
def test_a_run_goes_on_with_what_it_began_with_or_not_at_all(tmp_path, monkeypatch):
    config = small_mask_run(MaskRunConfig(), 3)

    def examples(step):
        image = torch.rand((2, 5, SMALL_PX, SMALL_PX), generator=torch.Generator().manual_seed(step))
        return MaskBatch(photo=image[:, :3], prompt=image[:, 3:], mask=(image[:, 3:] > 0.5).float())

    at_hand = SimpleNamespace(batch=examples)

    def go(config=config, scenes=at_hand, **settings):
        return train_mask(config, data=None, runs=tmp_path, scenes=scenes, **settings)

    path = go(stop_after=2)
    assert torch.load(path, weights_only=True)["origin"] == {"start": None}
    with pytest.raises(InputError, match=f"scenes.seed {config.scenes.seed}, as the run started, got 4"):
        go(replace(config, scenes=replace(config.scenes, seed=4)))
    with refused(source="checkpoint.pt", naming="2 steps"):
        go(replace(config, steps=1))
    with refused(code="invalid-model", source="none.pt", naming="no such file"):
        go(start=tmp_path / "none.pt")
    store = AssetStore([MapAsset(name="a", id="0a", licence="own", indoor=True, radiance=np.ones((8, 16, 3)))])
    changed(path, origin={"start": None, "assets": "9 maps"})
    monkeypatch.setattr(training, "load_assets", lambda light, data: store)
    with refused(source="checkpoint.pt", naming="--data with 9 maps"):
        go(scenes=None)
    changed(path, optimizer=None)
    with refused(code="invalid-model", source="checkpoint.pt", naming="weights alone"):
        go()


@pytest.mark.ci
def test_commands_train_export_and_keep(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    app = CliRunner()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter and TensorBoard warn about themselves
        trained = app.invoke(commands, ["train", "--dry-run", "1"], catch_exceptions=False)
        asked = ["export", "runs/mask-dry", "-o", "to", "--keep", "kept.pt"]
        exported = app.invoke(commands, asked, catch_exceptions=False)
    assert trained.stdout.splitlines() == ["runs/mask-dry/checkpoint.pt"]
    assert exported.stdout.splitlines()[-1] == "kept.pt"
    assert (tmp_path / "to" / "mask.onnx").is_file()
    MaskNet().load_state_dict(torch.load("kept.pt", weights_only=True))


def test_weights_that_are_kept_of_the_shipped_network_begin_a_run():
    load_init_weights(MaskNet(), Path(__file__).parents[2] / "train" / "checkpoints" / "mask.pt")

"""The network for whole photos: pairs of what is known and what is true, a run that goes on exactly, and its graph."""

from __future__ import annotations

import shutil
import warnings
from dataclasses import fields, replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("onnx", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from support.scenes import sphere_photo  # noqa: E402

from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.errors import InputError  # noqa: E402
from anyprobe.estimate.estimator import Estimator  # noqa: E402
from anyprobe.estimate.ground import up_of  # noqa: E402
from anyprobe_train.whole_network import whole_training as training  # noqa: E402
from anyprobe_train.whole_network.batches import Pairs  # noqa: E402
from anyprobe_train.whole_network.whole_export import export_photo_net  # noqa: E402
from anyprobe_train.whole_network.whole_training import WholeRunConfig, train_whole  # noqa: E402
from research.scenes.camera import TakenPhoto  # noqa: E402
from research.scenes.pairs import Known, known_of  # noqa: E402

CONFIG = WholeRunConfig(name="tiny", steps=3, batch=2, warmup=1)


@pytest.fixture(scope="module")
def photo() -> TakenPhoto:
    """A sphere left of the middle, before planks, lit from the right and above; the camera looks down and leans."""
    rgba = np.roll(sphere_photo(), -14, axis=1)
    height, width = rgba.shape[:2]
    behind = np.linspace(40, 200, width, dtype=np.float32)[None, :, None] * np.ones((height, 1, 3), np.float32)
    behind[:, np.arange(width) // 8 % 2 == 1] -= 30
    mask = rgba[..., 3] > 127
    picture = np.where(mask[..., None], rgba[..., :3], behind).astype(np.uint8)
    towards = pixel_directions(64) @ np.array([0.8, 0.5, -0.33])
    truth = np.repeat(np.exp(1.5 * towards)[..., None], 3, axis=2).astype(np.float32)
    return TakenPhoto(picture=picture, mask=mask, true_mask=mask, truth=truth, long_fov_deg=50.0)


UP = up_of(20.0, 5.0)


@pytest.fixture(scope="module")
def known(photo) -> dict[str, Known]:
    """What is known of it as it is, in a mirror, and cut out."""
    flipped = {
        name: np.ascontiguousarray(getattr(photo, name)[:, ::-1]) for name in ("picture", "mask", "true_mask", "truth")
    }
    ways = {
        "plain": (photo, UP, False),
        "mirrored": (replace(photo, **flipped), UP * [-1, 1, 1], False),
        "cut": (photo, UP, True),
    }
    return {name: known_of(taken, up, cut, 0, 7) for name, (taken, up, cut) in ways.items()}


def test_known_has_the_shapes_that_it_says(known):
    one = known["plain"]
    shapes = {part.name: getattr(one, part.name).shape for part in fields(Known)}
    assert shapes == {
        "image": (128, 128, 4),
        "family": (),
        "scene": (),
        "context": (96, 96, 5),
        "tan_half": (),
        "surroundings": (4, 64, 128),
        "truth": (3, 64, 128),
        "up": (3,),
    }
    assert np.linalg.norm(one.up) == pytest.approx(1.0, abs=1e-5)
    assert one.surroundings.max() > 0
    assert one.context[48, 48, 3] > 200
    assert np.isfinite(one.truth.astype(np.float32)).all()


def test_a_mirrored_photo_has_the_mirrored_truth(known):
    plain, mirrored = known["plain"], known["mirrored"]
    np.testing.assert_allclose(mirrored.truth, plain.truth[:, :, ::-1], atol=0.01)
    np.testing.assert_allclose(mirrored.up, plain.up * [-1, 1, 1], atol=1e-5)
    np.testing.assert_allclose(mirrored.context.astype(float), plain.context[:, ::-1], atol=2)
    assert np.abs(plain.truth - plain.truth[:, :, ::-1]).max() > 1
    assert abs(plain.up[0]) > 0.02


def test_of_a_cut_out_the_object_alone_is_known(known):
    assert known["cut"].surroundings.max() == 0
    assert known["cut"].context.max() == 0
    np.testing.assert_array_equal(known["cut"].truth, known["plain"].truth)


@pytest.fixture(scope="module")
def folder(known, tmp_path_factory):
    """Two files of pairs."""
    path = tmp_path_factory.mktemp("pairs")
    for number, names in enumerate((("plain", "mirrored"), ("cut",))):
        rows = [known[name] for name in names]
        stacked = {one.name: np.stack([getattr(row, one.name) for row in rows]) for one in fields(Known)}
        np.savez(path / f"{number:06d}.npz", **stacked)
    return path


def trained(folder, runs, config=CONFIG):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # TensorBoard warns about itself
        return train_whole(config, pairs=folder, runs=runs)


@pytest.fixture(scope="module")
def checkpoint(folder, tmp_path_factory):
    return trained(folder, tmp_path_factory.mktemp("runs"))


def test_batches_are_of_all_files(folder, tmp_path):
    pairs = Pairs(folder)
    assert len(pairs) == 3
    batch = pairs.batch(np.random.default_rng(0), 30, given_up=0.5)
    cut = batch["context"].flatten(1).amax(dim=1) == 0
    assert 0 < cut.sum() < 30
    given = batch["given_up"].abs().sum(dim=1) > 0
    assert 0 < given.sum() < 30
    torch.testing.assert_close(batch["given_up"][given], batch["up"][given])
    told = pairs.rows(0, 3)["up"][:, 0]
    assert {round(float(x), 4) for x in batch["up"][:, 0]} >= {round(float(x), 4) for x in (*told, *-told)}  # mirrored


def test_a_killed_run_goes_on_exactly(folder, checkpoint, tmp_path, monkeypatch):
    asked, answer = [], training.PhotoLosses.__call__

    def killed(*given):
        asked.append(given)
        if len(asked) == 3:
            raise KeyboardInterrupt
        return answer(*given)

    monkeypatch.setattr(training, "CHECKPOINT_SECONDS", -1.0)
    monkeypatch.setattr(training.PhotoLosses, "__call__", killed)
    with pytest.raises(KeyboardInterrupt):
        trained(folder, tmp_path)
    part = tmp_path / CONFIG.name / "checkpoint.pt"
    assert torch.load(part, weights_only=True)["step"] == 2
    resumed = torch.load(trained(folder, tmp_path), weights_only=True)
    straight = torch.load(checkpoint, weights_only=True)
    assert len(asked) == 4
    assert straight["step"] == resumed["step"] == 3
    for kept in ("net", "moving"):
        for name, value in straight[kept].items():
            assert torch.equal(value, resumed[kept][name]), name
    with pytest.raises(InputError, match="seed"):
        trained(folder, tmp_path, replace(CONFIG, seed=8))
    shutil.copytree(folder, tmp_path / "more")
    shutil.copy(folder / "000001.npz", tmp_path / "more" / "000002.npz")
    with pytest.raises(InputError, match="--data with"):  # other pairs
        trained(tmp_path / "more", tmp_path, replace(CONFIG, steps=9))


def test_the_exported_graph_answers_a_photo(checkpoint, photo, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch's exporter warns about itself
        assert export_photo_net(checkpoint, tmp_path) >= 0.0
    given = {"mask": np.where(photo.mask, 255, 0).astype(np.uint8), "fov_deg": photo.long_fov_deg}
    light = Estimator(model=str(tmp_path), threads=1)(photo.picture, **given)
    assert light.info["ground"]["source"] == "estimated"
    assert np.isfinite(light.radiance).all()

"""Pictures of a run as it goes: of the same pairs at every checkpoint, and the weights know nothing of them."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

torch = pytest.importorskip("torch", reason="needs ./train[torch]")
pytest.importorskip("tensorboard", reason="needs ./train[torch]")

from support.some_batch import some_batch  # noqa: E402

from anyprobe_train.dataset.asset_store import draw_map  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.pair_source import PairSource  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe_train.train import loop  # noqa: E402
from anyprobe_train.train.config import lift, normals, smoke  # noqa: E402
from anyprobe_train.train.logger import side_by_side  # noqa: E402
from anyprobe_train.train.loop import LEARNERS, make_learner, train  # noqa: E402

SHOWN = (lift, normals)


@pytest.fixture(scope="module")
def light_and_surfaces():
    rng = np.random.default_rng(0)
    illuminator = Illuminator([draw_map(rng, height=32)[0] for _ in range(2)], compiled=False)
    return illuminator, build_surfaces([], SurfaceConfig(views=1, procedural=1))


@pytest.fixture
def run(light_and_surfaces, monkeypatch):
    """Four steps of six pairs, or as many as asked for, with a checkpoint after each, the last of which is written:
    run(folder, named) -> the run's folder."""
    save = loop.save_checkpoint
    monkeypatch.setattr(loop, "CHECKPOINT_SECONDS", -1.0)

    def call(runs, named=normals, steps=4, stop_after=None):
        config = smoke(named(), steps)
        config = replace(config, pairs=replace(config.pairs, batch=6))

        def save_last(path, config, step, *rest):
            if step in (steps, stop_after):
                save(path, config, step, *rest)

        monkeypatch.setattr(loop, "save_checkpoint", save_last)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # TensorBoard warns about itself
            pairs = PairSource(*light_and_surfaces, config.pairs)
            return train(config, data=None, runs=runs, stop_after=stop_after, pairs=pairs).parent

    return call


def events(folder) -> dict[int, np.ndarray]:
    """The pictures that TensorBoard shows of a run, by step."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # TensorBoard warns about itself
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

        found = EventAccumulator(str(folder / "tensorboard"), size_guidance={"images": 0}).Reload()
        images = found.Images("pictures") if "pictures" in found.Tags()["images"] else []
    return {one.step: np.asarray(Image.open(io.BytesIO(one.encoded_image_string))) for one in images}


@pytest.mark.parametrize("named", SHOWN)
def test_weights_are_the_same_to_the_bit_with_pictures_and_without(run, tmp_path, named, monkeypatch):
    shown = run(tmp_path / "shown", named, steps=2)
    drawn_after = torch.get_rng_state()
    monkeypatch.delattr(LEARNERS[named().model], "pictures")
    plain = run(tmp_path / "plain", named, steps=2)
    assert torch.equal(torch.get_rng_state(), drawn_after)
    assert (shown / "pictures.png").is_file()
    assert not list(plain.glob("pictures.*"))
    one, other = (torch.load(folder / "checkpoint.pt", weights_only=True) for folder in (shown, plain))
    for name, value in one["nets"].items():  # weights, and statistics of batch normalisation
        assert torch.equal(value, other["nets"][name]), name
    moments = [[s for state in kept["optimizer"]["state"].values() for s in state.values()] for kept in (one, other)]
    assert all(torch.equal(a, b) for a, b in zip(*moments, strict=True))


def test_networks_are_seen_as_they_will_be_used_and_then_learn_on(run, tmp_path, monkeypatch):
    """With the statistics that they have gathered, not with these pairs'."""
    training, learner = [], LEARNERS["normals"]
    before = learner.pictures

    def watched(self, batch):
        training.append([one.training for one in self.nets.modules()])
        assert not torch.is_grad_enabled()
        return before(self, batch)

    learned = learner.losses

    def learning(self, batch, progress):
        assert all(one.training for one in self.nets.modules())
        return learned(self, batch, progress)

    monkeypatch.setattr(learner, "pictures", watched)
    monkeypatch.setattr(learner, "losses", learning)
    run(tmp_path)
    assert len(training) == 4
    assert not any(any(modules) for modules in training)


def test_each_checkpoint_shows_the_same_pairs_and_what_is_made_of_them_now(run, tmp_path):
    folder = run(tmp_path, lift, steps=2)
    seen = events(folder)
    assert sorted(seen) == [1, 2]
    photo_and_truth = slice(0, 64 + 128)
    assert seen[1].shape == (4 * 64, 64 + 2 * 128, 3)  # four pairs of six
    assert np.array_equal(seen[2][:, photo_and_truth], seen[1][:, photo_and_truth])
    assert (seen[2] != seen[1]).any()
    assert np.array_equal(np.asarray(Image.open(folder / "pictures.png")), seen[2])


def test_a_run_that_goes_on_shows_the_pairs_that_it_began_with(run, tmp_path):
    """And TensorBoard keeps what it was shown before; without them, or if they are damaged, it shows others."""
    straight, parts = run(tmp_path / "a"), run(tmp_path / "b", stop_after=2)
    run(tmp_path / "b")
    one, other = events(straight), events(parts)
    assert sorted(one) == sorted(other) == [1, 2, 3, 4]
    assert all(np.array_equal(one[step], other[step]) for step in one)
    for damage in (lambda path: path.unlink(), lambda path: path.write_bytes(b"no pairs")):
        damage(parts / "pictures.pt")
        run(tmp_path / "b", steps=5)
        (parts / "checkpoint.pt").write_bytes((straight / "checkpoint.pt").read_bytes())
        assert (events(parts)[5][:, :128] != one[4][:, :128]).any()


def test_pictures_are_of_the_photo_the_truth_and_the_estimate():
    """Maps as they are displayed; normals as colours, unit inside the mask and grey beside it."""
    for named in SHOWN:
        learner = make_learner(smoke(named()), "cpu")
        batch = some_batch()
        learner.nets.eval()
        with torch.no_grad():
            photo, truth, estimate = learner.pictures(batch)
        assert torch.equal(photo, batch.photo[:, :3])
        assert truth.shape == estimate.shape
        assert 0 <= estimate.min() <= estimate.max() <= 1
        if named is not normals:
            assert torch.equal(truth, batch.ldr)
    torch.testing.assert_close(truth, torch.nn.functional.avg_pool2d(0.5 + 0.5 * batch.normals, 2))
    mask = torch.nn.functional.avg_pool2d(batch.photo[:, 3:], 2)
    length = (2 * estimate - 1).square().sum(dim=1, keepdim=True).sqrt()
    torch.testing.assert_close(length, mask, atol=0.02, rtol=0)


def test_a_row_is_a_pair_and_pictures_stand_side_by_side():
    low, high = torch.rand(2, 3, 4, 8), torch.rand(2, 3, 8, 8)
    sheet = side_by_side((high, low))
    assert sheet.shape == (8, 4 + 8, 3)
    assert sheet.dtype == np.uint8
    for pair in range(2):
        row = sheet[4 * pair : 4 * pair + 4].transpose(2, 0, 1) / 255
        np.testing.assert_allclose(row[:, :, 4:], low[pair], atol=0.51 / 255)
        means = high[pair].reshape(3, 4, 2, 4, 2).mean(dim=(2, 4))
        np.testing.assert_allclose(row[:, :, :4], means, atol=0.51 / 255)

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


from anyprobe_train.dataset.asset_store import draw_map  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.pair_source import PairSource  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe_train.train import loop  # noqa: E402
from anyprobe_train.train.config import lift, normals, smoke  # noqa: E402
from anyprobe_train.train.loop import LEARNERS, train  # noqa: E402

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


def test_each_checkpoint_shows_the_same_pairs_and_what_is_made_of_them_now(run, tmp_path):
    folder = run(tmp_path, lift, steps=2)
    seen = events(folder)
    assert sorted(seen) == [1, 2]
    photo_and_truth = slice(0, 64 + 128)
    assert seen[1].shape == (4 * 64, 64 + 2 * 128, 3)  # four pairs of six
    assert np.array_equal(seen[2][:, photo_and_truth], seen[1][:, photo_and_truth])
    assert (seen[2] != seen[1]).any()
    assert np.array_equal(np.asarray(Image.open(folder / "pictures.png")), seen[2])

"""A rendered dataset as batches: the same pairs that its recipes give, each once an epoch."""

from __future__ import annotations

import json
import shutil
import warnings
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from support.refused import refused

torch = pytest.importorskip("torch", reason="needs the train extra")
pytest.importorskip("tensorboard", reason="needs the train extra")

from anyprobe.core.response import response  # noqa: E402
from anyprobe.learning.dataset import render_job, shards  # noqa: E402
from anyprobe.learning.dataset.pair import render_pair  # noqa: E402
from anyprobe.learning.dataset.pairs import PairConfig  # noqa: E402
from anyprobe.learning.dataset.samples import StoreRenderer  # noqa: E402
from anyprobe.learning.train.config import normals, smoke  # noqa: E402
from anyprobe.learning.train.dataloader import ShardSource  # noqa: E402
from anyprobe.learning.train.loop import train  # noqa: E402

SETTINGS = {"pairs": 6, "shard_size": 4, "procedural_maps": 2, "procedural_shapes": 2}


def here(work, tasks, watch):
    """Every task in this process."""
    for task in tasks:
        work(task, lambda n: None)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Six pairs of our own assets in two shards."""
    folder = tmp_path_factory.mktemp("pairs") / "set"
    job = render_job.begin(folder, SETTINGS, None, StoreRenderer, resume=False)
    render_job.render_missing(job, here, lambda shard, n: None)
    return folder


def source(folder, **settings):
    return ShardSource(folder, None, PairConfig(**{"batch": 3, "seed": 5, **settings}))


def test_test_assets_are_not_trained_on(tmp_path):
    job = render_job.begin(tmp_path / "set", {**SETTINGS, "split": "test"}, None, StoreRenderer, resume=False)
    render_job.render_missing(job, here, lambda shard, n: None)
    with refused("shards", source="set", naming="split test"):
        source(tmp_path / "set")


def test_a_batch_holds_what_its_recipes_render(rendered):
    found = source(rendered)
    batch, seen = found.batch(0), {}
    for shard in (0, 1):
        seen |= {key: json.loads(parts["json"]) for key, parts in shards.read_samples(shards.tar_path(rendered, shard))}
    renderer = StoreRenderer({**render_job.SETTINGS, **SETTINGS}, None)
    pairs = [render_pair(renderer.recipe(k), renderer.store) for k in range(6)]
    order = np.random.default_rng((5, 3, 0)).permutation(6)[:3]
    assert [one.recipe.key for one in pairs] == list(seen)
    for row, k in enumerate(order):
        pair = pairs[k]
        photo, ldr, normals = (
            getattr(batch, name)[row].permute(1, 2, 0).numpy() for name in ("photo", "ldr", "normals")
        )
        np.testing.assert_allclose(photo, pair.crop, atol=1e-6)
        np.testing.assert_allclose(ldr, response(pair.radiance), atol=1e-4)
        np.testing.assert_allclose(normals, pair.normals, atol=0.005)
        np.testing.assert_allclose(
            torch.exp(batch.ln_radiance[row]).permute(1, 2, 0).numpy().max(), pair.radiance.max(), rtol=1e-3
        )
        assert float(batch.alpha[row]) == pytest.approx(float(pair.material.alpha))
        assert float(batch.tan_half[row]) == pytest.approx(pair.tan_half)


def test_every_pair_comes_once_an_epoch_in_another_order(rendered):
    found = source(rendered)
    first, second = ([found.batch(step).photo for step in steps] for steps in ((0, 1), (2, 3)))
    counted = [Counter(float(one.sum()) for batch in epoch for one in batch) for epoch in (first, second)]
    assert counted[0] == counted[1]
    assert not torch.equal(torch.cat(first), torch.cat(second))
    assert torch.equal(source(rendered).batch(3).photo, second[1])


def test_a_shard_that_is_not_finished_is_left_out(rendered, tmp_path):
    folder = tmp_path / "part"
    shutil.copytree(rendered, folder)
    shards.index_path(folder, 1).unlink()
    assert len(source(folder).keys) == 4
    with refused("shards", source="part", naming="4"):
        source(folder, batch=5)


@pytest.mark.filterwarnings("ignore")  # TensorBoard warns about itself
def test_a_run_on_shards_resumes_to_the_bit_and_on_these_alone(rendered, tmp_path):
    config = replace(smoke(normals(), 3), pairs=replace(smoke(normals()).pairs, batch=3))

    def run(folder, pairs=None, **settings):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            pairs = ShardSource(rendered, None, config.pairs) if pairs is None else pairs
            return train(config, data=None, runs=folder, pairs=pairs, **settings)

    straight = torch.load(run(tmp_path / "a"), weights_only=True)
    run(tmp_path / "b", stop_after=1)
    other = ShardSource(rendered, None, config.pairs)
    other.keys = other.keys[:5]
    with refused(source="checkpoint.pt", naming="--data with 6 rendered pairs"):
        run(tmp_path / "b", pairs=other)
    resumed = torch.load(run(tmp_path / "b"), weights_only=True)
    for name, value in straight["nets"].items():
        assert torch.equal(value, resumed["nets"][name]), name

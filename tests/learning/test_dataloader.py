"""Batches by worker processes: the same, in the same order, as one process makes."""

from __future__ import annotations

from dataclasses import fields
from functools import partial

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.pair_source import Batch, PairConfig, PairSource  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, SurfaceSet, build_surfaces  # noqa: E402
from anyprobe_train.train.dataloader import stream  # noqa: E402


@pytest.fixture(scope="module")
def surfaces() -> SurfaceSet:
    return build_surfaces([], SurfaceConfig(views=1, procedural=2))


def open_source(seed: int, surfaces: SurfaceSet) -> PairSource:
    torch.set_num_threads(1)
    light = np.random.default_rng(seed).random((16, 32, 3)).astype(np.float32)
    return PairSource(Illuminator([light], compiled=False), surfaces, PairConfig(batch=2, seed=seed, group=2, pool=2))


@pytest.mark.filterwarnings("ignore:This DataLoader will create")  # on one core
def test_workers_make_the_same_batches_as_one_process(surfaces):
    threads = torch.get_num_threads()
    try:
        source = open_source(3, surfaces)
        made = list(stream(partial(open_source, 3, surfaces), range(5, 13, 2), workers=2))
        assert len(made) == 4
        for step, batch in zip(range(5, 13, 2), made, strict=True):
            expected = source.batch(step)
            for name in (field.name for field in fields(Batch)):
                assert torch.equal(getattr(batch, name), getattr(expected, name)), (step, name)
    finally:
        torch.set_num_threads(threads)


def test_a_fault_in_a_worker_is_raised_here():
    with pytest.raises(TypeError):
        next(stream(partial(open_source, None, None, 1), range(1), workers=1))

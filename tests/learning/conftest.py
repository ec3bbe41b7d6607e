"""The command line of training in this process, and a world of few assets."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from support.mesh_files import ply

from anyprobe.maps.radiance import write_exr
from anyprobe.render.shapes import sphere
from anyprobe_train.cli.app import main


@pytest.fixture
def command(command) -> Callable:
    """anyprobe-train's entry point; see tests/conftest.py."""
    return partial(command, main=main)


@pytest.fixture(scope="session")
def small_world(tmp_path_factory):
    from anyprobe_train.world import maps
    from anyprobe_train.world.batch import World

    data, cache = tmp_path_factory.mktemp("data"), tmp_path_factory.mktemp("cache")
    for folder, name in (("hdri", "day.exr"), ("meshes", "ball.ply")):
        (data / folder / "train").mkdir(parents=True)
        text = f"file,slug,category,licence\n{name},{name[:-4]},outdoor,CC0\n"
        (data / folder / "train" / "manifest.csv").write_text(text, encoding="utf-8")
    sky = np.random.default_rng(0).uniform(0.1, 1.0, (256, 512, 3)).astype(np.float32)
    sky[60:62, 100:102] = 3000.0
    write_exr(data / "hdri" / "train" / "day.exr", sky)
    ball = sphere(16)
    (data / "meshes" / "train" / "ball.ply").write_bytes(ply(ball.positions, ball.faces))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maps, "PLACES", 4)
        patch.setattr(maps, "COVERS", 4)
        yield World.open(data, cache, batch=5, first=1, every=1000)

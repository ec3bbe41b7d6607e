"""The seconds that an answer tells: loading counts from the photo's opening, its object's finding included."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest
from support.transforms import transforms

from anyprobe.estimate import photo as photo_module

SLOW_S = 0.3
pytestmark = pytest.mark.usefixtures("networks_opened_once", "slow_masks")


@pytest.fixture
def slow_masks(monkeypatch) -> None:
    """Finding an object takes SLOW_S longer."""
    find_mask = photo_module.find_mask

    def slowly(*given, **where):
        time.sleep(SLOW_S)
        return find_mask(*given, **where)

    monkeypatch.setattr(photo_module, "find_mask", slowly)


@pytest.mark.ci
@pytest.mark.parametrize("count", [1, 2])
def test_the_command_counts_from_the_photo_s_opening(work, command, photo_path, count):
    files = [photo_path, work / "other.png"][:count]
    files[-1].write_bytes(photo_path.read_bytes())
    poses = []
    if count > 1:
        (work / "poses.json").write_text(transforms([np.eye(3)] * count, (file.name for file in files)))
        poses = ["--poses", "poses.json"]
    done = command("estimate", *files, *poses, "--json", "-q")
    assert done.status == 0, done.err
    assert json.loads(done.out)["seconds"]["load"] >= count * SLOW_S


def test_no_time_counts_twice(estimator, photo_path):
    start = time.perf_counter()
    photos = (photo_module.load_photo(photo_path) for _ in range(3))
    light = estimator.multiview(photos, [np.eye(3)] * 3)
    seconds = light.info["seconds"]
    assert seconds["load"] >= 3 * SLOW_S
    assert sum(seconds.values()) < time.perf_counter() - start + 0.01  # rounded

"""Scenes by families: the same for the same number, the whole object in the picture, truth and background one light."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.response import inverse_response
from anyprobe_train.dataset.asset_store import load_asset_store
from research.scenes.camera import take
from research.scenes.layouts import FAMILIES, SHARES, draw_family, draw_layout
from research.world.whole_render import Render


@pytest.fixture(scope="module")
def store():
    return load_asset_store(None, "train", procedural_maps=2, procedural_shapes=4)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_layout_is_a_function_of_its_number(store, family):
    one, again, other = (draw_layout(family, "train", number, store) for number in (3, 3, 4))
    np.testing.assert_array_equal(one.light, again.light)
    assert one.phone.position.tolist() == again.phone.position.tolist() != other.phone.position.tolist()
    assert draw_layout(family, "test", 3, store).phone.position.tolist() != one.phone.position.tolist()


@pytest.mark.parametrize("family", FAMILIES)
def test_the_whole_object_is_in_the_picture_under_a_light_of_one_size(store, family):
    for number in range(6):
        layout = draw_layout(family, "train", number, store)
        box = layout.phone.pixels(layout.thing.mesh.positions)
        assert (box > 0).all()
        assert (box < [layout.phone.width, layout.phone.height]).all()
        assert layout.light.shape == (256, 512, 3)  # kernels are compiled for a size
        assert np.isfinite(layout.light).all()
        assert layout.light.min() >= 0


def test_families_come_in_their_shares():
    drawn = [draw_family("train", number) for number in range(3000)]
    np.testing.assert_allclose([drawn.count(family) / 3000 for family in FAMILIES], SHARES, atol=0.03)


def flat_render(level: float) -> Render:
    """A grey picture of a grey object under even light."""
    mask = np.zeros((90, 120), np.float32)
    mask[20:70, 40:80] = 1
    return Render(
        picture=np.full((90, 120, 3), level, np.float32), mask=mask, truth=np.full((64, 128, 3), level, np.float32)
    )


def test_a_photo_and_its_truth_are_in_the_same_units():
    """But for the lens, the style and the noise of each camera, on average."""
    ratios = []
    for seed in range(40):
        taken = take(flat_render(0.2), 60.0, np.random.default_rng(seed))
        middle = taken.picture[30:60, 50:70].reshape(-1, 3).mean(axis=0) / 255
        ratios.append(inverse_response(middle).mean() / taken.truth.mean())
    assert abs(np.median(np.log2(ratios))) < 0.25

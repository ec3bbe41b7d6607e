"""Scenes by families: the same for the same number, the whole object in the picture, truth and background one light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.core.latlong import bilinear, direction_to_uv
from anyprobe.core.response import inverse_response
from anyprobe.light.environment import rotate
from anyprobe.relight.path_traced import mitsuba_runs
from anyprobe_train.dataset.asset_store import load_asset_store
from anyprobe_train.whole_network.families import FAMILIES
from research.scenes.camera import mirrored, take
from research.scenes.layouts import SHARES, draw_family, draw_layout
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


def test_a_mirrored_render_mirrors_everything():
    rng = np.random.default_rng(0)
    render = Render(picture=rng.random((6, 8, 3)), mask=rng.random((6, 8)), truth=rng.random((64, 128, 3)))
    other = mirrored(render)
    np.testing.assert_array_equal(other.picture[:, ::-1], render.picture)
    np.testing.assert_array_equal(other.truth[:, ::-1], render.truth)


def test_some_masks_are_wrong_and_none_is_lost():
    render = flat_render(0.2)
    overlaps = []
    for seed in range(60):
        taken = take(render, 60.0, np.random.default_rng(seed))
        overlaps.append((taken.mask & taken.true_mask).sum() / (taken.mask | taken.true_mask).sum())
    assert min(overlaps) > 0.3
    assert 0.15 < np.mean(np.array(overlaps) == 1.0) < 0.65
    assert np.mean(np.array(overlaps) < 0.9) > 0.05


@pytest.mark.slow
@pytest.mark.skipif(not mitsuba_runs(), reason="needs Mitsuba and LLVM: pip install '.[judge]'")
def test_on_a_maps_ground_the_picture_beside_object_and_shadow_is_the_map(store):
    pytest.importorskip("mitsuba_oidn", reason="pip install mitsuba-oidn")
    from research.scenes.render import render_layout

    layout = draw_layout("ground", "train", 5, store)
    layout = replace(layout, light=np.maximum(layout.light, 1e-3))
    render, phone = render_layout(layout), layout.phone
    y, x = (one.ravel() for one in np.mgrid[2 : phone.height : 7, 2 : phone.width : 7])
    seen = bilinear(layout.light, direction_to_uv(phone.rays(x + 0.5, y + 0.5)).astype(np.float32))
    ratio = render.picture[y, x].mean(axis=1) / seen.mean(axis=1)
    box = phone.pixels(layout.thing.mesh.positions)
    far = np.linalg.norm(np.stack([x, y], 1) - box.mean(axis=0), axis=1) > 1.6 * np.ptp(box, axis=0).max()
    np.testing.assert_allclose(np.median(ratio[far]), 1.0, atol=0.02)
    back = rotate(layout.light, phone.world_from_camera.T)
    small = back.reshape(64, 4, 128, 4, 3).mean(axis=(1, 3, 4))
    assert np.corrcoef(render.truth.mean(axis=2).ravel(), small.ravel())[0, 1] > 0.99

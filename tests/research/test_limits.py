"""Limits: orders of spherical harmonics, groups, gains and powers that tell which way a model is off; the sphere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.some_pair import sphere_pair

from anyprobe.core.latlong import pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.asset_store import draw_map
from anyprobe_train.evaluate.metrics import rmse
from research.limits import sphere as sphere_limit
from research.limits.figures import MEAN_MAP, Limits
from research.limits.orders import basis, order_powers
from research.limits.sphere import SphereLimit, Views, world_draw


def test_harmonics_are_orthonormal_and_their_orders_do_not_mix():
    weights = basis(32)
    solid = np.broadcast_to(pixel_solid_angles(32), (32, 64)).reshape(-1)
    np.testing.assert_allclose(weights @ (weights / solid).T, np.eye(81), atol=0.02)
    d = pixel_directions(32)
    for l, picture in enumerate((np.ones(d.shape[:2]), d[..., 0], d[..., 0] * d[..., 1])):
        power = order_powers(picture[..., None].astype(np.float32))
        assert np.argmax(power) == l
        assert power[l] > 0.999 * power.sum()


def test_the_table_tells_bias_from_spread_and_explains_nothing_by_the_mean_map():
    limits = Limits()
    for seed, factor in ((1, 0.5), (2, 0.5), (3, 2.0)):
        pair = sphere_pair(seed)
        limits.add(
            pair,
            {
                MEAN_MAP: lambda pair: np.full((64, 128, 3), 0.3, np.float32),
                "one": lambda pair, factor=factor: pair.radiance * factor,
            },
        )
        limits.add_ldr("two", pair, response(pair.radiance))
    row = limits.table()["all"]
    assert row["one"]["power_median"] == -1.0
    assert row["one"]["power_mae"] == 1.0
    assert row["one"]["gain_rmse"] < 0.01
    assert row["one"]["explained"][1:] == pytest.approx([1.0] * 8, abs=0.05)
    assert row[MEAN_MAP]["explained"] == [0.0] * 9
    assert row["two"] == {"pairs": 3, "rmse": 0.0, "ssim": 1.0}


@pytest.mark.ci
def test_a_sphere_explains_the_maps_it_has_learned_from(monkeypatch):
    monkeypatch.setattr(sphere_limit, "VIEWS", 4)
    maps = [draw_map(np.random.default_rng(k), height=64)[0] for k in range(12)]
    limit = SphereLimit(Views(maps), 0.16, world_draw(metal=True), world=True, given=True)
    pair = sphere_pair(3)
    shiny = Material(albedo=np.zeros(3, np.float32), f0=np.full(3, 0.9, np.float32), alpha=0.16)
    pair = replace(pair, material=shiny)
    truth = response(pair.radiance)
    mean = np.mean([response(sphere_pair(k).radiance) for k in range(20, 32)], axis=0)
    assert rmse(limit(pair), truth) < rmse(mean, truth)
    assert limit(pair).shape == (64, 128, 3)

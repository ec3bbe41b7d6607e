"""Objects that are not quite uniform: patterns lie on them, are mild, and leave what is asked for alone."""

from dataclasses import fields, replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.scatter.materials import Material  # noqa: E402
from anyprobe_train.dataset import camera, pair_source  # noqa: E402
from anyprobe_train.dataset.asset_store import own_map  # noqa: E402
from anyprobe_train.dataset.distributions import METALS, draw_material  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.pair_source import PairConfig, PairSource  # noqa: E402
from anyprobe_train.dataset.surfaces import SurfaceConfig, build_surfaces  # noqa: E402
from anyprobe_train.dataset.textured import MAX_ALBEDO, ON_METAL, locate, mix, paint  # noqa: E402

SIZE, RADIUS = 128, 0.85
X, Y = np.meshgrid((np.arange(SIZE) + 0.5) / SIZE * 2 - 1, 1 - (np.arange(SIZE) + 0.5) / SIZE * 2)
REACH = np.hypot(X, Y) / RADIUS
"""Distance from the picture's centre in the radius of `sphere` and `disc`."""


def sphere() -> np.ndarray:
    """Normals [S, S, 3] of a sphere seen from afar."""
    z = np.sqrt(np.maximum(1 - REACH**2, 0))
    return (np.stack([X / RADIUS, Y / RADIUS, z], axis=-1) * (REACH < 1)[..., None]).astype(np.float32)


def disc() -> np.ndarray:
    """Normals [S, S, 3] of a flat disc that faces the eye."""
    return np.where((REACH < 1)[..., None], np.array([0, 0, 1], np.float32), np.float32(0))


@pytest.fixture(scope="module")
def source():
    """A source of the same pairs by any further settings."""
    illuminator = Illuminator([own_map(5, index).radiance for index in range(2)], compiled=False)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=2))

    def make(**settings) -> PairSource:
        return PairSource(illuminator, surfaces, PairConfig(batch=6, seed=1, group=3, pool=1, reuse=4, **settings))

    return make


def test_pixels_are_located_where_the_sphere_is():
    points, inside = locate(sphere()), REACH < 0.95
    np.testing.assert_allclose(points[..., 0], X, atol=1e-6)
    np.testing.assert_allclose(points[..., 1], Y, atol=1e-6)
    error = points[..., 2] - RADIUS * np.sqrt(np.maximum(1 - REACH**2, 0))
    assert np.ptp(error[inside]) < 0.02


def test_paint_changes_a_dielectrics_albedo_and_less_of_a_metals_mirror():
    factor = np.array([0.5, 1.0, 1.5])[:, None] * np.ones(3)
    paper = Material(albedo=np.full(3, 0.7, np.float32), f0=np.full(3, 0.04, np.float32), alpha=0.3)
    painted = paint(paper, factor)
    np.testing.assert_allclose(painted.albedo, np.minimum(0.7 * factor, MAX_ALBEDO))
    np.testing.assert_allclose(painted.f0, 0.04, rtol=1e-6)
    gold = Material(albedo=np.zeros(3, np.float32), f0=np.array(METALS[0]), alpha=0.3)
    tarnished = paint(gold, factor)
    assert not tarnished.albedo.any()
    np.testing.assert_allclose(tarnished.f0, np.minimum(gold.f0 * factor**ON_METAL, 1.0))
    half = mix(paper, gold, np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(half.albedo[:, 0], [0.7, 0.35, 0.0], rtol=1e-6)
    np.testing.assert_allclose(half.f0, np.linspace(paper.f0, gold.f0, 3), rtol=1e-6)
    assert half.alpha == 0.3


def test_a_pixel_shows_the_material_that_it_has(source):
    """Against the same surface of each material alone: upper left, upper right and below."""
    lit = source()._pool(0)[:2]
    normals = torch.from_numpy(sphere()).permute(2, 0, 1).expand(2, 3, SIZE, SIZE)
    wo = pair_source.pixel_wo(torch.full((2, 1, 1, 1), 0.2), SIZE)
    rng = np.random.default_rng(0)
    some = [draw_material(rng, lit[0].alpha, metal) for metal in (False, True, False)]
    whole = [pair_source.shade_batch(lit, [one, one], normals, wo)[0] for one in some]
    which = np.where(Y < 0, 2, np.where(X < 0, 0, 1))
    maps = {name: np.stack([getattr(one, name) for one in some])[which] for name in ("f0", "albedo")}
    radiance, _ = pair_source.shade_batch(lit, [replace(some[0], **maps), some[1]], normals, wo)
    torch.testing.assert_close(radiance[1], whole[1][1])
    for k in range(3):
        part = torch.from_numpy((which == k) & (REACH < 1))
        torch.testing.assert_close(radiance[0][:, part], whole[k][0][:, part])


@pytest.mark.parametrize("name", ["textured", "two_materials"])
def test_a_batch_shows_it_and_its_targets_do_not(source, monkeypatch, name):
    """At the same exposure. All else of the photos is the same too, and a texture makes them hardly brighter."""
    monkeypatch.setattr(camera, "exposure", lambda *_: 0.5)
    plain = source(conditions=0).batch(1)
    changed = source(conditions=0, **{name: 1.0}).batch(1)
    again = source(conditions=0, **{name: 1.0}).batch(1)
    for one in fields(plain):
        if one.name != "photo":
            assert torch.equal(getattr(plain, one.name), getattr(changed, one.name)), one.name
        assert torch.equal(getattr(again, one.name), getattr(changed, one.name)), one.name
    assert torch.equal(plain.photo[:, 3], changed.photo[:, 3])
    inside = plain.photo[:, 3:]
    differs = ((plain.photo != changed.photo).any(dim=1, keepdim=True) * inside).sum((1, 2, 3)) / inside.sum((1, 2, 3))
    brighter = changed.photo[:, :3].sum((1, 2, 3)) / plain.photo[:, :3].sum((1, 2, 3))
    if name == "textured":
        assert (differs > 0.3).all()
        assert (brighter.log().abs() < 0.08).all()
    else:
        assert (differs > 0.05).all()
        assert (differs < 0.45).all()  # the first material is as it was, a pixel from the border

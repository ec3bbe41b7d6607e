"""Objects that are not quite uniform: patterns lie on them, are mild, and leave what is asked for alone."""

from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs ./train[torch]")

from anyprobe.scatter.materials import Material  # noqa: E402
from anyprobe_train.dataset.asset_store import own_map  # noqa: E402
from anyprobe_train.dataset.batch_shading import pixel_wo, shade_batch  # noqa: E402
from anyprobe_train.dataset.distributions import METALS, draw_material  # noqa: E402
from anyprobe_train.dataset.lighting import Illuminator  # noqa: E402
from anyprobe_train.dataset.textured import MAX_ALBEDO, ON_METAL, paint  # noqa: E402

SIZE, RADIUS = 128, 0.85
X, Y = np.meshgrid((np.arange(SIZE) + 0.5) / SIZE * 2 - 1, 1 - (np.arange(SIZE) + 0.5) / SIZE * 2)
REACH = np.hypot(X, Y) / RADIUS
"""Distance from the picture's centre in the radius of `sphere` and `disc`."""


def sphere() -> np.ndarray:
    """Normals [S, S, 3] of a sphere seen from afar."""
    z = np.sqrt(np.maximum(1 - REACH**2, 0))
    return (np.stack([X / RADIUS, Y / RADIUS, z], axis=-1) * (REACH < 1)[..., None]).astype(np.float32)


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


def test_a_pixel_shows_the_material_that_it_has():
    """Against the same surface of each material alone: upper left, upper right and below."""
    illuminator, rng = Illuminator([own_map(5, 0).radiance], compiled=False), np.random.default_rng(0)
    lit = [illuminator.light(0, np.eye(3), 0.4, 4)] * 2
    normals = torch.from_numpy(sphere()).permute(2, 0, 1).expand(2, 3, SIZE, SIZE)
    wo = pixel_wo(torch.full((2, 1, 1, 1), 0.2), SIZE)
    some = [draw_material(rng, lit[0].alpha, metal) for metal in (False, True, False)]
    whole = [shade_batch(lit, [one, one], normals, wo)[0] for one in some]
    which = np.where(Y < 0, 2, np.where(X < 0, 0, 1))
    maps = {name: np.stack([getattr(one, name) for one in some])[which] for name in ("f0", "albedo")}
    radiance, _ = shade_batch(lit, [replace(some[0], **maps), some[1]], normals, wo)
    torch.testing.assert_close(radiance[1], whole[1][1])
    for k in range(3):
        part = torch.from_numpy((which == k) & (REACH < 1))
        torch.testing.assert_close(radiance[0][:, part], whole[k][0][:, part])

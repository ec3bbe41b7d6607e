"""Objects that are not quite uniform: what is painted changes as it is made to, and leaves what is asked for alone."""

import numpy as np

from anyprobe.scatter.materials import Material
from anyprobe_train.dataset.distributions import METALS
from anyprobe_train.dataset.textured import MAX_ALBEDO, ON_METAL, paint


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

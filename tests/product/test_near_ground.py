"""Objects on a photo's ground: near its foot an object is lit by ground in its own shadow."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.estimate.photo import load_photo
from anyprobe.relight.ground_map import GroundPicture, with_ground
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.render.picture import draw_mesh
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import material_named

LIGHT = np.full((32, 64, 3), 0.6, np.float32)
MATTE = material_named("matte")


@pytest.fixture(scope="module")
def stage() -> Stage:
    """A sphere beside a ball on even grey ground, seen from a little above."""
    y, x = np.mgrid[:192, :256]
    mask = ((x - 80) ** 2 + (y - 90) ** 2 < 40**2).astype(np.float32)
    picture = np.where(mask[..., None] > 0, (200, 120, 60), (150, 150, 150)).astype(np.uint8)
    return Stage(load_photo(picture, mask=mask), sphere(48), Arrangement(size=1.0, at=(190, 127.5), pitch_deg=12.0))


@pytest.fixture(scope="module")
def from_the_middle(stage) -> np.ndarray:
    """The same sphere under one ground map."""
    lit = with_ground(GroundPicture(stage.photo, stage.view, LIGHT), stage.placement, stage.shadow(LIGHT))
    return draw_mesh(stage.placement.mesh, stage.window.camera, lit, MATTE)


def middle_column(drawn: np.ndarray) -> np.ndarray:
    """Luminance at 14 places down the middle of a sphere, from its top to its foot."""
    inside = np.flatnonzero((drawn[..., 3] == 1).any(axis=1))
    rows = np.linspace(inside[0] + 2, inside[-1] - 2, 14).astype(int)
    column = drawn.shape[1] // 2
    return luminance(drawn[rows, column - 1 : column + 2, :3]).mean(axis=1)


@pytest.mark.ci
def test_the_foot_is_darker_and_the_top_as_under_one_map(stage, from_the_middle):
    now, before = (middle_column(one) for one in (stage.draw(LIGHT, MATTE), from_the_middle))
    np.testing.assert_allclose(now[:2], before[:2], rtol=0.01)
    assert now[-1] < 0.85 * before[-1]
    assert now[7] > 1.03 * before[7]  # it sees the ground beyond the shadow

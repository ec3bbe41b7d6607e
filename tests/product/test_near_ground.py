"""Objects on a photo's ground: near its foot an object is lit by ground in its own shadow."""

from __future__ import annotations

import numpy as np
import pytest

from anyprobe.core.color import luminance
from anyprobe.core.frames import rotation_x
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.photo import load_photo
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.near_ground import GroundPicture, with_ground
from anyprobe.render.mesh import make_mesh
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


def test_a_lit_wall_sends_no_light_from_its_back(stage):
    """A plate with a wall across it, lit from the camera's side: behind the wall, where only its back is seen, it is
    dark."""
    low, high = np.array([[-1.2, 0.0, -1.0], [-1.2, 0.1, -0.05]]), np.array([[1.2, 0.1, 1.0], [1.2, 0.8, 0.05]])
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
    boxes = make_mesh(
        np.concatenate([a + corner * (b - a) for a, b in zip(low, high, strict=True)]),
        np.concatenate([triangles, triangles + 8]),
    )
    steep = Stage(stage.photo, boxes, Arrangement(size=0.5, at=(190, 127.5), pitch_deg=60.0))
    toward = rotation_x(np.radians(30.0)) @ [0.0, 0.0, 1.0]  # half as high as the camera
    lamp = (pixel_directions(64) @ toward > 0.99)[..., None] * np.full(3, 200.0, np.float32)
    column = middle_column(steep.draw(lamp, MATTE))
    assert column[1] < 0.01 * column[-2]

"""The real object beside an inserted one: where its body stands, the light that it keeps off, and its mirror image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.scenes import sphere_photo

from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.estimate.photo import load_photo
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.near_ground import GroundPicture, Points, Surroundings
from anyprobe.relight.placement import real_body
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.scatter.materials import material_named

pytestmark = pytest.mark.usefixtures("rough_shadows")

WIDTH, HEIGHT, DIAMETER = 240, 160, 60
LEFT, RIGHT = np.array([0.9, 0.2, 0.1]), np.array([0.1, 0.2, 0.9])
FOOT = 135.0, 110.0
REAL = np.array([0.1, 0.8, 0.1])


@pytest.fixture
def stage() -> Stage:
    """A green ball, left on a ground that is red to the left of the inserted ball and blue to the right of it."""
    photo = load_photo(sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH))
    rgb = np.where((np.arange(WIDTH) < FOOT[0])[None, :, None], LEFT, RIGHT) * np.ones((HEIGHT, 1, 1))
    rgb = np.where(photo.mask[..., None] > 0.5, REAL, rgb).astype(np.float32)
    return Stage(replace(photo, rgb=rgb, hidden=None), sphere(24), Arrangement(size=0.8, at=FOOT, pitch_deg=20.0))


@pytest.fixture
def body(stage) -> Mesh:
    found = real_body(stage.photo, stage.view, stage.placement)
    assert found is not None
    return found


def lamp_behind(body: Mesh, point: np.ndarray) -> np.ndarray:
    """A map of a lamp behind the middle of the body as seen from a point."""
    toward = body.positions.mean(axis=0) - point
    lit = pixel_directions(128) @ (toward / np.linalg.norm(toward)) > 0.9995
    return lit[..., None] * np.full(3, 2000, np.float32)


def test_ground_that_the_photo_does_not_show_is_the_maps_in_the_real_objects_shadow(stage):
    picture = GroundPicture(stage.photo, stage.view, np.full((16, 32, 3), 0.5, np.float32))
    lit, behind = -stage.view.up[None], stage.view.on_ground(60, 88)[None]  # under the camera, behind the object
    shadow = stage.shadow(picture.radiance)
    np.testing.assert_allclose(picture.at(lit, shadow), 0.5, atol=1e-5)
    assert 0.4 < picture.at(behind, shadow).max() < 0.99 * 0.5 * shadow.at(behind).min()


def test_the_body_stands_where_the_photo_shows_the_object(stage, body):
    rows = np.flatnonzero((stage.photo.mask > 0.5).any(axis=1))
    pixels = stage.view.pixels(body.positions)
    assert pixels[:, 0].min() == pytest.approx(60 - DIAMETER / 2, abs=4)
    assert pixels[:, 0].max() == pytest.approx(60 + DIAMETER / 2, abs=4)
    assert pixels[:, 1].min() == pytest.approx(rows[0], abs=8)
    assert ((body.positions - stage.placement.foot) @ stage.view.up).min() > -1e-9
    corners = body.positions[body.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (((corners.mean(axis=1) - body.positions.mean(axis=0)) * outward).sum(axis=-1) > -1e-9).mean() > 0.8
    middle = stage.placement.foot + stage.placement.radius * stage.view.up
    assert np.linalg.norm(body.positions - middle, axis=-1).min() > stage.placement.radius


@pytest.mark.parametrize(("top", "stands"), [(20, True), (100, False)])
def test_an_object_stands_beside_it_unless_it_is_in_its_way(stage, top, stands):
    """A spout above the inserted ball leaves it its place; one as low as it does not."""
    mask = stage.photo.mask.copy()
    mask[top : top + 10, 60:200] = 1.0
    assert (real_body(replace(stage.photo, mask=mask), stage.view, stage.placement) is not None) == stands


def test_nothing_stands_where_no_object_is_marked(stage):
    photo = replace(stage.photo, mask=np.zeros_like(stage.photo.mask))
    assert real_body(photo, stage.view, stage.placement) is None


@pytest.mark.ci
def test_ground_in_the_real_objects_shade_gets_no_second_shadow(stage, body):
    spot = stage.placement
    away = body.positions.mean(axis=0) - spot.foot
    away -= (away @ stage.view.up) * stage.view.up
    far = spot.foot - 1.6 * spot.radius * (away / np.linalg.norm(away))[None]
    light = lamp_behind(body, far[0])  # and past the inserted ball
    alone = stage.on(replace(stage.photo, mask=np.zeros_like(stage.photo.mask)))
    assert alone.shadow(light).at(far).max() < 0.1
    assert stage.shadow(light).at(far).min() > 0.9


@pytest.mark.ci
def test_a_matte_ball_in_the_real_objects_shade_is_dark(stage, body):
    light = lamp_behind(body, stage.placement.foot)
    alone = stage.on(replace(stage.photo, mask=np.zeros_like(stage.photo.mask)))
    dark, lit = (one.draw(light, "matte")[..., :3].sum() for one in (stage, alone))
    assert dark < 0.75 * lit


def test_the_edge_of_the_real_objects_shade_is_soft(stage, body):
    """Only one of its sides is seen: how wide it is, is not known."""
    surroundings = Surroundings(
        GroundPicture(stage.photo, stage.view, np.ones((16, 32, 3), np.float32)),
        stage.placement,
        stage.shadow(np.ones((16, 32, 3), np.float32), 8, 32),
        body,
        material_named("matte"),
    )
    toward = body.positions.mean(axis=0) - stage.placement.foot
    toward /= np.linalg.norm(toward)
    across = np.cross(stage.view.up, toward)
    line = stage.placement.foot + np.linspace(-2, 2, 400)[:, None] * np.ptp(body.positions @ across) * across
    points = Points(mask=np.ones((20, 20), bool), at=line, n=0 * line + across, wo=0 * line + across)
    past = surroundings.open_shares(points, toward[None], np.full((1, 3), 100.0))
    assert past.min() == 0
    assert ((past > 0.2) & (past < 0.8)).sum() > 20


def test_a_mirror_ball_shows_the_ground_its_shadow_the_object_and_the_map(stage):
    size = stage.window.size
    drawn = stage.draw(np.full((16, 32, 3), 0.5, np.float32), "mirror")[..., :3]
    row, column = (np.array([share * size for share in pair]).astype(int) for pair in ((0.72, 0.72), (0.35, 0.65)))
    left, right = drawn[row, column]
    np.testing.assert_allclose(left / left.sum(), inverse_response(LEFT) / inverse_response(LEFT).sum(), atol=0.1)
    np.testing.assert_allclose(right / right.sum(), inverse_response(RIGHT) / inverse_response(RIGHT).sum(), atol=0.1)
    np.testing.assert_allclose(drawn[round(0.25 * size), size // 2], 0.5, atol=0.02)
    assert drawn[round(0.92 * size), size // 2].max() < 0.5 * left.max()  # its own shadow
    facing = drawn[size // 2, round(0.19 * size)]
    assert facing[1] > 2 * max(facing[0], facing[2])  # the green ball

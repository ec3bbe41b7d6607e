"""The ground and the real object of a photo around an inserted one: where they stand, what they show, what they do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.scenes import made_map, sphere_photo

import anyprobe
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import inverse_response
from anyprobe.estimate.photo import load_photo
from anyprobe.relight.ground_map import GroundPicture
from anyprobe.relight.insert import Arrangement, Stage
from anyprobe.relight.path_traced import trace_among
from anyprobe.relight.photographed import ShownSurface, likely_places, shown_ground, shown_object, standing_object
from anyprobe.render.mesh import Mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.surface import frame_object
from anyprobe.scatter.materials import MATERIALS

pytestmark = pytest.mark.usefixtures("rough_shadows")

WIDTH, HEIGHT, DIAMETER = 240, 160, 60
LEFT, RIGHT = np.array([0.9, 0.2, 0.1]), np.array([0.1, 0.2, 0.9])
FOOT = 135.0, 110.0
REAL = np.array([0.1, 0.8, 0.1])


@pytest.fixture
def stage():
    """A green ball, left on a ground that is red to the left of the inserted ball and blue to the right of it."""
    photo = load_photo(sphere_photo((60, 90), DIAMETER, HEIGHT, WIDTH))
    rgb = np.where((np.arange(WIDTH) < FOOT[0])[None, :, None], LEFT, RIGHT) * np.ones((HEIGHT, 1, 1))
    rgb = np.where(photo.mask[..., None] > 0.5, REAL, rgb).astype(np.float32)
    return Stage(replace(photo, rgb=rgb, hidden=None), sphere(24), Arrangement(size=0.8, at=FOOT, pitch_deg=20.0))


def surfaces(stage: Stage) -> tuple[ShownSurface, ShownSurface]:
    """Return ground and real object under a map of one colour."""
    light = np.full((16, 32, 3), 0.5, np.float32)
    picture = GroundPicture(stage.photo, stage.view, light)
    ground = shown_ground(picture, stage.view, stage.placement, stage.shadow(light))
    real = shown_object(stage.photo, stage.view, stage.placement)
    assert real is not None
    return ground, real


def fronts(surface: ShownSurface) -> np.ndarray:
    """Return the directions [R, C, 3], not of unit length, that the grid's cells face."""
    right, down = (np.diff(surface.points, axis=axis) for axis in (1, 0))
    return np.cross(right[:-1], down[:, :-1])


def test_ground_faces_up_and_shows_the_photo_darkened_by_the_shadow(stage):
    ground, _ = surfaces(stage)
    assert (fronts(ground) @ stage.view.up > 0).all()
    np.testing.assert_allclose((ground.points - stage.placement.foot) @ stage.view.up, 0.0, atol=2e-4)
    rows, columns = ground.radiance.shape[:2]
    row = np.arange(rows)[:, None] / (rows - 1) * (len(ground.points) - 1)
    column = (np.arange(columns) + 0.5)[None] / columns * (ground.points.shape[1] - 1)
    points = ground.points[np.round(row).astype(int), np.round(column).astype(int)]
    pixels = stage.view.pixels(points)
    away = np.linalg.norm(points - stage.placement.foot, axis=-1) / stage.placement.radius
    for low, high, color in ((98, 125, LEFT), (150, 200, RIGHT)):
        there = (pixels[..., 0] > low) & (pixels[..., 0] < high) & (pixels[..., 1] < 140) & (away < 4) & (away > 2)
        assert there.sum() > 20
        found = np.median(ground.radiance[there], axis=0)
        shown = inverse_response(color)
        assert (found <= shown * 1.01).all()
        assert (found > 0.6 * shown).all()
    assert ground.radiance[0].max() < 0.2 * ground.radiance[-1].mean()  # under the ball


def test_ground_that_the_photo_does_not_show_is_the_maps(stage):
    light = np.full((16, 32, 3), 0.5, np.float32)
    picture = GroundPicture(stage.photo, stage.view, light)
    under_camera, behind_object = -stage.view.up[None], stage.view.on_ground(60, 88)[None]
    np.testing.assert_allclose(picture.at(under_camera), 0.5, atol=1e-5)
    np.testing.assert_allclose(picture.at(behind_object), 0.5, atol=1e-5)


def test_real_object_stands_where_the_photo_shows_it_and_has_its_colour(stage):
    _, real = surfaces(stage)
    mask = stage.photo.mask > 0.5
    pixels = stage.view.pixels(real.points[1:])
    assert pixels[..., 0].min() == pytest.approx(60 - DIAMETER / 2, abs=4)
    assert pixels[..., 0].max() == pytest.approx(60 + DIAMETER / 2, abs=4)
    assert pixels[..., 1].min() == pytest.approx(np.flatnonzero(mask.any(axis=1))[0], abs=8)
    middle = real.points[1:].mean(axis=(0, 1))
    outward = (fronts(real) * (real.points[:-1, :-1] - middle)).sum(axis=-1)
    assert (outward[1:] >= -1e-9).mean() > 0.95
    np.testing.assert_allclose(real.radiance, np.broadcast_to(inverse_response(REAL), real.radiance.shape), atol=1e-5)
    beside = np.linalg.norm(real.points - stage.placement.foot - stage.placement.radius * stage.view.up, axis=-1)
    assert beside.min() > stage.placement.radius


@pytest.mark.parametrize(("top", "stands"), [(20, True), (100, False)])
def test_an_object_stands_beside_it_unless_it_is_in_its_way(stage, top, stands):
    """A spout above the inserted ball leaves it its place; one as low as it does not."""
    mask = stage.photo.mask.copy()
    mask[top : top + 10, 60:200] = 1.0
    assert (shown_object(replace(stage.photo, mask=mask), stage.view, stage.placement) is not None) == stands


def test_ground_in_the_real_objects_shade_gets_no_second_shadow(stage):
    spot, standing = stage.placement, standing_object(stage.photo, stage.view, stage.placement)
    assert standing is not None
    away = standing.positions.mean(axis=0) - spot.foot
    away -= (away @ stage.view.up) * stage.view.up
    far = spot.foot - 1.6 * spot.radius * (away / np.linalg.norm(away))[None]
    toward = standing.positions.mean(axis=0) - far[0]  # past both balls
    light = (pixel_directions(128) @ (toward / np.linalg.norm(toward)) > 0.9995)[..., None] * np.ones(3, np.float32)
    alone = stage.on(replace(stage.photo, mask=np.zeros_like(stage.photo.mask)))
    assert alone.shadow(light).at(far).max() < 0.1
    assert stage.shadow(light).at(far).min() > 0.9


def test_the_standing_objects_form_is_the_shown_ones_above_the_ground(stage):
    _, real = surfaces(stage)
    standing = standing_object(stage.photo, stage.view, stage.placement)
    assert standing is not None
    assert ((standing.positions - stage.placement.foot) @ stage.view.up).min() > -1e-9
    for edge in (np.min, np.max):
        found, shown = (edge(points.reshape(-1, 3), axis=0) for points in (standing.positions, real.points))
        np.testing.assert_allclose(found, shown, atol=0.03 * np.ptp(real.points.reshape(-1, 3), axis=0).max())
    corners = standing.positions[standing.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    middle = standing.positions.mean(axis=0)
    assert (((corners.mean(axis=1) - middle) * outward).sum(axis=-1) > -1e-9).mean() > 0.8


def test_only_what_mirrors_it_sees_the_real_object_in_one_place(stage):
    around = surfaces(stage)
    spot, up = stage.placement, stage.view.up
    for material in ("chrome", "gold", "plastic"):
        ((ground, real),) = likely_places(around, spot, up, MATERIALS[material])
        assert (ground, real) == around
    places = likely_places(around, spot, up, MATERIALS["matte"])
    assert len(places) > 4
    axis = spot.foot + spot.radius * up
    away = [np.linalg.norm(real.points - axis, axis=-1) for _, real in places]
    for one in away:
        np.testing.assert_allclose(one, away[0], rtol=1e-6)
    heights = [(real.points - spot.foot) @ up for _, real in places]
    np.testing.assert_allclose(heights[0], (around[1].points - spot.foot) @ up, atol=1e-9)
    middle = np.mean([real.points.mean(axis=(0, 1)) for _, real in places], axis=0)
    seen = around[1].points.mean(axis=(0, 1))
    turn = np.arctan2(np.cross(middle - spot.foot, seen - spot.foot) @ up, (middle - spot.foot) @ (seen - spot.foot))
    assert np.degrees(turn) == pytest.approx(0.0, abs=1.0)
    assert likely_places(around[:1], spot, up, MATERIALS["matte"]) == [[around[0]]]


@pytest.mark.slow
def test_a_matte_ball_has_no_hard_shade_of_the_real_object(stage):
    traced(None)
    spot, real = stage.placement, surfaces(stage)[1]
    toward = real.points.mean(axis=(0, 1)) - spot.foot - spot.radius * stage.view.up
    toward += 0.25 * np.linalg.norm(toward) * np.array([0.0, 0.0, 1.0])
    light = (pixel_directions(64) @ (toward / np.linalg.norm(toward)) > 0.995)[..., None] * np.full(3, 100, np.float32)
    around = stage._around(light, None)

    def red(arounds) -> np.ndarray:
        return trace_among(spot.mesh, stage.window.camera, light, MATERIALS["matte"], arounds)[..., 0]

    alone, one, likely = (
        red(arounds)
        for arounds in ([around[:1]], [around], likely_places(around, spot, stage.view.up, MATERIALS["matte"]))
    )
    lit = alone > 0.3 * alone.max()
    partly = [((left[lit] > 0.2 * alone[lit]) & (left[lit] < 0.8 * alone[lit])).mean() for left in (one, likely)]
    assert partly[0] < 0.5 * partly[1]


def test_nothing_stands_where_no_object_is_marked(stage):
    photo = replace(stage.photo, mask=np.zeros_like(stage.photo.mask))
    assert shown_object(photo, stage.view, stage.placement) is None


@pytest.mark.slow
def test_a_mirror_ball_shows_the_ground_its_shadow_the_object_and_the_map(stage):
    traced(None)
    size = stage.window.size
    light = np.full((16, 32, 3), 0.5, np.float32)
    drawn = stage.draw(light, "mirror", "mitsuba")[..., :3]
    row, column = (np.array([share * size for share in pair]).astype(int) for pair in ((0.72, 0.72), (0.35, 0.65)))
    left, right = drawn[row, column]
    np.testing.assert_allclose(left / left.sum(), inverse_response(LEFT) / inverse_response(LEFT).sum(), atol=0.1)
    np.testing.assert_allclose(right / right.sum(), inverse_response(RIGHT) / inverse_response(RIGHT).sum(), atol=0.1)
    np.testing.assert_allclose(drawn[round(0.25 * size), size // 2], 0.5, atol=0.02)
    assert drawn[round(0.92 * size), size // 2].max() < 0.5 * left.max()  # its own shadow
    facing = drawn[size // 2, round(0.19 * size)]
    assert facing[1] > 2 * max(facing[0], facing[2])  # the green ball


@pytest.mark.slow
@pytest.mark.parametrize("above", [True, False])
def test_a_surface_lights_what_is_on_its_front_and_shades_what_is_behind_it(above):
    x = np.linspace(-30, 30, 9)
    floor = np.stack(np.broadcast_arrays(x[None, :], -1.5, x[:, None] * (1 if above else -1)), axis=-1)
    floor = ShownSurface(points=floor, radiance=np.full((4, 4, 3), 3.0, np.float32))
    facing_up = fronts(floor)[0, 0, 1] > 0
    mesh = sphere(24)
    camera = frame_object(mesh, np.eye(3), 30.0, size=32)
    drawn = traced(mesh, camera, np.ones((8, 16, 3), np.float32), MATERIALS["mirror"], around=[floor])
    np.testing.assert_allclose(drawn[8, 16, :3], 1.0, atol=0.05)
    np.testing.assert_allclose(drawn[24, 16, :3], 3.0 if facing_up else 0.0, atol=0.05)


@pytest.mark.slow
def test_grain_has_no_streaks(monkeypatch):
    """Errors of a pixel say nothing of those to its right, however many steps the paths are traced in."""
    mesh, light = sphere(24), made_map()
    camera = frame_object(mesh, np.eye(3), 30.0, size=64)
    many = traced(mesh, camera, light, MATERIALS["matte"], num_paths=1024)
    monkeypatch.setattr("anyprobe.relight.path_traced.PATHS_AT_ONCE", 16 * camera.size**2)
    few = traced(mesh, camera, light, MATERIALS["matte"])
    on = (few[..., 3] == 1) & (many[..., 3] == 1)
    error = np.where(on, (few - many)[..., 0] / np.maximum(many[..., 0], 1e-3), 0.0)
    together = [(error[:, k:] * error[:, :-k])[on[:, k:] & on[:, :-k]].mean() for k in (1, 2, 4)]
    assert np.mean(together) / np.square(error[on]).mean() < 0.1  # .2 of neighbours side by side


def traced(mesh: Mesh | None, *arguments, **options) -> np.ndarray | None:
    """Trace a mesh; skip where that is not possible."""
    from anyprobe.relight.path_traced import open_mitsuba, trace_mesh

    try:
        open_mitsuba()
    except anyprobe.MissingExtra as reason:
        pytest.skip(str(reason))
    return None if mesh is None else trace_mesh(mesh, *arguments, **options)

"""The ground of training pairs: its light in closed form, the shadow on it, where it is seen."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="needs the train extra")

from anyprobe.core.frames import rotation_x  # noqa: E402
from anyprobe.core.latlong import pixel_directions  # noqa: E402
from anyprobe.dataset.asset_store import draw_map  # noqa: E402
from anyprobe.dataset.ground_plane import (  # noqa: E402
    GROUND_GRID,
    Grounds,
    Stand,
    add_ground,
    albedo_at,
    cast,
    draw_ground,
    light_directions,
    make_scenes,
)
from anyprobe.dataset.lighting import Illuminator  # noqa: E402
from anyprobe.dataset.pairs import PairConfig, PairSource  # noqa: E402
from anyprobe.dataset.seen_surroundings import ground_surroundings  # noqa: E402
from anyprobe.dataset.surfaces import SurfaceConfig, build_surfaces, even_points  # noqa: E402
from anyprobe.render.shapes import draw_shape  # noqa: E402

EVEN = 2.0


def plain(albedo: float = 0.5, half: float = 1e6) -> Grounds:
    return Grounds(
        albedo=torch.full((1, 3), albedo),
        waves=torch.zeros(1, 1, 2),
        phases=torch.zeros(1, 1),
        amplitudes=torch.zeros(1, 1, 3),
        middle=torch.zeros(1, 2),
        half_sides=torch.full((1, 2), half),
        turn=torch.zeros(1),
    )


def ball(count: int = 4000) -> np.ndarray:
    """Points of a unit sphere that touches the ground one below its centre."""
    i = np.arange(count) + 0.5
    y, turn = 1 - 2 * i / count, np.pi * (1 + 5**0.5) * i
    r = np.sqrt(1 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=-1).astype(np.float32)


def standing(directions: np.ndarray, weights: np.ndarray, pitch: float = 0.0, ground: Grounds | None = None):
    """A unit sphere ten away, seen from above by pitch."""
    turn = rotation_x(-pitch)  # map from camera
    stand = Stand(
        ground=ground or plain(),
        map_from_camera=turn,
        base=torch.full((64, 128, 3), EVEN),
        directions=directions,
        weights=weights,
    )
    points = torch.from_numpy(ball() @ turn.astype(np.float32))[None]
    return make_scenes([stand], points, torch.tensor([[0.0, 0.0, -10.0]]))


def test_ground_under_an_even_sky_is_not_albedo_times_its_radiance():
    """E = pi L, so L of the ground = albedo L; below its own sphere it is darker."""
    seen, felt = add_ground(torch.full((64, 128, 3), EVEN), plain(0.3))
    below = pixel_directions(64)[..., 1] < 0
    torch.testing.assert_close(seen[below], torch.full_like(seen[below], 0.3 * EVEN), rtol=2e-3, atol=0)
    assert (seen[~below] == EVEN).all()
    assert (felt <= seen).all()
    assert felt[-1, 0, 0] == pytest.approx(0.3 * EVEN * 0.4, rel=0.02)


def test_table_covers_what_lies_beyond_its_edge():
    """One height below its centre, a table of half side 2 ends at atan(1/2) below the horizon."""
    seen, _ = add_ground(torch.full((64, 128, 3), EVEN), plain(0.3, half=2.0))
    across = pixel_directions(64)[:, 64]  # forward: along a side of the table
    on = across[:, 1] < -np.sin(np.arctan(0.5))
    np.testing.assert_array_equal(seen[:, 64, 0].numpy() < 0.9 * EVEN, on)


def test_drawn_directions_bring_another_irradiance(rng):
    radiance = draw_map(rng, height=64)[0]
    directions, weights = light_directions(radiance, 48, rng)
    assert (directions[:, 1] > 0).all()
    assert (weights >= 0).all()
    seen, _ = add_ground(torch.from_numpy(radiance), plain(1.0))
    np.testing.assert_allclose(weights.sum(axis=0) * 0.92 / np.pi, seen[-1, 0].numpy(), rtol=1e-3)


@pytest.mark.parametrize("elevation_deg", [90.0, 45.0])
def test_shadow_of_a_sphere_is_no_ellipse(elevation_deg):
    """Of axes 1 and 1 / sin(elevation), away from the light by 1 / tan(elevation) heights of the centre."""
    e = np.radians(elevation_deg)
    direction = np.float32([[[np.cos(e), np.sin(e), 0.0]]])
    reach = 4.0
    shadow = cast(torch.from_numpy(ball())[None], torch.from_numpy(direction), torch.tensor([reach]))[0, 0].bool()
    x = (np.arange(GROUND_GRID) + 0.5) / GROUND_GRID * 2 * reach - reach
    right, forth = np.meshgrid(x, x)
    level = ((right + 1 / np.tan(e)) * np.sin(e)) ** 2 + forth**2
    sure = np.abs(np.sqrt(level) - 1) > 2.5 * reach / GROUND_GRID
    np.testing.assert_array_equal(shadow.numpy()[sure], (level < 1)[sure])


def test_shadow_is_seen_elsewhere_than_where_it_lies():
    """Straight from above, a light from the right at 45 degrees: dark one height to the left, lit to the right."""
    direction = np.float32([[np.sqrt(0.5), np.sqrt(0.5), 0.0]])
    scenes = standing(direction, np.ones((1, 3), np.float32), pitch=np.pi / 2)
    at = torch.tensor([[[[x, 0.0, -11.0] for x in (-1.6, 1.6, -4.0)]]])
    seen = scenes.see(torch.nn.functional.normalize(at, dim=-1))[0, 0, 0]
    torch.testing.assert_close(seen, torch.tensor([0.0, 1.0, 1.0]) * 0.5 / np.pi)


def test_ground_is_placed_where_the_camera_sees_it_not_where_the_object_does():
    """What lies straight below the object's centre is at the bottom of its map, whatever the camera's pitch."""
    ground = plain(0.5, half=1.5)
    scenes = standing(np.float32([[0.0, 1.0, 0.0]]), np.full((1, 3), 3.0, np.float32), pitch=0.6, ground=ground)
    scenes.base[:] = 0.0

    class Still:
        def normal(self, mean, spread, shape):
            return np.zeros(shape)

        def random(self, count):
            return np.ones(count)

    frame = np.float32([[-1, 1, -1, 1]])
    mask = torch.zeros(1, 1, 128, 128)
    seen = ground_surroundings(scenes, mask, torch.tensor([0.15]), frame, Still(), lambda light: light)[0]
    up = rotation_x(-0.6)[1]
    down = -pixel_directions(64) @ up.astype(np.float32)
    table, cover = seen[0].numpy(), seen[3].numpy() > 0.5
    np.testing.assert_array_equal(cover[down > 0.3], True)
    inside = np.abs(pixel_directions(64) @ rotation_x(-0.6).T.astype(np.float32))[..., [0, 2]].max(
        axis=-1
    ) / np.maximum(down, 1e-3)
    sure = (np.abs(inside - 1.5) > 0.15) & (down > 0.1)
    lit = sure & (inside < 1.5) & (inside > 1.2)
    np.testing.assert_array_less(0.3, table[lit])
    np.testing.assert_array_equal(table[sure & (inside > 1.7) & cover], 0.0)


def test_every_ground_reflects_less_than_all_and_carries_the_object(rng):
    q = torch.from_numpy(rng.uniform(-5, 5, (1, 500, 2)).astype(np.float32))
    for _ in range(20):
        ground = draw_ground(rng)
        albedo, _ = albedo_at(ground, q)
        assert (albedo > 0).all()
        assert (albedo <= 0.92).all()
        assert albedo_at(ground, torch.zeros(1, 1, 2))[1].all()


def test_points_leave_out_a_part_of_the_shape(rng):
    mesh = draw_shape(rng)
    points = even_points(mesh, 2000)
    np.testing.assert_allclose(points[:, 1].min(), mesh.positions[:, 1].min())
    corners = mesh.positions[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    mean = (corners.mean(axis=1) * area[:, None]).sum(axis=0) / area.sum()
    np.testing.assert_allclose(points.mean(axis=0), mean, atol=0.05)


@pytest.fixture(scope="module")
def batch():
    rng = np.random.default_rng(0)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=2, points=256))
    illuminator = Illuminator([draw_map(rng, height=64)[0] for _ in range(2)], compiled=False)
    config = PairConfig(batch=12, group=6, pool=2, conditions=0, ground=0.7, surroundings=0.9, cut_out=0.2)
    return PairSource(illuminator, surfaces, config).batch(0)


def test_context_and_photo_show_different_objects(batch):
    """The middle third of the context is the photo at a quarter of its size, where the object is."""
    shrunk = torch.nn.functional.avg_pool2d(batch.photo, 4)
    middle = batch.context[:, :, 32:64, 32:64]
    there = (batch.context[:, 4].amax(dim=(1, 2)) > 0)[:, None, None]
    whole = (shrunk[:, 3] == 1) & there
    assert whole.sum() > 200
    off = (shrunk[:, :3] - middle[:, :3]).abs().amax(dim=1)[whole]
    assert off.median() < 0.02
    torch.testing.assert_close(middle[:, 3][whole], torch.ones_like(middle[:, 3][whole]))


def test_context_of_a_cut_out_shows_something(batch):
    cut = batch.context[:, 4].amax(dim=(1, 2)) == 0
    assert cut.any()
    assert not cut.all()
    assert (batch.context[cut] == 0).all()
    assert (batch.surroundings[cut] == 0).all()


def test_up_is_not_where_the_ground_ends(batch):
    """Below the horizon that `up` gives, the true map of a plain endless ground is of one colour."""
    assert torch.allclose(batch.up.norm(dim=1), torch.ones(12), atol=1e-5)
    on = batch.stands > 0
    assert on.any()
    assert not on.all()
    assert (batch.up[on, 2] > 0).all()
    assert (batch.up[on, 1] > 0.5).all()


def test_the_same_step_gives_other_pairs():
    rng = np.random.default_rng(0)
    surfaces = build_surfaces([], SurfaceConfig(views=1, procedural=1, points=64))
    maps = [draw_map(rng, height=32)[0]]
    config = PairConfig(batch=4, group=2, pool=2, ground=0.7, surroundings=0.9)
    one, other = (PairSource(Illuminator(maps, compiled=False), surfaces, config).batch(3) for _ in range(2))
    for name in ("context", "surroundings", "photo", "up"):
        assert torch.equal(getattr(one, name), getattr(other, name)), name

"""The fast world: closed forms of its light, and batches that are functions of seed and number."""

from dataclasses import fields, replace

import numpy as np
import pytest

pytest.importorskip("numba", reason="needs ./train[torch]")

from anyprobe.render.mesh import make_mesh
from anyprobe.render.shapes import sphere
from anyprobe.render.voxels import first_faces, voxelize
from anyprobe_train.world import feed
from anyprobe_train.world.batch import LightBatch, make_batch, sources_of
from anyprobe_train.world.hits import grid_start, panel_point
from anyprobe_train.world.kernels import light_panels, probe_map
from anyprobe_train.world.layout import Layout, Panel, build_scene, falling
from anyprobe_train.world.lights import Light, joined, levels, turned_map
from anyprobe_train.world.march import blocked_cells
from anyprobe_train.world.scene import FREE, GRID_POINTS, LIT
from anyprobe_train.world.views import VIEW

pytestmark = pytest.mark.ci  # its kernels are compiled first
ALBEDO = 0.4


def floor() -> Panel:
    return Panel(
        origin=np.zeros(3),
        right=np.array([1.0, 0.0, 0.0]),
        up=np.array([0.0, 0.0, -1.0]),
        half=(60.0, 60.0),
        albedo=np.full((2, 2, 3), ALBEDO, np.float32),
        side=4.0,
        alpha=1.0,
        f0=0.0,
    )


def light(sky: float, power: float = 0.0) -> Light:
    """Return even light, and a source straight above of irradiance `power`."""
    texels = levels(np.full((256, 512, 3), sky, np.float32), 8)
    count = int(power > 0)
    return Light(
        sky=np.concatenate([texels, texels]),
        direction=np.tile(np.float32([0.0, 1.0, 0.0]), (count, 1)),
        radius=np.full(count, 0.02, np.float32),
        power=np.full((count, 3), power, np.float32),
        outdoors=np.nan,
        name="even",
    )


def standing_sphere() -> np.void:
    mesh = sphere(48)
    voxels = voxelize(make_mesh(mesh.positions, mesh.faces))
    view = np.zeros(1, VIEW)[0]
    view["words"], view["low"], view["cell"] = voxels.words, voxels.low + [0.0, 1.0, 0.0], voxels.cell
    return view


def lit(view, light: Light):
    layout = Layout(panels=[floor()], others=[], lamps=[], light=light)
    scene = build_scene(view, np.array([0.0, 2.0, 6.0]), layout, np.zeros(3))
    light_panels(*scene, 1)
    numbers, places = scene[:2]
    grids = [
        numbers[grid_start(places, 0, kind) :][: GRID_POINTS**2 * 3].reshape(GRID_POINTS, GRID_POINTS, 3).mean(axis=2)
        for kind in (FREE, LIT)
    ]
    points = np.array([[panel_point(numbers, places, 0, c, r) for c in range(GRID_POINTS)] for r in range(GRID_POINTS)])
    return scene, grids, np.hypot(points[..., 0], points[..., 1])


def test_an_unshadowed_plane_reflects_albedo_times_irradiance_over_pi():
    scene, (free, reached), _ = lit(None, light(1.0, power=2.0))
    np.testing.assert_allclose(free, np.pi + 2.0, rtol=1e-3)
    np.testing.assert_allclose(reached, free, rtol=1e-6)
    seen = probe_map(*scene, (0.0, 1.0, 0.0), np.eye(3), 64)
    np.testing.assert_allclose(seen[40:], ALBEDO * (np.pi + 2.0) / np.pi, rtol=2e-3)
    np.testing.assert_allclose(seen[:20], 1.0, rtol=1e-5)


def test_the_shadow_of_a_sphere_under_a_source_above_is_as_wide_as_the_sphere():
    _, (free, reached), distance = lit(standing_sphere(), light(1e-9, power=2.0))
    np.testing.assert_allclose(free, 2.0, rtol=1e-3)
    assert reached[distance < 0.8].max() < 0.01
    np.testing.assert_allclose(reached[distance > 1.3], 2.0, rtol=1e-3)


def test_half_of_a_source_on_the_horizon_lights_a_plane():
    radius = 0.2
    even = light(1e-9, power=2.0)
    setting = replace(even, direction=np.float32([[1.0, 0.0, 0.0]]), radius=np.float32([radius]))
    _, (free, _), _ = lit(None, setting)
    expected = 2.0 * np.tan(radius) * 2 / (3 * np.pi)  # the mean height of a disc's upper half, over all of it
    np.testing.assert_allclose(free.mean(), expected, rtol=0.1)  # by a few rays
    np.testing.assert_allclose(falling(setting), expected, rtol=1e-3)


def test_the_foot_of_a_sphere_is_dark_under_an_even_sky():
    _, (free, reached), distance = lit(standing_sphere(), light(1.0))
    share = reached / free
    assert share[distance < 0.2].mean() < 0.2
    # the form factor of a sphere that touches the plane at distance d: cos / (1 + d^2), cos = 1 / sqrt(1 + d^2)
    far = (distance > 2.0) & (distance < 6.0)
    expected = 1 - (1 + distance[far] ** 2) ** -1.5
    assert np.abs(share[far] - expected).mean() < 0.02


def test_a_place_is_turned_mirrored_and_joined_to_another_by_columns():
    columns = np.arange(512)
    one = np.broadcast_to(columns[None, :, None], (256, 512, 3)).astype(np.float32)
    moved = turned_map(one, stretch=0.0, by=40, mirror=False, about=100)
    assert np.array_equal(moved[0, :, 0], (columns - 60) % 512)
    mirrored = turned_map(one, stretch=0.0, by=40, mirror=True, about=100)
    assert np.array_equal(mirrored[0, :, 0], 511 - moved[0, :, 0])
    stretched = turned_map(one, stretch=0.3, by=0, mirror=False, about=0)[0, :, 0]
    assert stretched[[0, 256]].tolist() == [0, 256]
    assert np.diff(stretched).max() == 2  # 1.3 columns for one
    nothing = np.zeros((256, 512, 3), np.float32)
    both = joined(nothing, nothing + 1, 500, 64.0, 32.0)[0, :, 0]
    assert both[[500, 20, 436, 250]].tolist() == [1.0, 1.0, 0.5, 0.0]


def test_compiled_rays_are_those_of_the_runtime():
    view = standing_sphere()
    rng = np.random.default_rng(3)
    origins = rng.uniform(-3, 3, (4000, 3))
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    voxels = voxelize(sphere(48))
    found = first_faces(voxels, origins, directions) >= 0
    rays = np.concatenate([(origins - voxels.low) / voxels.cell, directions / voxels.cell], axis=1)
    np.testing.assert_array_equal(found, [blocked_cells(voxels.words, *ray, 1e9) >= 0 for ray in rays])
    along = (origins * directions).sum(axis=1)
    nearest = np.sqrt(np.maximum((origins**2).sum(axis=1) - np.minimum(along, 0.0) ** 2, 0.0))
    clear = np.abs(nearest - 1) > 0.08
    outside = np.linalg.norm(origins, axis=1) > 1.1
    np.testing.assert_array_equal(found[clear & outside], (nearest < 1)[clear & outside])
    assert view["top"] == 0


def test_a_source_above_white_is_found_with_its_power():
    truth = np.full((64, 128, 3), 0.3, np.float32)
    truth[20:22, 40:42] = 200.0
    sources, soft = sources_of(truth)
    assert sources[:, 0].tolist() == [1.0, 0.0, 0.0]
    assert soft < 0.05
    np.testing.assert_allclose(sources[0, 5:], 199 * 4 * (np.pi / 64) ** 2 * np.sin(np.pi * 21 / 64), rtol=0.05)
    assert sources_of(np.full((64, 128, 3), 0.9, np.float32))[1] == 1.0


def test_a_batch_is_a_function_of_seed_and_number(small_world):
    one, same, other = (make_batch(small_world, 7, k) for k in (3, 3, 4))
    for field in fields(LightBatch):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(same, field.name), err_msg=field.name)
    assert not np.array_equal(one.context, other.context)
    np.testing.assert_allclose(np.linalg.norm(one.up, axis=1), 1.0, rtol=1e-5)
    assert np.isfinite(one.truth).all()
    has_object = one.crop[..., 3].any(axis=(1, 2))
    np.testing.assert_array_equal(np.isnan(one.material[:, 0]), ~has_object)


class _Now:
    """Pool that makes what it is asked for at once."""

    def __init__(self, *_):
        pass

    def submit(self, work, *args):
        made = work(*args)
        return type("Done", (), {"result": lambda self: made})()

    def shutdown(self, **_):
        pass


@pytest.fixture
def numbered(monkeypatch, tmp_path):
    """Return a feed whose photos are numbered in `fov`."""

    def make(seed, k):
        number = np.arange(2.0) + 2 * k
        return LightBatch(**{one.name: number for one in fields(LightBatch)})

    monkeypatch.setattr(feed, "ProcessPoolExecutor", _Now)
    monkeypatch.setattr(feed, "_made", make)
    return lambda step=0: feed.feed(tmp_path, tmp_path, 5, step=step)


def test_every_photo_is_seen_a_few_times_and_never_twice_in_a_round(numbered):
    source = numbered()
    rounds = [np.concatenate([next(source).fov for _ in range(min(r + 1, feed.SEEN) * feed.GROUP)]) for r in range(8)]
    assert all(len(np.unique(one)) == len(one) for one in rounds)
    counts = np.bincount(np.concatenate(rounds).astype(int))
    assert (counts[: 5 * 2 * feed.GROUP] == feed.SEEN).all()


def test_a_feed_goes_on_as_it_would_have(numbered):
    whole = numbered()
    seen = [next(whole).fov for _ in range(130)]
    for step in (0, 5, feed.GROUP, 61, 120):
        again = numbered(step)
        for expected in seen[step : step + 9]:
            np.testing.assert_array_equal(next(again).fov, expected)

"""The panorama: what the photo shows, continued, under the estimate's own light, level and with whole sources."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from support.refused import refused

import anyprobe
from anyprobe.core.frames import rotation_x, rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response, response
from anyprobe.detail.column_walk import walk_around
from anyprobe.detail.continued import continue_around
from anyprobe.detail.drawn_sources import Body, bodies_of, draw_lights
from anyprobe.detail.kinds import INDOORS, OPEN_AIR
from anyprobe.detail.layers import kind_of_place
from anyprobe.detail.place_picture import KNEE, Panorama, compose
from anyprobe.detail.spread import spread
from anyprobe.estimate.ground import Ground, up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.harmonics import project
from anyprobe.light.light_sources import LightSource
from anyprobe.maps.radiance import HALF_MAX, read_radiance
from anyprobe.match.fill import fill_hole
from anyprobe.match.plate import keep_plate, seen_in

FOV = 60.0


def place_map() -> np.ndarray:
    """[64, 128, 3]: blue sky over brown ground, and a lamp above white."""
    d = pixel_directions(64)
    sky = np.clip(d[..., 1:2] * 20 + 0.5, 0, 1)
    base = sky * np.array([0.3, 0.45, 0.8]) + (1 - sky) * np.array([0.3, 0.2, 0.12])
    lamp = 60.0 * (d @ np.array([0.6, 0.7, 0.39]) > np.cos(np.radians(5)))[..., None]
    return (base + lamp).astype(np.float32)


def photo_of(radiance: np.ndarray, height: int = 150, width: int = 200) -> np.ndarray:
    """Display values [H, W, 3] of what a level camera sees of a map."""
    focal = width / 2 / np.tan(np.radians(FOV) / 2)
    y, x = np.mgrid[:height, :width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    return response(bilinear(radiance, direction_to_uv(d / np.linalg.norm(d, axis=-1, keepdims=True)))).astype(
        np.float32
    )


@pytest.fixture(scope="module")
def drawn():
    """A map, its plate with an object in the middle, and the panorama with where it is from."""
    radiance = place_map()
    photo, mask = photo_of(radiance), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    photo = np.where(mask[..., None] > 0, np.array([1.0, 0.0, 1.0], np.float32), photo)
    plate = keep_plate(photo, mask, FOV)
    return radiance, plate, compose(radiance, plate, np.eye(3), 256)


def test_harmonics_are_the_estimates(drawn):
    radiance, _, (picture, _) = drawn
    before, after = project(radiance), project(picture)
    assert np.linalg.norm(after - before) < 0.01 * np.linalg.norm(before)


def test_the_photo_is_shown_and_the_object_is_not(drawn):
    radiance, _, (picture, origin) = drawn
    assert picture.shape == (256, 512, 3)
    seen = origin[..., 0] > 0.99
    truth = bilinear(radiance, direction_to_uv(pixel_directions(256)))
    assert seen.mean() > 0.02
    assert np.abs(response(picture) - response(truth))[seen].max() < 0.1
    magenta = (response(picture)[..., 0] > 0.8) & (response(picture)[..., 1] < 0.3)
    assert not magenta.any()
    np.testing.assert_allclose(origin.sum(axis=-1), 1.0, atol=1e-5)
    middle = origin[128, 256]
    assert middle[2] > 0.9  # where the object stood


def test_what_is_beside_the_photo_goes_on(drawn):
    """Sky above ground, 10 degrees beside the photo."""
    _, _, (picture, _) = drawn
    beside = picture[:, 256 + round((FOV / 2 + 10) / 180 * 256)]
    assert beside[110, 2] > 1.3 * beside[110, 0]  # blue above
    assert beside[140, 0] > 1.3 * beside[140, 2]  # brown below


@pytest.mark.ci
@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
@pytest.mark.parametrize("radius_deg", [0.6, 0.27, 0.05])
def test_a_sun_keeps_its_power_in_files(tmp_path, radius_deg, suffix):
    """The smallest is less than a pixel wide; all are brighter than halfs can hold."""
    d, areas = pixel_directions(512), pixel_solid_angles(512)
    towards = np.array([0.3, 0.6, -0.74]) / np.linalg.norm([0.3, 0.6, -0.74])
    near = d @ towards >= min(np.cos(np.radians(radius_deg)), (d @ towards).max())
    power = 200.0
    radiance = np.full((512, 1024, 3), 0.2, np.float32)
    radiance[near] += power / float((near * areas).sum())
    made = anyprobe.Light(radiance=radiance).panorama(512)
    kept = read_radiance(made.save(tmp_path / f"sun_panorama{suffix}"))
    assert kept.max() > HALF_MAX
    total = [float((one.mean(axis=-1) * areas).sum()) for one in (radiance, kept)]
    assert total[1] == pytest.approx(total[0], rel=0.01)


def test_a_disc_is_round_and_whole():
    radiance = place_map()
    picture, _ = compose(radiance, None, np.eye(3), 256)
    d = pixel_directions(256)
    bright = picture.mean(axis=-1) > 5.0
    inside = d[bright]
    middle = inside.mean(axis=0) / np.linalg.norm(inside.mean(axis=0))
    reach = np.degrees(np.arccos(np.clip(inside @ middle, -1, 1)))
    area = float(np.broadcast_to(pixel_solid_angles(256), bright.shape)[bright].sum())
    circle = 2 * np.pi * (1 - np.cos(np.radians(reach.max())))
    assert area > 0.85 * circle  # a square of that reach has 2 / pi of it


def test_level_turns_up_to_up():
    for pitch, roll in ((20.0, 0.0), (35.0, 8.0), (-10.0, -5.0)):
        turn = rotation_x(-np.radians(pitch)) @ rotation_z(np.radians(roll))
        np.testing.assert_allclose(turn @ up_of(pitch, roll), [0, 1, 0], atol=1e-12)


def test_the_frame_of_a_panorama_and_of_exports(tmp_path, monkeypatch):
    ground = {
        "pitch_deg": 30.0,
        "pitch_error_deg": 3.0,
        "roll_deg": 0.0,
        "contact": [1.0, 2.0],
        "source": "estimated",
        "is_doubtful": False,
    }
    light = anyprobe.Light(radiance=place_map(), origin=Origin(ground=Ground.of(ground)))
    level, camera = light.panorama(64), light.panorama(64, frame="camera")
    assert level.is_level
    assert not camera.is_level
    np.testing.assert_allclose(camera.frame_from_camera, np.eye(3))
    np.testing.assert_allclose(level.frame_from_camera @ up_of(30.0), [0, 1, 0], atol=1e-12)
    with refused("frame"):
        light.panorama(64, frame="world")
    with refused("size"):
        light.panorama(100)
    exported = {f: light.export("blender", tmp_path / f, frame=f) for f in ("level", "camera")}
    said = [json.loads(next(p for p in paths if p.suffix == ".json").read_text()) for paths in exported.values()]
    assert said[0]["origin"]["level"].startswith("+Y is up: turned by the camera's pitch of 30.0")
    assert said[1]["origin"]["level"] == "in the camera's frame: +Y is up in the photo, not in the place"
    np.testing.assert_allclose(said[1]["world_from_camera"], np.eye(3))
    np.testing.assert_allclose(np.array(said[0]["world_from_camera"]) @ up_of(30.0), [0, 1, 0], atol=1e-5)
    level.save(tmp_path / "a_panorama.exr")
    again = anyprobe.Light.load(tmp_path / "a_panorama.exr")
    np.testing.assert_allclose(again.map_from_camera, level.frame_from_camera, atol=1e-5)


@pytest.mark.parametrize(
    ("pitch", "frame", "asked", "is_level"),
    [
        (30.0, "level", (), True),  # as it was written
        (30.0, "camera", (), True),  # levelled by the export
        (30.0, "level", ("--frame", "camera"), True),  # level it stays
        (30.0, "camera", ("--frame", "camera"), False),
        (None, "level", (), False),
        (30.0, "level", ("--world-from-camera", "10,5"), None),
    ],
)
def test_an_exported_panorama_says_how_it_lies(command, work, pitch, frame, asked, is_level):
    ground = {"pitch_deg": pitch, "pitch_error_deg": 3.0, "roll_deg": 2.0, "contact": (1.0, 2.0), "source": "estimated"}
    origin = Origin(model="lift-0", ground=None if pitch is None else Ground(**ground))
    light = anyprobe.Light(radiance=place_map(), origin=origin)
    light.save(work / "a.json")
    light.panorama(64, frame=frame).save(work / "a_panorama.exr")
    assert command("export", "a_panorama.exr", "--to", "webxr", *asked, "-q").status == 0
    said = json.loads((work / "export" / "a_panorama_webxr.json").read_text())
    if is_level is None:  # how a given rotation leaves it is the user's affair
        assert "level" not in said["origin"]
    elif is_level:
        line = "+Y is up: turned by the camera's pitch of 30.0 and roll of 2.0 degrees, estimated, give or take 3"
        assert said["origin"]["level"] == line
        np.testing.assert_allclose(np.array(said["world_from_camera"]) @ up_of(30.0, 2.0), [0, 1, 0], atol=1e-4)
    else:
        assert said["origin"]["level"].startswith("in the camera's frame: ")
        assert said["origin"]["level"].endswith("pitch is not known") == (pitch is None)
        np.testing.assert_allclose(said["world_from_camera"], np.eye(3))


def test_a_panorama_that_was_turned_otherwise_is_not_called_level(command, work):
    ground = Ground(pitch_deg=30.0, pitch_error_deg=3.0, roll_deg=0.0, contact=(1.0, 2.0), source="estimated")
    light = anyprobe.Light(radiance=place_map(), origin=Origin(model="lift-0", ground=ground))
    light.save(work / "a.json")
    turned = light.rotate(rotation_x(np.radians(-25.0)))
    turned.panorama(64).save(work / "a_panorama.exr")
    assert command("export", "a_panorama.exr", "--to", "webxr", "-q").status == 0
    turned.export("webxr", "export", "own")
    for name in ("a_panorama", "own"):
        assert "level" not in json.loads((work / "export" / f"{name}_webxr.json").read_text())["origin"]


def test_a_hole_is_filled_from_around_it():
    """Stripes of one height each go on through it."""
    rows = np.linspace(0.1, 0.9, 90)[:, None, None] * np.ones((1, 120, 3))
    hole = np.zeros((90, 120), bool)
    hole[30:60, 40:80] = True
    given = np.where(hole[..., None], 0.0, rows).astype(np.float32)
    filled = fill_hole(inverse_response(given), hole)
    error = np.abs(response(filled) - rows)[hole]
    assert error.mean() < 0.04
    np.testing.assert_array_equal(fill_hole(given, np.zeros_like(hole)), given)


def test_colours_are_spread_along_rows():
    """From a window of two layers, across a hole, without an edge; all around."""
    values = np.where(np.arange(64)[:, None, None] < 32, 1.0, -1.0) * np.ones((64, 128, 3), np.float32)
    weight = np.zeros((64, 128), np.float32)
    weight[20:44, 50:80] = 1.0
    weight[28:36, 60:70] = 0.0
    found = spread(np.where(weight[..., None] > 0, values, 7.0), weight)
    assert found[22, :].min() > 0.7
    assert found[42, :].max() < -0.7
    assert found[29, 65, 0] > 0.3 > -0.3 > found[34, 65, 0]
    assert np.abs(np.diff(found[22], axis=0)).max() < 0.05


def columns_of(width, seed=0):
    """A photo of smooth columns, ln [40, width, 3], with a bright post in the columns 28 to 31."""
    random = np.random.default_rng(seed)
    ln = np.cumsum(random.normal(0, 0.1, (1, width, 1)), axis=1) * np.ones((40, 1, 3))
    ln[:, 28:32] += 3.0
    return ln.astype(np.float32), np.ones((40, width), bool)


def test_a_way_leads_through_a_photos_columns_all_around():
    ln, shown = columns_of(60)
    runs = walk_around(ln, shown, 240, per_deg=1.4)
    assert sum(run.count for run in runs) == 240
    assert min(run.count for run in runs) >= 16  # 12 degrees
    assert runs[0].step == -1
    assert runs[0].first == 59  # turned at the photo's end
    way = np.concatenate([run.first + run.step * np.arange(run.count) for run in runs])
    assert way.min() >= 0
    assert way.max() < 60
    assert walk_around(ln[:, :8], shown[:, :8], 240, per_deg=1.4) is None


def test_a_way_jumps_between_like_columns():
    ln, shown = columns_of(60)
    runs = walk_around(ln, shown, 240, per_deg=1.4)
    grey = ln[0, :, 0]
    jumps = [(a.last, b.first) for a, b in itertools.pairwise(runs) if a.last != b.first]
    followed = [abs(grey[min(max(last + 1, 0), 59)] - grey[first]) for last, first in jumps]
    assert len(jumps) > 2
    assert all(step < np.median(np.abs(grey[:, None] - grey)) for step in followed)


def test_a_way_seldom_passes_what_is_unlike_the_rest():
    shares = []
    for seed in range(6):
        runs = walk_around(*columns_of(60, seed), 240, per_deg=1.4)
        way = np.concatenate([run.first + run.step * np.arange(run.count) for run in runs])
        shares.append(((way >= 28) & (way < 32)).mean())
    assert np.mean(shares) < 0.05  # .067 of the photo


def test_texture_goes_on_around_and_through_the_objects_place():
    """Grain as fine as the pixels of a panorama is there, far from the photo too, with most of its contrast."""
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    grain = np.kron(np.random.default_rng(0).normal(0, 0.08, (75, 100)), np.ones((2, 2)))
    photo = np.clip(photo + grain[..., None], 0.02, 0.98).astype(np.float32)
    drawn = seen_in(keep_plate(photo, mask, FOV), np.eye(3), 256)
    found = continue_around(drawn)
    assert found is not None
    fine = np.abs(np.diff(found.ln.mean(axis=-1), axis=1))[115:141]
    inside = np.abs(np.diff(found.within.mean(axis=-1), axis=1))[115:141]
    seen = inside[:, 225:235].mean()
    assert inside[:, 246:266].mean() > 0.5 * seen  # the object's place
    for column in (20, 150, 380, 490):
        assert fine[:, column : column + 20].mean() > 0.4 * seen


def test_what_the_object_stands_on_is_not_repeated():
    """A red plate under the object is seen there alone."""
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[50:110, 40:160] = 1.0
    photo[114:126, 45:155] = [0.9, 0.1, 0.1]
    found = continue_around(seen_in(keep_plate(photo, mask, FOV), np.eye(3), 256))
    assert found is not None
    red = (found.ln[..., 0] - found.ln[..., 1:].max(axis=-1)).max(axis=0) > 1.0
    assert red[235:277].all()
    assert not red[:205].any()
    assert not red[307:].any()


def test_a_patchy_ground_is_no_pattern_behind_the_camera():
    """A table's edge is seen in the photo alone; what is fine goes on."""
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[60:100, 90:110] = 1.0
    photo[105:, :100] *= 2.0
    photo[105:] += np.random.default_rng(0).normal(0, 0.04, (45, 200, 1)).astype(np.float32)
    found = continue_around(seen_in(keep_plate(photo.clip(0.02, 0.98), mask, FOV), np.eye(3), 256))
    assert found is not None
    ground = found.ln[155:160].mean(axis=(0, 2))
    wide = ground.reshape(64, 8).mean(axis=1)
    assert np.ptp(wide[25:39]) > 0.9
    assert np.ptp(np.r_[wide[:16], wide[48:]]) < 0.3
    assert np.abs(np.diff(ground[:120])).mean() > 0.2 * np.abs(np.diff(ground[225:280])).mean()


def test_a_guess_is_drawn_as_a_place():
    """Its smooth horizon becomes an edge outdoors; a room has edges, and both keep the light."""
    up = pixel_directions(64)[..., 1:2]
    smooth = (0.35 + 0.25 * np.tanh(2 * up) * np.array([0.5, 0.7, 1.0])).astype(np.float32)
    steps = {}
    for kind in (None, INDOORS, OPEN_AIR):
        picture, origin = compose(smooth, None, np.eye(3), 128, kind=kind)
        steps[kind] = np.abs(np.diff(picture, axis=0)).max()
        assert np.linalg.norm(project(picture) - project(smooth)) < 0.01 * np.linalg.norm(project(smooth))
        assert origin[..., 1].min() == 1.0
    assert min(steps[INDOORS], steps[OPEN_AIR]) > 2 * steps[None]


@pytest.mark.parametrize(("fov", "rows"), [(3.0, 512), (9.0, 512), (10.0, 64), (60.0, 64)])
def test_a_telephoto_and_a_small_panorama_are_composed(fov, rows):
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    made, _ = compose(place_map(), keep_plate(photo, mask, fov), np.eye(3), rows)
    assert made.shape == (rows, 2 * rows, 3)
    assert np.isfinite(made).all()


def test_sources_have_soft_edges_and_keep_their_power():
    """A strong one falls to a tenth within less of its radius than a weak one."""
    d = pixel_directions(64)
    towards = np.array([0.6, 0.7, 0.39]) / np.linalg.norm([0.6, 0.7, 0.39])
    angle = np.degrees(np.arccos(np.clip(pixel_directions(512) @ towards, -1, 1)))
    widths = []
    for strength in (60.0, 8.0):
        lamp = strength * (d @ towards > np.cos(np.radians(5)))[..., None]
        picture, _ = compose((place_map() * 0 + 0.3 + lamp).astype(np.float32), None, np.eye(3), 512)
        means = np.array([picture[(angle > a) & (angle <= a + 0.5)].mean() - 0.3 for a in np.arange(0, 14, 0.5)])
        high, low = (int(np.argmax(means < share * means[0])) for share in (0.9, 0.1))
        widths.append((low - high) / low)
        near = (angle < 14)[..., None] * pixel_solid_angles(512)[..., None] * (picture - 0.3)
        given = (lamp * pixel_solid_angles(64)[..., None]).sum()
        assert near.sum() / 3 == pytest.approx(given, rel=0.15)
    assert 0.1 < widths[0] < 0.7 * widths[1]


def source_at(elevation_deg: float, share: float, radius_deg: float = 4.0) -> LightSource:
    up = np.radians(elevation_deg)
    direction = np.array([0.6 * np.cos(up), np.sin(up), 0.8 * np.cos(up)], np.float32)
    return LightSource(direction=direction, irradiance=np.ones(3, np.float32), radius_deg=radius_deg, share=share)


def test_a_place_has_one_sun_and_a_room_has_windows_and_lamps():
    """Whatever else the estimate takes for a source becomes a glow."""
    weak, low = source_at(20, 0.05), source_at(-20, 0.2)
    high, aside, hazy = source_at(70, 0.5, 2.0), source_at(10, 0.3), source_at(40, 0.5, 6.0)
    assert bodies_of([weak, aside, high], OPEN_AIR) == [Body.none, Body.none, Body.disc]
    assert bodies_of([hazy], OPEN_AIR) == [Body.haze]
    assert bodies_of([low], OPEN_AIR) == [Body.none]
    assert bodies_of([weak, aside, high], INDOORS) == [Body.none, Body.window, Body.disc]
    assert bodies_of([high, low, weak], INDOORS) == [Body.disc, Body.none, Body.none]
    assert bodies_of([low], INDOORS) == [Body.window]  # as where a lamp beside the camera points down
    assert bodies_of([weak, aside, high], None) == [Body.disc] * 3


@pytest.mark.parametrize("kind", [INDOORS, OPEN_AIR])
def test_a_window_and_a_sun_are_where_the_source_is_with_its_power(kind):
    d, areas = pixel_directions(256), pixel_solid_angles(256)
    source = source_at(15, 0.5, 6.0)
    black = np.zeros((256, 512, 3), np.float32)
    drawn = draw_lights([source], black[..., :1], black, kind)[..., 1]
    facing = np.maximum(d @ source.direction, 0.0)
    assert float((drawn * facing * areas).sum()) == pytest.approx(1.0, rel=0.01)
    bright = drawn > 0.5 * drawn.max()
    middle = (bright * areas)[..., None] * d
    middle = middle.sum(axis=(0, 1)) / np.linalg.norm(middle.sum(axis=(0, 1)))
    assert middle @ source.direction > np.cos(np.radians(1.0))
    if kind == INDOORS:
        solid = float((bright * areas).sum())
        assert solid == pytest.approx(np.pi * np.radians(6.0) ** 2, rel=0.2)  # the bars are dark


def test_highlights_are_shown_and_the_photo_is_as_it_was():
    ramp = np.geomspace(0.01, 16.0, 128, dtype=np.float32)[None, :, None] * np.float32([1.0, 0.5, 0.25])
    shown = Panorama(radiance=np.repeat(ramp, 64, 0), origin=ramp, frame_from_camera=np.eye(3), is_level=True).display()
    dark = ramp[0, :, 0] < KNEE
    np.testing.assert_allclose(shown[:1, dark], response(ramp[:, dark]), rtol=1e-5)
    assert (np.diff(shown[0, :, 0]) > 0).all()
    assert shown[0, -1, 0] == pytest.approx(1.0, abs=0.01)
    assert shown[0, -1, 2] < 0.7  # its hue stays


def test_a_photo_far_darker_than_the_light_is_no_hole():
    """Behind a flash: it is shown brighter, and white stays white."""
    photo, mask = 0.15 * photo_of(place_map()), np.zeros((150, 200), np.float32)
    photo[20:30, 20:60] = 1.0
    mask[50:110, 80:120] = 1.0
    estimate = np.full((64, 128, 3), 0.3, np.float32)
    plate = keep_plate(photo, mask, FOV)
    (lifted, _), (same, origin) = (compose(gain * estimate, plate, np.eye(3), 256) for gain in (1.0, 0.01))
    seen = origin[..., 0] > 0.99
    dark, white = seen & (same.max(axis=-1) < 0.1), seen & (same.min(axis=-1) > 0.9)
    assert np.median(lifted[dark] / np.maximum(same[dark], 1e-6)) > 3
    assert lifted[white].mean() == pytest.approx(same[white].mean(), rel=0.1)


def test_an_estimate_of_open_air_tells_the_kind_where_the_photo_shows_neither_sky_nor_plants():
    plate = keep_plate(np.full((60, 80, 3), [0.5, 0.4, 0.3], np.float32), np.zeros((60, 80), np.float32), FOV)
    up = pixel_directions(64)[..., 1:2] > 0
    sky, room = (np.where(up, top, np.float32([0.2] * 3)) for top in np.float32([[0.5, 0.7, 1.2], [0.5, 0.5, 0.5]]))
    assert kind_of_place({}, plate, [], sky) == OPEN_AIR
    assert kind_of_place({}, plate, [], room) == INDOORS
    assert kind_of_place({}, None, [], sky) == INDOORS  # a cut-out


def test_a_dark_room_is_shown_though_it_tells_nothing_of_the_light():
    rng = np.random.default_rng(1)
    picture = (rng.uniform(0, 0.12, (120, 160, 3)) * 255).astype(np.uint8)
    mask = np.zeros((120, 160), np.float32)
    mask[40:90, 60:110] = 1.0
    picture[mask > 0] = 200
    photo = load_photo(picture, mask=mask)
    assert photo.surroundings is None
    assert photo.shows_place
    flat = np.where(mask[..., None] > 0, picture, 128).astype(np.uint8)
    assert not load_photo(flat, mask=mask).shows_place


def test_a_light_without_photo_has_a_panorama_of_its_own_map():
    light = anyprobe.Light(radiance=place_map())
    made = light.panorama(128)
    assert made.origin[..., 1].min() == 1.0
    assert np.linalg.norm(project(made.radiance) - light.sh9()) < 0.01 * np.linalg.norm(light.sh9())
    assert replace(light, origin=Origin(photo="x")).panorama(64).radiance.shape == (64, 128, 3)

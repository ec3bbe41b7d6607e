"""The panorama: what the photo shows, continued, under the estimate's own light, level and with whole sources."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.refused import refused

import anyprobe
from anyprobe.core.frames import rotation_x, rotation_z
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import inverse_response, response
from anyprobe.detail.place_picture import compose
from anyprobe.detail.quilt import continue_right, join_of, strewn
from anyprobe.estimate.ground import Ground, up_of
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import HALF_MAX, read_radiance
from anyprobe.match.fill import fill_hole
from anyprobe.match.plate import keep_plate

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
    assert "level" not in said[1]["origin"]
    np.testing.assert_allclose(said[1]["world_from_camera"], np.eye(3))
    np.testing.assert_allclose(np.array(said[0]["world_from_camera"]) @ up_of(30.0), [0, 1, 0], atol=1e-5)
    level.save(tmp_path / "a_panorama.exr")
    again = anyprobe.Light.load(tmp_path / "a_panorama.exr")
    np.testing.assert_allclose(again.map_from_camera, level.frame_from_camera, atol=1e-5)


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


def test_a_picture_goes_on_in_strips_without_a_jump():
    """A slope of brightness and a horizon keep their rows; nothing is brighter or darker than in the picture."""
    x = np.linspace(0.0, 3.0, 90)
    picture = np.repeat((np.arange(60)[:, None] > 25) + 0.2 * np.sin(7 * x), 3).reshape(60, 90, 3).astype(np.float32)
    found = continue_right(picture, np.zeros((60, 90)), 300, seed=1)
    assert found.shape == (60, join_of(90) + 300, 3)
    assert found[:24].max() < 0.5 < found[28:].min() < found.max() < 1.5
    joined = np.concatenate([picture[:, : -join_of(90)], found], axis=1)
    assert np.abs(np.diff(joined, axis=1)).max() < 0.25


@pytest.mark.parametrize("width", [6, 9, 20, 27, 28])
@pytest.mark.parametrize("height", [2, 5, 40])
def test_a_narrow_picture_goes_on_too(height, width):
    """As a telephoto's, or any photo's in a panorama of few rows."""
    picture = np.random.default_rng(0).random((height, width, 3), np.float32)
    found = continue_right(picture, np.zeros((height, width)), 60, seed=1)
    assert found.shape == (height, join_of(width) + 60, 3)
    assert np.isfinite(found).all()


@pytest.mark.parametrize(("fov", "rows"), [(3.0, 512), (9.0, 512), (10.0, 64), (60.0, 64)])
def test_a_telephoto_and_a_small_panorama_are_composed(fov, rows):
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    made, _ = compose(place_map(), keep_plate(photo, mask, fov), np.eye(3), rows)
    assert made.shape == (rows, 2 * rows, 3)
    assert np.isfinite(made).all()


def test_strewn_blocks_have_the_textures_contrast():
    texture = np.random.default_rng(0).normal(0, 0.3, (40, 50, 3)).astype(np.float32)
    found = strewn(texture, 12, 120, seed=0)
    assert found.shape == (120, 120, 3)
    assert found.std() == pytest.approx(0.3, rel=0.1)
    assert abs(found.mean()) < 0.03


def test_only_a_strong_source_has_the_outline_of_a_disc():
    d = pixel_directions(64)

    def edge(strength: float) -> float:
        """Part of the light's peak that is left a third further out than half of it."""
        towards = np.array([0.6, 0.7, 0.39]) / np.linalg.norm([0.6, 0.7, 0.39])
        lamp = strength * (d @ towards > np.cos(np.radians(5)))[..., None]
        picture, _ = compose((place_map() * 0 + 0.3 + lamp).astype(np.float32), None, np.eye(3), 512)
        angle = np.degrees(np.arccos(np.clip(pixel_directions(512) @ towards, -1, 1)))
        means = [picture[(angle > a) & (angle <= a + 0.5)].mean() - 0.3 for a in np.arange(0, 12, 0.5)]
        half = int(np.argmax(np.array(means) < 0.5 * means[0]))
        return means[round(1.3 * half)] / means[0]

    assert edge(60.0) < 0.1 < edge(8.0)


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

"""The panorama: what the photo shows, continued, under the estimate's own light, level and with whole sources."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import anyprobe
from anyprobe.core.camera import PinholeCamera
from anyprobe.core.color import luminance
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions, pixel_solid_angles
from anyprobe.core.response import response
from anyprobe.estimate.ground import Ground, up_of
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import HALF_MAX, read_radiance
from anyprobe.place.panorama import KNEE, Panorama, compose
from anyprobe.place.plate import keep_plate
from anyprobe.place.screened import screened

FOV = 60.0


def place_map() -> np.ndarray:
    """[64, 128, 3]: blue sky over brown ground, and a lamp above white."""
    d = pixel_directions(64)
    sky = np.clip(d[..., 1:2] * 20 + 0.5, 0, 1)
    base = sky * np.array([0.3, 0.45, 0.8]) + (1 - sky) * np.array([0.3, 0.2, 0.12])
    lamp = 60.0 * (d @ np.array([0.6, 0.7, 0.39]) > np.cos(np.radians(5)))[..., None]
    return (base + lamp).astype(np.float32)


def photo_of(radiance: np.ndarray, height: int = 150, width: int = 200, fov: float = FOV) -> np.ndarray:
    """Display values [H, W, 3] of what a level camera sees of a map."""
    focal = width / 2 / np.tan(np.radians(fov) / 2)
    y, x = np.mgrid[:height, :width] + 0.5
    d = np.stack([(x - width / 2) / focal, (height / 2 - y) / focal, -np.ones_like(x)], axis=-1)
    return response(bilinear(radiance, direction_to_uv(d / np.linalg.norm(d, axis=-1, keepdims=True)))).astype(
        np.float32
    )


def drawn_by(fov: float):
    """A map, its plate with an object in the middle, and the panorama with where it is from."""
    radiance = place_map()
    photo, mask = photo_of(radiance, fov=fov), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    photo = np.where(mask[..., None] > 0, np.array([1.0, 0.0, 1.0], np.float32), photo)
    plate = keep_plate(photo, mask, PinholeCamera.of_fov(200, 150, fov))
    return radiance, plate, compose(radiance, plate, np.eye(3), 256)


@pytest.fixture(scope="module")
def drawn():
    return drawn_by(FOV)


def luminance_harmonics(radiance: np.ndarray) -> np.ndarray:
    return luminance(project(radiance))


def test_the_light_is_near_the_estimates_and_all_harmonics_are_its_of_a_panorama_to_render_with(drawn):
    radiance, plate, (picture, _) = drawn
    before, after = luminance_harmonics(radiance), luminance_harmonics(picture)
    assert np.linalg.norm(after - before) < 0.1 * np.linalg.norm(before)
    lit, _ = compose(radiance, plate, np.eye(3), 256, lit=True)
    assert np.linalg.norm(luminance_harmonics(lit) - before) < 0.005 * np.linalg.norm(before)


def test_the_colour_of_the_estimate_gives_way_to_the_photos_beside_it():
    """An orange light about a grey photo: the world is grey beside the photo and less orange everywhere."""
    estimate = np.full((64, 128, 3), [0.6, 0.3, 0.05], np.float32)
    photo = np.full((150, 200, 3), 0.5, np.float32) + 0.05 * np.indices((150, 200)).sum(axis=0)[..., None] % 2 / 10
    plate = keep_plate(photo, np.zeros((150, 200), np.float32), PinholeCamera.of_fov(200, 150, FOV))
    picture, _ = compose(estimate, plate, np.eye(3), 64)
    ratio = picture[..., 0] / picture[..., 2]
    beside, behind = ratio[32, 64 + round((FOV / 2 + 10) / 180 * 64)], ratio[32, 0]
    assert beside < 2 < behind < 12


def test_nothing_ends_at_the_photos_border_and_what_is_not_known_is_smooth():
    """Whatever the photo shows, neighbouring pixels outside it differ by little."""
    rng = np.random.default_rng(0)
    photo = rng.uniform(0.1, 0.9, (30, 40, 3)).repeat(5, axis=0).repeat(5, axis=1).astype(np.float32)
    plate = keep_plate(photo, np.zeros((150, 200), np.float32), PinholeCamera.of_fov(200, 150, FOV))
    picture, origin = compose(np.full((64, 128, 3), 0.3, np.float32), plate, np.eye(3), 256)
    ln = np.log(picture)
    outside = origin[:, :-1, 0] + origin[:, 1:, 0] == 0
    assert np.abs(np.diff(ln, axis=1)).max(axis=-1)[outside].max() < 0.25
    far = np.abs(np.arange(512) - 256) > 160
    assert np.ptp(ln[:, far], axis=1).max() < 0.2


def test_a_membrane_between_two_values_is_straight_and_a_screened_one_fades_by_its_reach():
    weight = np.zeros((64, 128), np.float32)
    weight[:, [32, 96]] = 1e3
    values = np.zeros((64, 128, 1), np.float32)
    values[:, 96] = 1.0
    found = screened(values, weight + 1e-6, np.array([1.0, 0.01]))[32, :, 0]
    np.testing.assert_allclose(found[32:97], np.linspace(0, 1, 65), atol=0.03)
    reach = np.radians(20.0)
    weight = np.ones((64, 128), np.float32)
    weight[:, 32], values[:] = 1e3, 0
    values[:, 32] = 1.0
    found = screened(values, weight, np.array([reach, 1e-3]))[32, :, 0]
    away = np.arange(0, 20)
    np.testing.assert_allclose(found[32 + away], np.exp(-np.radians(away * 180 / 64) / reach), atol=0.03)


@pytest.mark.ci
def test_a_wide_photo_is_shown_sharp_away_from_its_border_and_the_object_is_not():
    radiance, _, (picture, origin) = drawn_by(100.0)
    assert picture.shape == (256, 512, 3)
    seen = origin[..., 0] > 0.99
    truth = bilinear(radiance, direction_to_uv(pixel_directions(256)))
    assert seen.mean() > 0.01
    assert np.abs(response(picture) - response(truth))[seen].max() < 0.1
    magenta = (response(picture)[..., 0] > 0.8) & (response(picture)[..., 1] < 0.3)
    assert not magenta.any()
    np.testing.assert_allclose(origin.sum(axis=-1), 1.0, atol=1e-5)
    middle = origin[128, 256]
    assert middle[2] > 0.9  # where the object stood


def test_nothing_of_a_narrow_photo_ends_at_an_edge():
    """Stripes of a pixel each, and an object in the middle: what is left of them dies away towards both."""
    photo, mask = np.full((150, 200, 3), 0.2, np.float32), np.zeros((150, 200), np.float32)
    photo[:, ::8] = photo[:, 1::8] = photo[:, 2::8] = photo[:, 3::8] = 0.9
    mask[50:110, 80:120] = 1.0
    plate = keep_plate(photo, mask, PinholeCamera.of_fov(200, 150, 40.0))
    picture, _ = compose(np.full((64, 128, 3), 0.3, np.float32), plate, np.eye(3), 512)
    steps = np.abs(np.diff(np.log(picture), axis=1)).max(axis=-1)
    inside = steps[236:276, 512 - 50 : 512 + 50].max(axis=0)
    assert inside[:8].max() < 0.05
    assert inside[-8:].max() < 0.05


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


@pytest.mark.parametrize(("fov", "rows"), [(3.0, 512), (9.0, 512), (10.0, 64), (60.0, 64)])
def test_a_telephoto_and_a_small_panorama_are_composed(fov, rows):
    photo, mask = photo_of(place_map()), np.zeros((150, 200), np.float32)
    mask[50:110, 80:120] = 1.0
    made, _ = compose(place_map(), keep_plate(photo, mask, PinholeCamera.of_fov(200, 150, fov)), np.eye(3), rows)
    assert made.shape == (rows, 2 * rows, 3)
    assert np.isfinite(made).all()


def test_a_strong_source_keeps_its_place_and_a_weak_one_shows_no_glow_of_its_own():
    d = pixel_directions(64)
    towards = np.array([0.6, 0.7, 0.39]) / np.linalg.norm([0.6, 0.7, 0.39])
    angle = np.degrees(np.arccos(np.clip(pixel_directions(256) @ towards, -1, 1)))
    for strength in (60.0, 8.0):
        lamp = strength * (d @ towards > np.cos(np.radians(5)))[..., None]
        estimate = (place_map() * 0 + 0.3 + lamp).astype(np.float32)
        picture, _ = compose(estimate, None, np.eye(3), 256)
        is_strong = strength == 60.0
        assert (angle.ravel()[picture.sum(axis=-1).argmax()] < 1) == is_strong
        assert (picture.max() > 100) == is_strong
        assert (picture.max() < 0.5) == (not is_strong)
        before = luminance_harmonics(estimate)
        assert luminance_harmonics(picture)[0] == pytest.approx(before[0], rel=0.05)
        lit, _ = compose(estimate, None, np.eye(3), 256, lit=True)
        assert np.linalg.norm(luminance_harmonics(lit) - before) < 0.01 * np.linalg.norm(before)


def test_highlights_are_shown_and_the_photo_is_as_it_was():
    ramp = np.geomspace(0.01, 16.0, 128, dtype=np.float32)[None, :, None] * np.float32([1.0, 0.5, 0.25])
    shown = Panorama(radiance=np.repeat(ramp, 64, 0), origin=ramp, frame_from_camera=np.eye(3), is_level=True).display()
    dark = ramp[0, :, 0] < KNEE
    np.testing.assert_allclose(shown[:1, dark], response(ramp[:, dark]), rtol=1e-5)
    assert (np.diff(shown[0, :, 0]) > 0).all()
    assert shown[0, -1, 0] == pytest.approx(1.0, abs=0.01)
    assert shown[0, -1, 2] < 0.7  # its hue stays


def test_a_dark_room_is_shown_and_white_paper_is_not(estimator):
    rng = np.random.default_rng(1)
    picture = (rng.uniform(0, 0.12, (120, 160, 3)) * 255).astype(np.uint8)
    mask = np.zeros((120, 160), np.float32)
    mask[40:90, 60:110] = 1.0
    picture[mask > 0] = 200
    assert estimator(picture, mask=mask).plate is not None
    flat = np.where(mask[..., None] > 0, picture, 235).astype(np.uint8)
    assert estimator(flat, mask=mask).plate is None


def test_a_light_without_photo_has_a_panorama_of_its_own_map():
    light = anyprobe.Light(radiance=place_map())
    made = light.panorama(128, lit=True)
    assert made.origin[..., 1].min() == 1.0
    assert np.linalg.norm(luminance(project(made.radiance) - light.sh9())) < 0.01 * np.linalg.norm(light.sh9())
    assert replace(light, origin=Origin(photo="x")).panorama(64).radiance.shape == (64, 128, 3)

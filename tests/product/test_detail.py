"""Maps with plausible detail: the estimate's light, a library's structure."""

from __future__ import annotations

import json
import zipfile

import numpy as np
import pytest
from support.places import place

from anyprobe.core.frames import rotation_x, world_from_camera
from anyprobe.core.latlong import pixel_directions
from anyprobe.core.response import response
from anyprobe.detail.blend import enlarged_planes
from anyprobe.detail.plausible import add_detail
from anyprobe.errors import InputError, InvalidEnvironment
from anyprobe.light.dominant_light import find_dominant_light
from anyprobe.light.environment import reduced, rotate
from anyprobe.light.filtering import blur_cosine_power, irradiance_map
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import write_exr
from anyprobe.match.alignment import find_matches, seen_in_photo
from anyprobe.match.library import codes_of, decode, encode, richness_of, write_library
from anyprobe.match.library_folder import open_library


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    path = tmp_path_factory.mktemp("library") / "places.zip"
    write_library(path, ((f"place-{seed}", encode(place(seed))) for seed in range(6)))
    return open_library(path)


@pytest.fixture(scope="module")
def estimate():
    """Smooth, in a camera that looks down by 20 degrees, with a lamp above white."""
    radiance = rotate(place(3), world_from_camera(1.0, np.radians(20)).T)
    return np.maximum(blur_cosine_power(reduced(radiance, 64), 30.0), 0.0)


def test_detail_leaves_harmonics_and_what_is_matte_as_they_were(library, estimate):
    found = add_detail(estimate, None, library=library, rows=256)
    before, after = project(estimate), project(found.radiance)
    assert np.linalg.norm(after - before) < 0.002 * np.linalg.norm(before)
    white = irradiance_map(estimate), irradiance_map(reduced(found.radiance, 64))
    assert np.abs(white[1] - white[0]).max() < 0.02 * white[0].mean()


def test_the_dominant_light_stays_where_the_estimate_has_it(library, estimate):
    found = add_detail(estimate, None, library=library, rows=256)
    before, after = find_dominant_light(estimate), find_dominant_light(found.radiance)
    assert before.direction @ after.direction > np.cos(np.radians(2))
    np.testing.assert_allclose(after.irradiance, before.irradiance, rtol=0.3)


def test_detail_is_the_candidates_and_not_a_blur(library, estimate):
    """Fine structure correlates with the candidate's, and has its strength."""
    found = add_detail(estimate, None, library=library, rows=128, level_from_map=rotation_x(-np.radians(20)))
    assert found.name == "place-3"
    truth = rotate(place(3), world_from_camera(1.0, np.radians(20)).T)
    fine = [response(x) - blur_cosine_power(response(x), 60.0) for x in (found.radiance, truth)]
    dim = [x[truth.max(axis=-1) < 1] for x in fine]
    assert np.corrcoef(dim[0].ravel(), dim[1].ravel())[0, 1] > 0.6
    assert 0.6 < dim[0].std() / dim[1].std() < 1.4


@pytest.mark.parametrize(("kind", "names"), [("outdoors", {"outdoor"}), ("indoors", {"room", "studio"})])
def test_a_place_is_of_the_photo_s_kind_whatever_its_light(kind, names):
    sky = np.where(pixel_directions(64)[..., 1:2] > 0, (0.4, 0.6, 1.0), (0.1, 0.15, 0.05)).astype(np.float32)
    lamp = np.where(pixel_directions(64)[..., 1:2] > 0.9, 3.0, (0.3, 0.25, 0.2)).astype(np.float32)
    for light in (sky, lamp):
        assert add_detail(light, rows=64, kind=kind).name.split("-")[0] in names


@pytest.mark.parametrize(("yaw", "pitch"), [(0.3, 0), (2.0, 15), (4.4, 40), (5.9, 63)])
def test_a_place_of_the_library_is_found_and_turned_as_the_camera_was(library, yaw, pitch):
    map_from_camera = world_from_camera(yaw, np.radians(pitch))
    seen = reduced(rotate(place(2), map_from_camera.T), 64)
    match = find_matches(np.maximum(seen, 0.0) * 0.2, None, library, rank=0)[0]
    assert match.name == "place-2"
    turn = match.candidate_from_estimate @ map_from_camera.T
    assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 8
    assert np.ptp(match.ln_gain) < 0.1


def test_what_is_not_certain_does_not_choose(library):
    """Half of the sphere shows another place upside down: that misleads, unless the confidence there is low."""
    spoiled = np.maximum(reduced(place(1), 64), 0.0)
    spoiled[:, :64] = reduced(place(2), 64)[:, 64:][::-1]
    confidence = np.ones((64, 128), np.float32)
    confidence[:, :64] = 0.0
    assert find_matches(spoiled, None, library, rank=0)[0].name != "place-1"
    assert find_matches(spoiled, confidence, library, rank=0)[0].name == "place-1"


def test_no_seam_behind_the_camera_and_no_pinch_at_the_poles(library, estimate):
    """A pixel's step across the seam, or across a pole, is as large as elsewhere, in the mean of six places."""
    seams, poles = [], []
    for seed in range(6):
        display = response(add_detail(estimate, None, library=library, rows=128, seed=seed).radiance)
        columns = np.abs(np.diff(display, axis=1, append=display[:, :1])).mean(axis=(0, 2))
        seams.append(columns[-1] / columns.mean())
        across = [np.abs(row - np.roll(row, 128, axis=0)).mean() for row in (display[0], display[-1])]
        poles.append(np.mean(across) / np.abs(np.diff(display, axis=0)).mean())
    assert np.mean(seams) < 1.4
    assert np.mean(poles) < 2.0


def test_smooth_fields_grow_without_a_seam_or_a_pinch():
    """Of order 1 and 2 they are the same at four times the size, across the seam and over the poles too."""
    small, large = ((d @ [0.3, 0.8, -0.5] + d[..., 0] * d[..., 2])[None] for d in map(pixel_directions, (64, 256)))
    np.testing.assert_allclose(enlarged_planes(small, 256), large, atol=0.004)


def test_the_same_input_gives_the_same_bits_and_another_seed_another_place(library, estimate):
    one, same, other = (add_detail(estimate, None, library=library, rows=64, seed=seed) for seed in (0, 0, 1))
    assert one.radiance.tobytes() == same.radiance.tobytes()
    assert other.name != one.name
    assert add_detail(estimate, None, library=library, rows=64, seed=6).name == one.name  # six in all


def test_a_sharp_estimate_keeps_its_own_detail(library):
    """What a mirror showed is neither blurred nor drawn over."""
    sharp = np.clip(reduced(place(5), 64), 0.0, 0.9)
    found = reduced(add_detail(sharp, None, library=library, rows=128).radiance, 64)
    assert np.abs(response(found) - response(sharp)).mean() < 0.06


def test_what_the_photo_shows_is_in_the_map_at_its_own_resolution(library, estimate):
    truth = place(1, 256)
    display = response(truth)
    seen = np.zeros((256, 512, 4), np.float32)
    seen[80:180, 200:300] = np.dstack([display, np.ones((256, 512))])[80:180, 200:300]
    found = add_detail(estimate, None, library=library, rows=256, seen=seen).radiance
    np.testing.assert_allclose(response(found)[85:175, 205:295], display[85:175, 205:295], atol=0.01)


def test_a_light_source_that_is_seen_is_not_drawn_twice(library):
    """Measured above white, it stands for itself; the harmonics are the estimate's all the same."""
    d = pixel_directions(128)
    sun = (d @ np.array([0.6, 0.64, -0.48]) > np.cos(0.09))[..., None]
    truth = (0.3 + 40.0 * sun * np.ones(3)).astype(np.float32)
    cover = (d[..., :1] > 0).astype(np.float32)
    seen = np.concatenate([np.where(truth > 1, truth, response(truth)) * cover, cover, cover], axis=-1)
    found = add_detail(reduced(truth, 64), None, library=library, rows=128, seen=seen).radiance
    np.testing.assert_allclose(found[cover[..., 0] > 0], truth[cover[..., 0] > 0], rtol=0.01)
    np.testing.assert_allclose(project(found), project(truth), atol=0.02 * np.abs(project(truth)).max())


@pytest.mark.ci
def test_two_light_sources_stay_two_and_the_rest_stays_as_it_is(library):
    """What lies under the second one must not be dimmed to make up for it."""
    d = pixel_directions(64)
    ways = np.array([[0.6, 0.64, -0.48], [-0.8, 0.0, 0.6]])
    estimate = np.full((64, 128, 3), 0.3, np.float32)
    for way, power in zip(ways, (600.0, 300.0), strict=True):
        estimate[d @ way > np.cos(0.07)] += power
    found = add_detail(estimate, None, library=library, rows=256).radiance
    fine = pixel_directions(256)
    assert all(found[fine @ way > np.cos(0.03)].min() > 5.0 for way in ways)
    away = (fine @ ways.T).max(axis=-1) < np.cos(0.3)
    smooth = blur_cosine_power(response(found) * away[..., None], 12.0)[away]
    usual = blur_cosine_power(response(np.full_like(found, 0.3)) * away[..., None], 12.0)[away]
    assert np.abs(smooth / usual - 1).mean() < 0.05


def test_a_black_estimate_stays_dark(library):
    found = add_detail(np.zeros((64, 128, 3), np.float32), None, library=library, rows=64)
    assert found.radiance.max() < 0.1


def test_codes_span_six_decades_in_small_steps():
    radiance = decode()
    assert radiance[0] <= np.float32(1e-3)
    assert radiance[255] >= 1e3
    middle = radiance[40:220]
    assert (np.diff(np.log(middle)) < 0.07).all()


def test_a_coded_map_is_the_map():
    radiance = place(0)
    codes = codes_of(encode(radiance * 1e4))
    ratio = np.log(decode()[codes].mean(axis=-1)) - np.log(radiance.mean(axis=-1))
    assert np.std(ratio) < 0.15
    assert abs(np.log(decode()[codes]).mean()) < 0.4  # the geometric mean is about 1
    assert richness_of(codes / np.float32(255)) > 0.04


def test_a_folder_is_indexed_once_and_again_when_it_changes(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "maps"
    folder.mkdir()
    write_exr(folder / "one.exr", place(0))
    (folder / "broken.hdr").write_bytes(b"no picture")
    assert open_library(folder).names == ("one",)
    (made,) = (tmp_path / "cache").rglob("*.zip")
    stamp = made.stat().st_mtime_ns
    open_library(folder)
    assert made.stat().st_mtime_ns == stamp
    write_exr(folder / "two.exr", place(1))
    assert open_library(folder).names == ("one", "two")


def test_a_damaged_cache_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    write_exr(tmp_path / "one.exr", place(0))
    open_library(tmp_path)
    (made,) = (tmp_path / "cache").rglob("*.zip")
    made.write_bytes(b"half a file")
    assert open_library(tmp_path).names == ("one",)


def test_our_own_library_is_whole_small_and_free_of_dates(library):
    own = open_library()
    assert len(own.names) >= 40
    assert {name.split("-")[0] for name in own.names} == {"room", "outdoor", "studio"}
    assert own.path.stat().st_size < 6e6
    for index in range(len(own.names)):
        assert own.candidate(index).shape[2] == 3
    with zipfile.ZipFile(own.path) as file:
        assert {entry.date_time for entry in file.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert json.loads(file.read("index.json"))["sources"] == []


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"rows": 100}, InputError, "expected one of 64, 128, 256, 512"),
        ({"seed": -1}, InputError, "seed: expected 0 or more"),
        ({"library": "nowhere"}, InputError, "nowhere: no such folder"),
        ({"radiance": np.zeros((32, 64, 3))}, InputError, "at least 64 rows"),
        ({"radiance": np.full((64, 128, 3), np.nan)}, InvalidEnvironment, "finite"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(library, estimate, change, error, words):
    settings = {"radiance": estimate, "library": library, "rows": 64} | change
    with pytest.raises(error, match=words) as caught:
        add_detail(settings.pop("radiance"), **settings)
    assert "\n" not in str(caught.value)


def test_a_folder_without_maps_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with pytest.raises(InputError, match="expected .exr or .hdr maps in the folder, got none"):
        open_library(tmp_path)


def test_a_photo_fills_the_map_where_its_camera_looked():
    """A photo of 80 degrees: each direction shows its own pixel; the object and what is outside show nothing."""
    size, fov = 300, 80.0
    focal = size / 2 / np.tan(np.radians(fov) / 2)
    x, y = np.meshgrid(*[(np.arange(size) + 0.5 - size / 2) / focal] * 2)
    rgb = np.dstack([x, -y, x * 0]).astype(np.float32) * 0.4 + 0.5
    mask = (np.hypot(x, y) < 0.2).astype(np.float32)
    seen = seen_in_photo(rgb, mask, fov, 128)
    d = pixel_directions(128)
    cover = seen[..., 3]
    whole = cover > 0.999
    assert whole.mean() > 0.05
    expected = 0.5 + 0.4 * np.stack([d[..., 0], d[..., 1]], -1)[whole] / -d[..., 2:][whole]
    np.testing.assert_allclose(seen[whole][:, :2], expected, atol=0.02)
    assert not cover[d[..., 2] > -0.1].any()
    assert not cover[d[..., 2] < -np.cos(0.15)].any()

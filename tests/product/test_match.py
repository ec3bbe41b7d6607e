"""anyprobe match: a folder's panoramas ranked by how they light like a photo, and brought into its frame."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.places import place
from support.scenes import sphere_photo

import anyprobe
from anyprobe.cli import match as match_command
from anyprobe.core.frames import world_from_camera
from anyprobe.core.latlong import bilinear, direction_to_uv, pixel_directions
from anyprobe.estimate.ground import Ground, up_of
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.environment import reduced, rotate
from anyprobe.light.filtering import blur_cosine_power, irradiance_map
from anyprobe.maps.radiance import read_radiance, write_exr
from anyprobe.match import ranking
from anyprobe.match.background import background_of
from anyprobe.match.library import open_library
from anyprobe.match.likeness import MATCH_ROWS, Shown, best_places, gain_of, light_of, schlick_coat
from anyprobe.match.ranking import log_odds, shading_apart

ROOT = Path(__file__).parents[2]
YAW, PITCH = 2.0, np.radians(20)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Six places, two of them in a folder of their own."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for seed in range(6):
        path = tmp_path / "maps" / ("more" if seed > 3 else "") / f"place-{seed}.exr"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_exr(path, place(seed))
    return tmp_path / "maps"


def shown_under(radiance: np.ndarray, map_from_camera: np.ndarray, albedo=(0.5, 0.2, 0.1)) -> Shown:
    """A sphere of red plastic under a map."""
    rng = np.random.default_rng(1)
    n = rng.normal(size=(160, 3))
    n[:, 2] = np.abs(n[:, 2]) + 0.3
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    wo = np.broadcast_to(np.array([0.0, 0.0, 1.0]), n.shape)
    r = 2 * n[:, 2:] * n - wo
    small = reduced(radiance, 64)
    matt = bilinear(irradiance_map(small) / np.pi, direction_to_uv(n @ map_from_camera.T))
    coat = bilinear(blur_cosine_power(small, 20.0), direction_to_uv(r @ map_from_camera.T))
    lit = matt * np.array(albedo) + coat * schlick_coat(n, wo)
    return Shown(radiance=lit, clipped=np.zeros(160, bool), n=n, wo=wo)


@pytest.fixture(scope="module")
def camera_light():
    """Place 2 as a camera sees it, and what an object shows of it."""
    turn = world_from_camera(YAW, PITCH)
    radiance = np.maximum(reduced(rotate(place(2), turn.T), 64), 0.0) * np.float32(0.3)
    return Light(radiance=radiance, find_shown=lambda: shown_under(place(2) * 0.3, turn)), turn


def ground(source: str, pitch_deg: float, error_deg: float = 5.0) -> Ground:
    return Ground(pitch_deg=pitch_deg, pitch_error_deg=error_deg, roll_deg=0.0, contact=(32, 40), source=source)


@pytest.mark.parametrize(("yaw", "pitch_deg"), [(0.3, 0), (2.0, 20), (4.4, 45)])
def test_the_map_that_lit_an_object_is_found_and_turned_as_the_camera_was(yaw, pitch_deg):
    turn = world_from_camera(yaw, np.radians(pitch_deg))
    lights = np.stack([light_of(place(seed))[0] for seed in range(6)])
    turns, misfits = best_places(shown_under(place(2), turn), lights)
    assert misfits.argmin() == 2
    apart = turns[2] @ turn.T
    assert np.degrees(np.arccos((np.trace(apart) - 1) / 2)) < 12
    _, given = best_places(shown_under(place(2), turn), lights, float(pitch_deg))
    assert given.argmin() == 2


@pytest.mark.ci
def test_background_does_not_say_where_the_camera_looked():
    turn = world_from_camera(YAW, PITCH)
    seen = np.maximum(reduced(rotate(place(2), turn.T), 64), 0.0)
    cover = (pixel_directions(64)[..., 2:] < -0.8).astype(np.float32)
    behind = background_of(seen, np.zeros_like(seen, bool), cover, np.eye(3), MATCH_ROWS)
    lights = np.stack([light_of(place(seed))[0] for seed in range(6)])
    assert behind.at_turns(lights, np.arange(6), np.repeat(turn[None], 6, axis=0)).argmin() == 2
    turns, misfits = best_places(replace(shown_under(place(2), turn), behind=behind), lights)
    assert misfits.argmin() == 2
    assert np.degrees(np.arccos((np.trace(turns[2] @ turn.T) - 1) / 2)) < 4


def test_background_of_a_photo_is_not_where_the_photo_shows_it():
    whole = anyprobe.estimate(ROOT / "examples" / "table.png", surroundings="photo").shown.behind
    assert whole.share.sum() == pytest.approx(1)
    assert whole.d[:, 2].max() < 0  # in front
    assert anyprobe.estimate(ROOT / "examples" / "vase.png").shown.behind is None  # a cut-out


def test_the_gain_lights_the_object_as_brightly_as_the_estimate():
    turn = world_from_camera(YAW, PITCH)
    light, level = light_of(place(2))
    estimate = rotate(reduced(place(2), 64), turn.T) * 0.3
    gain = gain_of(shown_under(place(2), turn), estimate, light, turn) / level
    np.testing.assert_allclose(gain, 0.3, rtol=0.03)


def test_a_light_finds_its_panorama_in_a_folder_and_brings_it_into_its_frame(folder, camera_light, tmp_path):
    light, _ = camera_light
    first, *others = light.match(folder)
    assert (first.name, first.by, len(others)) == ("place-2", "photo", 5)
    assert {one.name for one in others} >= {"more/place-4", "more/place-5"}
    path = first.write(tmp_path / "out.exr")
    written, truth = read_radiance(path), light.radiance
    assert written.shape == place(2).shape
    assert (
        np.corrcoef(np.log(reduced(written, 16) + 0.01).ravel(), np.log(reduced(truth, 16) + 0.01).ravel())[0, 1] > 0.85
    )
    exact = np.maximum(rotate(place(2), first.map_from_light.T), 0.0) * first.gain
    np.testing.assert_allclose(written, exact, rtol=2e-3, atol=1e-3)


def test_a_sun_above_the_halfs_keeps_its_power_and_colour(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    sunny = place(2)
    sunny[40:44, 100:104] = (200_000, 190_000, 170_000)
    write_exr(tmp_path / "maps" / "sunny.exr", sunny, half=False)
    first = Light(radiance=reduced(place(2), 64)).match(tmp_path / "maps")[0]
    upright = replace(first, map_from_light=np.eye(3), gain=np.array([1.0, 0.9, 0.8]))
    np.testing.assert_allclose(read_radiance(upright.write(tmp_path / "a.exr")), sunny * upright.gain, rtol=1e-3)
    small, large = (tmp_path / f"{name}.exr" for name in "bc")
    replace(upright, gain=upright.gain / 4).write(small)
    upright.write(large)
    assert small.stat().st_size < 0.7 * large.stat().st_size  # halfs, where these hold all of it


@pytest.mark.ci
def test_a_turned_light_gets_panoramas_in_its_own_frame(folder, camera_light):
    light, _ = camera_light
    quarter = world_from_camera(np.pi / 2, 0.0)
    straight, turned = light.match(folder, best=1)[0], light.rotate(quarter).match(folder, best=1)[0]
    np.testing.assert_allclose(turned.map_from_light @ quarter, straight.map_from_light, atol=1e-6)


def test_a_light_without_its_photo_is_compared_by_its_map(folder, camera_light):
    light, _ = camera_light
    found = Light(radiance=light.radiance).match(folder, best=1)[0]
    assert (found.name, found.by) == ("place-2", "map")


@pytest.mark.parametrize("by", ["photo", "map"])
@pytest.mark.parametrize("info", [{"pitch_deg": 12.0}, {"ground": ground("exif", 12.0)}])
def test_a_pitch_that_is_known_is_kept(folder, camera_light, by, info):
    """Which is eight degrees from where the maps fit best."""
    light = replace(camera_light[0], origin=Origin(**info), **({"find_shown": None} if by == "map" else {}))
    for turned in (light, light.rotate(world_from_camera(1.0, np.radians(-30)))):
        ranked = turned.match(folder)
        assert {one.by for one in ranked} == {by}
        in_camera = [one.map_from_light @ turned.map_from_camera for one in ranked]
        np.testing.assert_allclose([one[1, 2] for one in in_camera], np.sin(np.radians(12)), atol=1e-6)
        np.testing.assert_allclose([one[1, 0] for one in in_camera], 0, atol=1e-6)
    assert ranked[0].name == "place-2"


@pytest.mark.parametrize("by", ["photo", "map"])
def test_a_roll_that_the_photo_notes_is_kept(folder, by):
    """As of an iPhone that was held askew: the place and its direction are those of one that was not."""
    pitch_deg, roll_deg = 12.0, 17.0
    turn = world_from_camera(YAW, np.radians(pitch_deg), np.radians(roll_deg))
    np.testing.assert_allclose(turn.T @ [0, 1, 0], up_of(pitch_deg, roll_deg), atol=1e-9)
    radiance = np.maximum(reduced(rotate(place(2), turn.T), 64), 0.0)
    noted = Ground(pitch_deg=pitch_deg, pitch_error_deg=2.0, roll_deg=roll_deg, contact=(32, 40), source="exif")
    shown = (lambda: shown_under(place(2), turn)) if by == "photo" else None
    best = Light(radiance=radiance, find_shown=shown, origin=Origin(ground=noted)).match(folder, best=1)[0]
    assert (best.name, best.by) == ("place-2", by)
    np.testing.assert_allclose(best.map_from_light.T @ [0, 1, 0], up_of(pitch_deg, roll_deg), atol=1e-6)
    assert best.pitch_deg == pytest.approx(pitch_deg, abs=1e-3)
    assert np.degrees(np.arccos(((best.map_from_light @ turn.T).trace() - 1) / 2)) < 12


@pytest.mark.parametrize(("by", "pitch_deg", "error_deg"), [("photo", -20.0, 11.0), ("map", 20.0, 2.0)])
def test_an_estimated_pitch_is_kept_to_its_error_however_doubtful(folder, camera_light, by, pitch_deg, error_deg):
    doubtful = Origin(ground=ground("estimated", pitch_deg, error_deg))
    light = replace(camera_light[0], origin=doubtful, **({"find_shown": None} if by == "map" else {}))
    for turned in (light, light.rotate(world_from_camera(1.0, np.radians(-30)))):
        found = np.array([(one.map_from_light @ turned.map_from_camera)[1, 2] for one in turned.match(folder)])
        moved = np.degrees(np.arcsin(found)) - pitch_deg
        assert 0 < np.abs(moved).max() <= 1.75 * error_deg + 1e-6
    assert not any(doubt.code == "pitch-unknown" for doubt in match_command.match_doubts(light, light.match(folder)[0]))


@pytest.mark.parametrize("known", [None, ground("guessed", 22.0)])
def test_without_an_estimated_pitch_all_are_tried_and_the_match_says_so(folder, camera_light, known):
    behind = background_of(place(2), np.zeros_like(place(2), bool), np.ones((*place(2).shape[:2], 1)), np.eye(3), 32)
    light = replace(camera_light[0], origin=Origin(ground=known))
    ranked = light.match(folder)
    assert np.ptp([one.pitch_deg for one in ranked]) > 25
    for shown in (light.shown, replace(light.shown, behind=behind)):
        doubts = match_command.match_doubts(replace(light, find_shown=lambda shown=shown: shown), ranked[0])
        assert "pitch-unknown" in {doubt.code for doubt in doubts}


def test_files_stand_by_their_maps_and_what_cannot_be_read_is_said(folder):
    (folder / "place-0a.hdr").write_bytes(b"no picture")
    library = open_library(folder)
    assert [path.stem for path in library.files] == [name.split("/")[-1] for name in library.names]
    assert len(library.faults) == 1
    assert "place-0a.hdr" in library.faults[0]


def test_shading_is_compared_whatever_the_exposure():
    lit = np.full((64, 128, 3), 0.01, np.float32)
    lit[20, 24] = 50.0  # a lamp at the left, before the object
    assert shading_apart(lit, 3 * lit) < 1e-3
    assert shading_apart(np.ascontiguousarray(lit[:, ::-1]), lit) > 0.9


@pytest.mark.ci
def test_a_map_that_shades_unlike_the_estimate_is_less_likely(folder, camera_light, monkeypatch):
    light, _ = camera_light
    ranked = light.match(folder)
    assert match_command.fit_doubts(light.radiance, ranked[0].radiance(64)) == []
    apart = np.where(np.arange(6) == ranked[0].index, 3.0, 0.0)
    with monkeypatch.context() as patched:
        patched.setattr(ranking, "shadings_apart", lambda *given: apart)
        again = light.match(folder)
    misfits = [{one.name: one.misfit for one in some} for some in (ranked, again)]
    assert misfits[1]["place-2"] - misfits[0]["place-2"] > 15
    assert again[0].name != "place-2"
    monkeypatch.setattr(match_command, "OWN_ERROR", 0.0)
    assert [one.code for one in match_command.fit_doubts(light.radiance, ranked[0].radiance(64))] == ["match-fit"]


@pytest.mark.ci
def test_the_command_writes_maps_a_sheet_a_list_and_an_export(folder, tmp_path, monkeypatch, command):
    from PIL import Image

    photo = tmp_path / "ball.png"
    Image.fromarray(sphere_photo((64, 48))).save(photo)
    out = tmp_path / "out"
    words = ["match", str(photo), str(folder), "-o", str(out), "--best", "2", "--apply", "three", "--json"]
    result = command(*words)
    assert result.status == 0, result.err
    said = json.loads((out / "ball_match.json").read_text())
    assert [one["rank"] for one in said["matches"]] == list(range(6))
    assert len(list(out.glob("ball_[12]_*.exr"))) == 2
    assert (out / "ball_match.png").is_file()
    assert (out / "ball_three.json").is_file()
    assert any("--pitch" in line for line in said["warnings"])
    assert "expected a folder outside the panoramas" in command(*words[:4], folder / "results").complaint
    kinds = [json.loads(command(*words, kind).out)["matches"] for kind in ("--outdoors", "--indoors")]
    outside, inside = ({one["file"]: one["misfit"] for one in matches} for matches in kinds)
    gains = {name: inside[name] - outside[name] for name in outside}
    odds = {name: float(log_odds(reduced(read_radiance(name), 64)[None])[0]) for name in gains}
    assert max(gains, key=gains.get) == max(odds, key=odds.get)

"""anyprobe video --detail plausible: one place for all frames, the light as it was, and the same after an end."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.places import place
from support.scenes import made_map

pytest.importorskip("av", reason="the extra `video` is not installed")

from support.clips import sphere_frame, sphere_mask, write_clip, write_masks

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.detail.kinds import INDOORS, OPEN_AIR
from anyprobe.detail.plausible import find_place
from anyprobe.hints import PHOTO
from anyprobe.light.environment import reduced, rotate
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import map_attributes, read_radiance, write_exr
from anyprobe.match.alignment import exposed_match, find_matches, hold_match
from anyprobe.match.kind import are_outdoors
from anyprobe.match.library_folder import open_library
from anyprobe.relight.insert import Arrangement
from anyprobe.render.shapes import sphere
from anyprobe.video import run as run_module
from anyprobe.video.clip import open_clip
from anyprobe.video.following import MaskFollower
from anyprobe.video.run import ClipRun, VirtualObject

COUNT, FPS, ROWS = 6, 24, 128
pytestmark = pytest.mark.ci


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    folder = tmp_path_factory.mktemp("library")
    for seed in range(4):
        write_exr(folder / "maps" / f"place-{seed}.exr", place(seed, 64))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        return open_library(folder / "maps")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """clip.mp4 of a light that stays, seen with noise, and masks/."""
    folder = tmp_path_factory.mktemp("clip")
    rng = np.random.default_rng(1)
    write_clip(folder / "clip.mp4", [sphere_frame(made_map(), 0.02, rng) for _ in range(COUNT)], FPS)
    write_masks(folder / "masks", COUNT)
    return folder


@pytest.fixture(scope="module")
def prepare(made, estimator, library):
    """A ClipRun of the made clip into a folder, with a sphere of a material in it."""

    def prepare(folder, *, material="chrome", detail=True, **more) -> ClipRun:
        virtual = VirtualObject(mesh=sphere(8), material=material, arrangement=Arrangement(pitch_deg=15))
        follower = MaskFollower({"mask": made / "masks"}, {}, {})
        more = {"virtual": virtual} | more
        clip = open_clip(made / "clip.mp4")
        return ClipRun(clip, folder, estimator, follower, {}, exr=True, library=library if detail else None, **more)

    return prepare


def make_small(patch: pytest.MonkeyPatch) -> None:
    """Runs are saved every three frames, and draw rough shadows and maps."""
    patch.setattr(run_module, "SAVE_EVERY", 3)
    patch.setattr(run_module, "SHADOW_DIRECTIONS", 8)
    patch.setattr(run_module, "DETAIL_ROWS", ROWS)


@pytest.fixture
def begin(prepare, monkeypatch):
    make_small(monkeypatch)
    return prepare


@pytest.fixture(scope="module")
def fine(prepare, tmp_path_factory) -> ClipRun:
    """A finished run with detail."""
    run = prepare(tmp_path_factory.mktemp("fine") / "out")
    with pytest.MonkeyPatch.context() as patch:
        make_small(patch)
        run(lambda done: None)
    return run


def results(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.suffix in (".json", ".mp4", ".exr")}


@pytest.fixture
def estimate():
    return np.maximum(blur_cosine_power(reduced(place(2), 64), 30.0), 0.0)


@pytest.fixture
def hold(library):
    """hold_match that looks in the library."""
    return lambda held, radiance: hold_match(held, radiance, lambda: find_matches(radiance, None, library, 0)[0])


def test_a_place_is_held_until_the_estimate_moves_clearly_away(estimate, hold):
    """Noise, a lamp that dims and a small turn keep it; a large turn takes the place with it."""
    first = hold(None, estimate)
    assert first.match.name == "place-2"
    rng = np.random.default_rng(0)
    for near in (
        estimate * np.exp(rng.normal(0, 0.1, estimate.shape)).astype(np.float32),
        0.2 * estimate,
        rotate(estimate, rotation_y(0.03)),
    ):
        assert hold(first, np.maximum(near, 0.0)) is first
    far = hold(first, np.maximum(rotate(estimate, rotation_y(1.2)), 0.0))
    assert far.match.name == "place-2"
    expected = first.match.candidate_from_estimate @ rotation_y(1.2).T
    cosine = (np.trace(expected.T @ far.match.candidate_from_estimate) - 1) / 2
    assert np.degrees(np.arccos(min(cosine, 1.0))) < 10


def test_the_exposure_of_a_held_place_follows_the_light(estimate, hold):
    held = hold(None, estimate)
    tinted = estimate * np.array([0.5, 0.25, 0.125], np.float32)
    change = exposed_match(held, tinted).ln_gain - held.match.ln_gain
    np.testing.assert_allclose(change, np.log([0.5, 0.25, 0.125]), atol=0.02)


def test_reflections_do_not_change_their_place_and_the_light_stays(begin, fine, tmp_path):
    """The same records as without but for the place's name, and chrome that shows more and stays as still."""
    plain = begin(tmp_path, detail=False)
    plain(lambda done: None)
    (name,) = {record["detail"] for record in fine.progress.frames}
    assert fine.progress.frames == [{**record, "detail": name} for record in plain.progress.frames]
    maps = [read_radiance(fine.folder / "lights" / f"{i:06d}.exr") for i in (3, 5)]
    assert maps[0].shape == (ROWS, 2 * ROWS, 3)
    assert name in map_attributes(fine.folder / "lights" / "000003.exr")["detail"]
    for radiance, record in zip(maps, (fine.progress.frames[i] for i in (3, 5)), strict=True):
        np.testing.assert_allclose(project(radiance), record["sh9"], atol=0.01 * np.abs(record["sh9"]).max())
    dim = np.maximum(*maps).max(axis=-1) < 2  # the rest are light sources, which turn by parts of a degree
    assert dim.mean() > 0.98
    ln = [np.log(one + 0.02)[dim] for one in maps]
    assert np.std(ln[1] - ln[0]) < 0.1 * np.std(ln[0])
    assert results(fine.folder)["relit.mp4"] != results(tmp_path)["relit.mp4"]


def test_what_is_dull_is_drawn_as_without(begin, tmp_path):
    drawn = []
    for name, detail in (("plain", False), ("fine", True)):
        run = begin(tmp_path / name, material="matte", detail=detail, every=COUNT)
        run(lambda done: None)
        drawn.append(run._shown[1])
    np.testing.assert_array_equal(*drawn)


def test_a_stopped_run_goes_on_with_the_place_that_it_held(begin, fine, tmp_path, monkeypatch):
    """Also where the estimate of the frame it goes on with would choose another."""

    def stop(done: int) -> None:
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        begin(tmp_path)(stop)
    again = begin(tmp_path)
    assert again.progress.next_index == 3
    chosen = []
    monkeypatch.setattr(run_module, "find_place", lambda *given, **said: chosen.append(given))
    again(lambda done: None)
    assert not chosen
    assert results(tmp_path) == results(fine.folder)


def test_the_place_stands_still_in_the_world(begin, tmp_path):
    """Cameras that look elsewhere see other parts of one place."""
    run = begin(tmp_path, virtual=None, poses=np.array([rotation_y(0.5)] * COUNT))
    run(lambda done: None)
    run.poses = np.array([rotation_y(0.5), rotation_y(-0.9)])
    seen = [np.maximum(rotate(run._detailed(i), run.poses[i]), 0.0) for i in (0, 1)]
    one, other = (np.log(radiance + 0.02) for radiance in seen)
    assert np.corrcoef(one.ravel(), other.ravel())[0, 1] > 0.97


@pytest.mark.parametrize("pose", [None, rotation_y(0.7) @ rotation_x(0.3)])
@pytest.mark.parametrize(("beside", "kind"), [((50, 120, 40), OPEN_AIR), ((150, 95, 60), INDOORS)])
def test_a_place_is_of_the_clip_s_kind_and_stands_upright_as_for_a_photo(
    tmp_path, monkeypatch, estimator, beside, kind, pose
):
    """Outdoors on a lawn, indoors before a wall, whatever the light, and wherever the camera looks in the world."""
    texture = np.kron(np.random.default_rng(0).uniform(0.6, 1.4, (12, 16, 1)), np.ones((8, 8, 1)))
    frame = np.where(sphere_mask()[..., None] > 0, sphere_frame(made_map()), texture * np.array(beside)).astype(
        np.uint8
    )
    write_clip(tmp_path / "clip.mp4", [frame])
    follower = MaskFollower({"mask": write_masks(tmp_path / "masks", 1)}, {}, {}, PHOTO)
    asked = []
    monkeypatch.setattr(
        run_module, "find_place", lambda *given, **said: asked.append((*given, said)) or find_place(*given, **said)
    )
    poses = None if pose is None else pose[None]
    clip, library = open_clip(tmp_path / "clip.mp4"), open_library()
    run = ClipRun(clip, tmp_path / "out", estimator, follower, {}, library=library, poses=poses)
    run(lambda done: None)
    turn, of_photo = estimator(frame, mask=sphere_mask(), surroundings=PHOTO).level_and_kind()
    (_, _, _, level_from_camera, said) = asked[0]
    assert said["kind"] == of_photo == kind
    np.testing.assert_allclose(level_from_camera, turn, atol=0.05)
    match = run.progress.held_match.match
    assert are_outdoors(library)[match.index] == (kind == OPEN_AIR)
    candidate_from_camera = match.candidate_from_estimate @ (np.eye(3) if pose is None else pose)
    np.testing.assert_allclose(candidate_from_camera @ turn.T @ [0, 1, 0], [0, 1, 0], atol=0.05)


@pytest.mark.usefixtures("networks_opened_once")
def test_command_takes_detail_and_its_library(command, work, made):
    options = ("-o", "out", "--mask", made / "masks", "--every", "4", "--exr", "-q")
    assert command("video", made / "clip.mp4", *options, "--detail", "plausible").status == 0
    track = json.loads((work / "out" / "track.json").read_text())
    assert track["settings"]["detail"] == open_library().digest()
    assert all("detail" in one for one in track["frames"] if "held" in one)
    assert "--detail: out holds a run begun with" in command("video", made / "clip.mp4", *options).complaint
    assert (
        "expected one of none, plausible"
        in command("video", made / "clip.mp4", *options, "--detail", "sharp").complaint
    )


@pytest.mark.usefixtures("networks_opened_once")
def test_command_says_what_its_library_lacks(command, work, made, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(work / "cache"))
    write_exr(work / "maps" / "place.exr", place(0, 64))
    (work / "maps" / "broken.hdr").write_bytes(b"no picture")
    options = ("-o", "out", "--mask", made / "masks", "--every", "4", "--json")
    done = command("video", made / "clip.mp4", *options, "--detail", "plausible", "--detail-library", work / "maps")
    assert any(line.startswith("left out: broken.hdr") for line in json.loads(done.out)["warnings"])

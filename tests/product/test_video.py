"""anyprobe video: tracks, relit clips, going on after an end of any kind, and what is refused."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
import time
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.refused import refused
from support.scenes import made_map

pytest.importorskip("av", reason="the extra `video` is not installed")

from support.clips import SIZE, sphere_frame, sphere_mask, turned, write_clip, write_masks
from support.transforms import transforms

from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.errors import InvalidMask
from anyprobe.estimate.sidecar import FRAME, SCALE
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import read_radiance
from anyprobe.notices import Notice, give
from anyprobe.relight.insert import Arrangement
from anyprobe.render.shapes import sphere
from anyprobe.video import run as run_module
from anyprobe.video.clip import clip_size, frame_rate, join_pieces, open_clip, read_frames, write_piece
from anyprobe.video.following import MaskFollower
from anyprobe.video.run import ClipRun, VirtualObject
from anyprobe.video.track import Progress, load_progress, save_progress

COUNT, FPS = 10, 24
PROGRAM = Path(sys.executable).with_name("anyprobe")


def clip_of(folder: Path, count: int) -> Path:
    """The folder, with clip.mp4 under a light that turns, and masks/."""
    rng = np.random.default_rng(1)
    frames = [sphere_frame(turned(made_map(), 0.05 * i), 0.01, rng) for i in range(count)]
    write_clip(folder / "clip.mp4", frames, FPS)
    write_masks(folder / "masks", count)
    return folder


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A clip of COUNT frames."""
    return clip_of(tmp_path_factory.mktemp("clip"), COUNT)


@pytest.fixture(scope="module")
def brief(tmp_path_factory):
    """A clip of four."""
    return clip_of(tmp_path_factory.mktemp("brief"), 4)


@pytest.fixture(scope="module")
def prepare(made, estimator):
    """A ClipRun of the made clip into a folder."""

    def prepare(folder, *, relit=False, every=1, **settings) -> ClipRun:
        virtual = None
        if relit:
            virtual = VirtualObject(mesh=sphere(8), material="photo", arrangement=Arrangement(pitch_deg=15))
        follower = MaskFollower({"mask": made / "masks"}, {}, {})
        clip = open_clip(made / "clip.mp4")
        return ClipRun(clip, folder, estimator, follower, settings, every=every, virtual=virtual)

    return prepare


def save_often(patch: pytest.MonkeyPatch) -> None:
    """Runs are saved every four frames, and draw rough shadows."""
    patch.setattr(run_module, "SAVE_EVERY", 4)
    patch.setattr(run_module, "SHADOW_DIRECTIONS", 8)


@pytest.fixture
def begin(prepare, monkeypatch):
    """The same, saved often."""
    save_often(monkeypatch)
    return prepare


@pytest.fixture(scope="module")
def whole(prepare, tmp_path_factory):
    """Finished runs with an object in them, not to be written to: whole(3), a light for every third frame."""

    @lru_cache
    def whole(every: int) -> ClipRun:
        run = prepare(tmp_path_factory.mktemp("whole") / "out", relit=True, every=every)
        with pytest.MonkeyPatch.context() as patch:
            save_often(patch)
            run(lambda done: None)
        return run

    return whole


def files_of(folder) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir()) if p.suffix in (".json", ".mp4")}


# Tracks


@pytest.mark.ci
def test_command_writes_a_track_and_maps(command, work, made):
    done = command("video", made / "clip.mp4", "-o", "out", "--mask", made / "masks", "--exr", "--json", "-q")
    assert done.status == 0, done.err
    assert json.loads(done.out)["bad"] == []
    track = json.loads((work / "out" / "track.json").read_text())
    assert [one["index"] for one in track["frames"]] == list(range(COUNT))
    np.testing.assert_allclose([one["time_s"] for one in track["frames"]], np.arange(COUNT) / FPS, atol=1e-3)
    assert track["size"] == list(SIZE)
    assert (track["frame"], track["scale"]) == (FRAME, SCALE)  # not the inserted object's scale, which is a setting
    assert track["settings"]["scale"] == 0.5
    last = track["frames"][-1]
    steady = read_radiance(work / "out" / "lights" / f"{COUNT - 1:06d}.exr")
    np.testing.assert_allclose(last["sh9"], project(steady), rtol=0.01, atol=0.01)
    assert np.linalg.norm(last["dominant_light"]["direction"]) == pytest.approx(1, abs=1e-4)
    assert np.shape(last["sh9_ambient"]) == (9, 3)


def test_frames_per_second_are_those_of_the_frames(begin, tmp_path):
    """Some animations state the resolution of their times."""
    run = begin(tmp_path / "out")
    run.clip = replace(run.clip, fps=100_000.0)
    assert "states 100000 frames per second; track.json has 24" in run(lambda done: None).notes[-1]
    assert json.loads((tmp_path / "out" / "track.json").read_text())["fps"] == pytest.approx(FPS, rel=1e-4)
    assert [frame_rate(fps, [0.0, 0.5]) for fps in (1.5, 2.0, 100_000.0)] == [1.5, 2.0, 2.0]
    assert frame_rate(100_000.0, [0.0]) == 1000.0


@pytest.mark.ci
def test_command_uses_what_is_known_of_the_surroundings(command, work, brief):
    """A panorama without gaps is the light; a photo's own surroundings are what its frames show there."""
    panorama = np.zeros((64, 128, 3), np.uint8)
    panorama[...] = (180, 90, 45)
    Image.fromarray(panorama).save(work / "panorama.png")
    lights = {}
    for name, given in (("alone", "none"), ("photo", "photo"), ("panorama", "panorama.png")):
        options = ("--mask", brief / "masks", "--exr", "-q", "--surroundings", given)
        done = command("video", brief / "clip.mp4", "-o", name, *options)
        assert done.status == 0, done.err
        lights[name] = read_radiance(work / name / "lights" / "000003.exr")
    np.testing.assert_allclose(response(lights["panorama"]), panorama / 255, atol=0.02)
    ahead = (32, 67)  # a little right of the middle, beside the sphere
    shown = sphere_frame(made_map())[50, 74] / 255
    np.testing.assert_allclose(response(lights["photo"][ahead]), shown, atol=0.03)
    assert np.abs(response(lights["alone"][ahead]) - shown).max() > 0.05


def test_results_do_not_stand_beside_the_clip(command, brief, work):
    done = command("video", brief / "clip.mp4", "--mask", brief / "masks", "-q")
    assert done.status == 0, done.err
    assert (work / "clip_light" / "track.json").is_file()
    assert not (brief / "clip_light").exists()


@pytest.mark.ci
def test_poses_keep_the_light_still_in_the_world(begin, tmp_path):
    """Told that the camera turned instead of the light, frames agree about it, also those without one of their own."""
    poses = np.array([rotation_y(-0.05 * i) for i in range(COUNT)])
    turning = begin(tmp_path, every=3)
    turning.poses = poses
    turning(lambda done: None)
    records = turning.progress.frames
    assert all("same_as" not in one and len(one["sh9"]) == 9 for one in records)
    last = turning.progress.light.seen_from(poses[-1])
    np.testing.assert_allclose(records[-1]["sh9"], project(last), atol=1e-4)
    # the light of frame 6 as frame 8's camera sees it
    world = [rotation_y(-0.05 * i) @ records[i]["dominant_light"]["direction"] for i in (6, 7, 8)]
    np.testing.assert_allclose(world[1:], [world[0]] * 2, atol=0.02)
    turned = np.degrees(np.arccos(world[0] @ poses[0] @ records[0]["dominant_light"]["direction"]))
    assert turned < 20.0  # single frames are up to 40 degrees apart


@pytest.mark.ci
def test_command_reads_poses_and_goes_on_with_the_same_alone(command, work, made):
    order = ("video", made / "clip.mp4", "-o", "out", "--mask", made / "masks", "-q", "--poses", "poses.json")
    matrices = [rotation_y(-0.05 * i) for i in range(COUNT)]
    (work / "poses.json").write_text(transforms(matrices[:-1]))
    assert f"expected {COUNT} poses, one per frame, got {COUNT - 1}" in command(*order).complaint
    (work / "poses.json").write_text(transforms(matrices))
    assert command(*order).status == 0
    assert json.loads((work / "out" / "track.json").read_text())["settings"]["poses"]
    (work / "poses.json").write_text(transforms(matrices[::-1]))
    assert "--poses: out holds a run begun with another or none" in command(*order).complaint
    assert "expected one of them" in command(*order, "--insert", "sphere").complaint


@pytest.mark.ci
def test_every_nth_frame_has_a_light_of_its_own(whole):
    assert [one.get("same_as") for one in whole(3).progress.frames] == [None, 0, 0, None, 3, 3, None, 6, 6, None]


@pytest.mark.ci
@pytest.mark.parametrize("relit", [False, True])
def test_frame_without_object_keeps_the_light_and_is_named(begin, tmp_path, relit):
    masks = write_masks(tmp_path / "masks", COUNT)
    Image.fromarray(0 * sphere_mask()).save(masks / "0004.png")
    run = begin(tmp_path / "out", relit=relit, every=2)
    run.follower = MaskFollower({"mask": masks}, {}, {})
    outcome = run(lambda done: None)
    assert [index for index, _ in outcome.bad] == [4]
    assert "empty mask" in outcome.bad[0][1]
    assert "sh9" in run.progress.frames[6]
    assert [one.get("same_as") for one in run.progress.frames[2:7]] == [None, 2, 2, 2, None]


def test_masks_are_taken_in_the_order_one_counts_in(tmp_path, made):
    folder = tmp_path / "masks"
    folder.mkdir()
    for number in range(COUNT + 1):  # 0 ... 10
        Image.fromarray(sphere_mask() if number < COUNT else 0 * sphere_mask()).save(folder / f"m{number}.png")
    follower = MaskFollower({"mask": folder}, {}, {})
    for frame in read_frames(open_clip(made / "clip.mp4"), []):
        assert follower.photo(frame).mask.any()  # m10, which is empty, comes last


@pytest.mark.usefixtures("small_masks")
@pytest.mark.parametrize("where", [{"box": (12, 32, 70, 90)}, {"click": (40, 60)}])
def test_object_of_the_first_frame_is_followed(made, where):
    follower = MaskFollower({}, where, {})
    truth = sphere_mask() > 127
    for frame in read_frames(open_clip(made / "clip.mp4"), []):
        mask = follower.photo(frame).mask > 0.5
        assert (mask & truth).sum() / (mask | truth).sum() > 0.7


@pytest.mark.usefixtures("small_masks")
def test_another_object_is_not_taken_for_it(made):
    follower = MaskFollower({}, {}, {})
    follower.last = [40.0, 60.0, 100.0, 20, 40, 60, 80]  # the sphere has some 1250 pixels
    with pytest.raises(InvalidMask, match="about 100 pixels"):
        follower.photo(next(read_frames(open_clip(made / "clip.mp4"), [])))
    assert follower.last[2] == 100.0


# Going on


@pytest.mark.ci
@pytest.mark.parametrize(("stop_at", "every"), [(1, 1), (7, 1), (7, 3)])
def test_stopped_run_goes_on_to_the_same_files(begin, whole, tmp_path, every, stop_at):
    def stop(done: int) -> None:
        if done == stop_at:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        begin(tmp_path / "stopped", relit=True, every=every)(stop)
    assert not (tmp_path / "stopped" / "track.json").exists()
    again = begin(tmp_path / "stopped", relit=True, every=every)
    assert (again.progress.next_index > 0) == (stop_at > 6)
    again(lambda done: None)
    assert files_of(tmp_path / "stopped") == files_of(whole(every).folder)
    assert len(files_of(whole(every).folder)) == 3


@pytest.mark.ci
@pytest.mark.usefixtures("small_masks")
def test_run_that_finds_its_masks_goes_on_to_the_same_files(begin, tmp_path):
    """Saved between two looks: what the masks were moved from is not kept."""

    def started(folder) -> ClipRun:
        run = begin(tmp_path / folder, every=3)
        run.follower = MaskFollower({}, {}, {})
        return run

    def stop(done: int) -> None:
        if done == 8:
            raise KeyboardInterrupt

    started("whole")(lambda done: None)
    with pytest.raises(KeyboardInterrupt):
        started("stopped")(stop)
    again = started("stopped")
    assert again.progress.next_index == 6
    again(lambda done: None)
    assert files_of(tmp_path / "stopped") == files_of(tmp_path / "whole")


@pytest.mark.slow
def test_killed_command_goes_on_to_the_same_files(tmp_path):
    """kill -9 three times: while the first frames are not saved yet, at a save, and well after one."""
    count = 2 * run_module.SAVE_EVERY + 8
    frames = [sphere_frame(turned(made_map(), 0.02 * i)) for i in range(count)]
    clip = write_clip(tmp_path / "clip.mp4", frames, FPS)
    masks = write_masks(tmp_path / "masks", count)
    order = [PROGRAM, "video", clip, "--mask", masks, "--insert", "sphere", "--every", "3", "--exr", "-q", "-o"]

    def results(folder: Path) -> dict[str, bytes]:
        maps = {path.name: path.read_bytes() for path in (folder / "lights").iterdir()}
        return files_of(folder) | maps

    subprocess.run([*order, tmp_path / "whole"], check=True, timeout=600)
    killed = tmp_path / "killed"
    for sign in ("lights/000006.exr", ".state.npz", f"lights/{run_module.SAVE_EVERY + 6:06d}.exr"):
        with subprocess.Popen([*order, killed]) as process:
            while not (killed / sign).exists():
                assert process.poll() is None
                time.sleep(0.002)
            process.kill()
        assert not (killed / "track.json").exists()
    saved = {path: path.stat().st_mtime_ns for path in sorted((killed / "lights").iterdir())}
    subprocess.run([*order, killed], check=True, timeout=600)
    again = [path for path, written in saved.items() if path.stat().st_mtime_ns != written]
    assert all(int(path.stem) >= run_module.SAVE_EVERY for path in again)  # what was saved is not done again
    assert results(killed) == results(tmp_path / "whole")
    assert len(results(killed)) == -(-count // 3) + 3


def test_finished_run_does_nothing_again(begin, whole, tmp_path):
    shutil.copytree(whole(3).folder, tmp_path / "out")
    seen = []
    begin(tmp_path / "out", relit=True, every=3)(seen.append)
    assert seen == []


def test_kept_warnings_stay_notices(tmp_path):
    note = Notice("looks wrong", code="mask", subject="mask", remedy=give("box"), source="frame 0")
    save_progress(tmp_path, Progress(settings={}, notes=[note]))
    (kept,) = load_progress(tmp_path, {}).notes
    assert kept.as_json() == note.as_json()


def test_other_settings_are_refused(begin, whole):
    with refused("size"):
        begin(whole(3).folder, size=0.9)


# Clips


@pytest.mark.ci
def test_restart_deletes_what_a_run_left_and_nothing_else(command, work, made):
    (work / "out" / "lights").mkdir(parents=True)
    mine = work / "out" / "lights" / "vase_blender.exr"
    mine.write_bytes(b"mine")
    order = ("video", made / "clip.mp4", "-o", "out", "--mask", made / "masks", "--exr", "-q")
    assert command(*order, "--restart").status == 0
    assert command(*order, "--every", 5).status != 0  # other settings
    assert command(*order, "--every", 5, "--restart").status == 0
    kept = {path.name for path in (work / "out" / "lights").iterdir()}
    assert kept == {"vase_blender.exr", "000000.exr", "000005.exr"}
    (work / "photos" / "lights").mkdir(parents=True)  # nothing of ours was ever here
    (work / "photos" / "lights" / "000001.exr").write_bytes(b"mine")
    (work / "empty").mkdir()
    order = ("video", made / "clip.mp4", "-o", "photos", "--mask", work / "empty", "--restart", "-q")
    assert command(*order).status != 0
    assert (work / "photos" / "lights" / "000001.exr").read_bytes() == b"mine"


def test_colours_are_those_that_the_file_says(tmp_path):
    """HD players take what says nothing for BT.709, others for BT.601: it says BT.709, and is."""
    import av

    frame = np.zeros((720, 1280, 3), np.uint8)
    frame[:360], frame[360:] = (200, 40, 40), (40, 180, 60)
    write_piece(tmp_path / "piece.mp4", [(0.0, frame)])
    join_pieces(tmp_path / "clip.mp4", [tmp_path / "piece.mp4"])
    with av.open(str(tmp_path / "clip.mp4")) as container:
        found = container.streams.video[0].codec_context
        assert (found.colorspace, found.color_primaries, found.color_trc, found.color_range) == (1, 1, 1, 1)
        picture = next(container.decode(video=0)).to_ndarray(format="yuv420p").astype(float)
    y, u, v = picture[10, 10], picture[720 + 5, 5], picture[900 + 5, 5]
    red = (y - 16) / 219 + 1.5748 * (v - 128) / 224  # ITU-R BT.709
    blue = (y - 16) / 219 + 1.8556 * (u - 128) / 224
    np.testing.assert_allclose([255 * red, 255 * blue], [200, 40], atol=4)


@pytest.mark.parametrize("missing", [0, 1, 2])
def test_pieces_join_where_frames_are_missing(tmp_path, missing):
    """As phones and screen recorders leave them out."""
    rng = np.random.default_rng(3)
    times = [i / FPS for i in range(12) if i != 6 + missing]
    paths = []
    for number, piece in enumerate((times[:6], times[6:])):
        paths.append(tmp_path / f"{number}.mp4")
        write_piece(paths[-1], [(time_s, rng.integers(0, 255, (64, 64, 3), dtype=np.uint8)) for time_s in piece])
    join_pieces(tmp_path / "clip.mp4", paths)
    found = [frame.time_s for frame in read_frames(open_clip(tmp_path / "clip.mp4"), [])]
    np.testing.assert_allclose(found, times, atol=1e-3)


@pytest.mark.ci
def test_relit_clip_has_every_frame_and_the_object(whole, made):
    relit = [frame.rgb for frame in read_frames(open_clip(whole(1).folder / "relit.mp4"), [])]
    plain = [frame.rgb for frame in read_frames(open_clip(made / "clip.mp4"), [])]
    assert len(relit) == len(plain) == COUNT
    difference = np.abs(np.array(relit, float) - np.array(plain, float)).mean(axis=(0, 3))
    assert difference[:20].mean() < 3  # above the horizon, but for the codec
    assert difference[40:80, 70:110].max() > 15  # beside the sphere


@pytest.mark.parametrize(("matrix", "turns"), [((0, 1, -1, 0), -1), ((0, -1, 1, 0), 1), ((-1, 0, 0, -1), 2)])
def test_frames_are_turned_upright(made, tmp_path, matrix, turns):
    """The matrix of an MP4's track header as phones write it: 0 1 -1 0 is a quarter turn clockwise."""
    data = bytearray((made / "clip.mp4").read_bytes())
    at = data.index(b"tkhd") + 44
    a, b, c, d = (value << 16 for value in matrix)
    data[at : at + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    (tmp_path / "turned.mp4").write_bytes(data)
    plain = next(read_frames(open_clip(made / "clip.mp4"), [])).rgb
    upright = next(read_frames(open_clip(tmp_path / "turned.mp4"), [])).rgb
    np.testing.assert_array_equal(upright, np.rot90(plain, turns))
    assert clip_size(open_clip(tmp_path / "turned.mp4")) == upright.shape[1::-1]


def test_cut_file_gives_what_it_holds(made, tmp_path):
    import av

    with av.open(str(made / "clip.mp4")) as source, av.open(str(tmp_path / "clip.mkv"), "w") as out:
        stream = out.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = stream
                out.mux(packet)
    data = (tmp_path / "clip.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(data[: len(data) // 2])
    frames = list(read_frames(open_clip(tmp_path / "cut.mkv"), []))
    assert 0 < len(frames) < COUNT

"""anyprobe video given more than the clip: poses, their lens, panoramas; and going on with the same alone."""

from __future__ import annotations

import json

import numpy as np
import pytest
from PIL import Image
from support.scenes import made_map

pytest.importorskip("av", reason="the extra `video` is not installed")

from support.clips import sphere_frame, sphere_mask, write_clip, write_masks
from support.transforms import transforms

from anyprobe.core.frames import rotation_y
from anyprobe.core.response import response
from anyprobe.errors import InvalidPhoto
from anyprobe.estimate.photo import load_photo
from anyprobe.maps.radiance import read_radiance
from anyprobe.relight.insert import Arrangement
from anyprobe.render.shapes import sphere
from anyprobe.video import following
from anyprobe.video import run as run_module
from anyprobe.video.clip import clip_size, open_clip
from anyprobe.video.following import MaskFollower
from anyprobe.video.run import ClipRun, VirtualObject

# Panoramas


@pytest.mark.parametrize("first_is_lit", [True, False])
def test_a_panorama_is_of_the_first_frames_camera(tmp_path, estimator, first_is_lit):
    """What it shows ahead of that camera, one that is turned a quarter to the left has at its right."""
    clip = write_clip(tmp_path / "clip.mp4", [sphere_frame(made_map())] * 2)
    masks = write_masks(tmp_path / "masks", 2)
    if not first_is_lit:
        Image.fromarray(0 * sphere_mask()).save(masks / "0000.png")
    panorama = np.full((64, 128, 3), 60, np.uint8)
    panorama[28:36, 60:68] = 200
    follower = MaskFollower({"mask": masks}, {}, {}, panorama)
    poses = np.array([np.eye(3), rotation_y(np.pi / 2)])
    run = ClipRun(open_clip(clip), tmp_path / "out", estimator, follower, {}, exr=True, poses=poses)
    assert len(run(lambda done: None).bad) == (0 if first_is_lit else 1)
    shown = response(read_radiance(tmp_path / "out" / "lights" / "000001.exr")).mean(axis=-1)
    bright = np.flatnonzero(shown[30:34].mean(axis=0) > 0.5)
    assert (bright.min(), bright.max()) == pytest.approx((92, 99), abs=1)


# The lens


@pytest.mark.usefixtures("networks_opened_once")
def test_the_lens_of_the_poses_is_told_across_and_a_portrait_clip_is_higher(command, work):
    frame, mask = np.rot90(sphere_frame(made_map())), np.rot90(sphere_mask())  # 96 wide, 128 high
    write_clip(work / "clip.mp4", [frame] * 2)
    assert clip_size(open_clip(work / "clip.mp4")) == (96, 128)
    (work / "masks").mkdir()
    for name in ("0.png", "1.png"):
        Image.fromarray(np.ascontiguousarray(mask)).save(work / "masks" / name)
    (work / "poses.json").write_text(transforms([np.eye(3)] * 2, camera_angle_x=2 * np.arctan(0.3)))
    order = ("video", "clip.mp4", "--mask", "masks", "--poses", "poses.json", "-q")
    for folder, given, tangent in (("a", (), 0.4), ("b", ("--fov", 40, "--pitch", 25), np.tan(np.radians(20)))):
        done = command(*order, "-o", folder, *given)
        assert done.status == 0, done.err
        found = json.loads((work / folder / "track.json").read_text())["settings"]["every_frame"]
        assert np.tan(np.radians(found["fov_deg"] / 2)) == pytest.approx(tangent)
        assert found.get("pitch_deg") == (25 if given else None)


# Going on


@pytest.mark.ci
def test_the_object_stands_where_it_stood_after_an_end(tmp_path, estimator, monkeypatch):
    """Its frame's mask is found by the one before, which was found too, though that frame gave no light."""
    monkeypatch.setattr(run_module, "SAVE_EVERY", 2)
    monkeypatch.setattr(run_module, "SHADOW_DIRECTIONS", 8)
    grown = np.maximum.reduce([np.roll(sphere_mask(), n, axis) for n in (-2, 0, 2) for axis in (0, 1)])

    def found(rgb, click=None, box=None, mask=None, **given):
        return load_photo(rgb, mask=grown if click is None else sphere_mask(), **given)

    monkeypatch.setattr(MaskFollower, "_followed", lambda *asked: None)
    monkeypatch.setattr(following, "load_photo", found)
    estimate = ClipRun._estimate

    def not_of_the_first(self, photo, index):
        if index == 0:
            raise InvalidPhoto("no light")
        return estimate(self, photo, index)

    monkeypatch.setattr(ClipRun, "_estimate", not_of_the_first)
    clip = write_clip(tmp_path / "clip.mp4", [sphere_frame(made_map())] * 5)
    virtual = VirtualObject(mesh=sphere(8), material="chrome", arrangement=Arrangement(pitch_deg=15))

    def run(folder, stop_at=None):
        follower = MaskFollower({}, {}, {}, "photo")
        one = ClipRun(open_clip(clip), tmp_path / folder, estimator, follower, {}, virtual=virtual)

        def watch(done):
            if done == stop_at:
                raise KeyboardInterrupt

        assert one(watch).bad[0][0] == 0
        assert one.progress.stage_index == 1
        assert one._stage.likely == one.progress.likely < 1
        return [(tmp_path / folder / name).read_bytes() for name in ("track.json", "relit.mp4")]

    whole = run("whole")
    with pytest.raises(KeyboardInterrupt):
        run("stopped", stop_at=3)
    assert run("stopped") == whole


@pytest.mark.usefixtures("networks_opened_once")
def test_other_masks_or_another_panorama_under_the_same_name_are_refused(command, work):
    write_clip(work / "clip.mp4", [sphere_frame(made_map())] * 2)
    masks = write_masks(work / "masks", 2)
    panorama = np.full((64, 128, 3), 90, np.uint8)
    Image.fromarray(panorama).save(work / "around.png")
    order = ("video", "clip.mp4", "-o", "out", "-q")
    given = ("--mask", "masks", "--surroundings", "around.png")
    assert command(*order, *given).status == 0
    assert command(*order, *given).status == 0
    Image.fromarray(panorama + np.uint8(20)).save(work / "around.png")
    assert "--surroundings: out holds a run begun with" in command(*order, *given).complaint
    Image.fromarray(panorama).save(work / "around.png")
    Image.fromarray(np.roll(sphere_mask(), 1, axis=0)).save(masks / "0001.png")
    assert "--mask: out holds a run begun with" in command(*order, *given).complaint
    Image.fromarray(sphere_mask()).save(masks / "0001.png")
    masks.rename(work / "moved")
    assert command(*order, "--mask", "moved", *given[2:]).status == 0

"""Surroundings of several photos: gathered in the world, known to each of them, and kept in their one light."""

from __future__ import annotations

import gc
import json
import weakref
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.room_photos import FOV_DEG, room_photo, smooth_map
from support.transforms import transforms

from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.response import inverse_response, response
from anyprobe.estimate.known import GivenPanorama
from anyprobe.estimate.merged_surroundings import DIFFER, lay_over, seen_from, window
from anyprobe.estimate.multiview import fuse_lights
from anyprobe.estimate.photo import Photo, crop_object, load_photo
from anyprobe.estimate.surroundings import radiance_of, surroundings_of
from anyprobe.light.environment import rotate

POSES = [rotation_x(0.1), rotation_y(1.6) @ rotation_x(0.1), rotation_y(-1.5), rotation_y(0.4)]


def take(pose: np.ndarray, light: float = 1.0, surroundings: str | None = "photo") -> Photo:
    """A photo of the disc in the room, by a camera that is turned so; its exposure is so many times the rest."""
    photo, mask = room_photo(smooth_map() * light, world_from_camera=pose)
    photo[mask > 0] = 110  # grey, so that the networks are sure of something
    return load_photo(photo, mask=mask, fov_deg=FOV_DEG, surroundings=surroundings)


def patch(value: float, columns: slice) -> np.ndarray:
    """A panorama of one radiance between some columns."""
    shown = np.zeros((64, 128, 4), np.float32)
    shown[:, columns] = [value, value, value, 1.0]
    return shown


# Panoramas


def test_a_window_is_the_world_that_the_photo_shows():
    crop = crop_object(take(POSES[1]))
    shown = window(crop.surroundings_map, POSES[1] @ crop.camera_from_crop)
    sure = shown[..., 3] > 0.99
    assert sure.mean() > 0.025
    np.testing.assert_allclose(shown[sure][:, :3], smooth_map()[sure], atol=0.02)
    twice = window(crop.surroundings_map, POSES[1] @ crop.camera_from_crop, gain=2.0)
    np.testing.assert_allclose(twice[sure][:, :3], 2 * shown[sure][:, :3], rtol=1e-5)


def test_what_is_clipped_out_tells_nothing_of_a_darker_exposure():
    white = np.ones((64, 128, 4), np.float32)
    assert window(white, np.eye(3), gain=0.5)[..., 3].max() == 0
    np.testing.assert_allclose(window(white, np.eye(3), gain=2.0)[..., :3], 2.0)


def test_what_is_clipped_out_tells_nothing_to_a_darker_photo():
    """At least white in the panorama is not exactly half as bright there."""
    room = np.concatenate([smooth_map(), np.ones((64, 128, 1), np.float32)], axis=-1)
    room[20:24, 60:66, :3] = 1.0
    known = seen_from(room, np.eye(3), None, gain=2.0)
    assert known[21:23, 61:65, 3].max() == 0
    np.testing.assert_allclose(known[30:, :, 3], 1.0, atol=1e-5)
    assert seen_from(room, np.eye(3), None)[21, 62, 3] == pytest.approx(1.0)


@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_what_is_measured_above_white_comes_through_a_panorama(gain):
    """A panorama of radiance, in the first photo's exposure, is known to the others, whatever theirs is."""
    radiance = smooth_map()
    radiance[20:24, 60:66] = [40.0, 30.0, 20.0]
    cover = np.ones((64, 128, 1), np.float32)
    first = surroundings_of(radiance, cover, cover)
    photo = np.zeros((64, 128, 4), np.float32)
    photo[:, :20] = [0.5, 0.4, 0.3, 1.0]
    turn = rotation_y(0.5)
    merged_surroundings = lay_over(window(first, np.eye(3)), patch(0.3, slice(0, 128)))
    shown, clipped, known = radiance_of(seen_from(merged_surroundings, turn, photo, gain))
    truth = rotate(radiance, turn.T) / gain
    np.testing.assert_allclose(shown[:, 20:], truth[:, 20:], rtol=2e-3, atol=2e-3)
    np.testing.assert_allclose(response(shown[:, :20]), np.broadcast_to([0.5, 0.4, 0.3], (64, 20, 3)), atol=1e-3)
    np.testing.assert_allclose(known, 1.0, atol=1e-5)
    assert not clipped.any()
    back = window(surroundings_of(truth.clip(0), cover, cover), np.eye(3), gain=0.5)
    np.testing.assert_allclose(back[..., :3], truth / 2, rtol=2e-3, atol=2e-3)  # nothing of it is clipped


def test_the_newer_counts_where_it_shows_something():
    newer = patch(0.3, slice(0, 60))
    newer[:10, 55:, :3] *= 1.2
    found = lay_over(newer, patch(0.33, slice(50, 100)))
    np.testing.assert_allclose(found[:, :60], newer[:, :60])
    np.testing.assert_array_equal(found[..., 3], patch(1, slice(0, 100))[..., 3])
    # both show columns 50 to 60, where the newer has 1 / 1.1 of the light: the older's exposure was longer
    np.testing.assert_allclose(found[:, 60:100, :3], 0.3, rtol=1e-6)
    apart = lay_over(patch(0.3, slice(0, 50)), patch(0.33, slice(50, 100)))
    np.testing.assert_allclose(apart[:, 50:100, :3], 0.33)


def test_the_older_is_forgotten_where_the_same_place_looks_otherwise():
    """Another exposure does not make it so, another pattern does."""
    older = patch(0.4, slice(0, 100))
    newer = patch(0.4, slice(0, 40))
    newer[:, :20, :3] *= 0.1  # its left half went dark
    assert np.abs(response(newer) - response(older))[:, :40, :3].mean() > DIFFER
    np.testing.assert_array_equal(lay_over(newer, older), newer)
    darker = patch(0.1, slice(0, 40))
    np.testing.assert_allclose(lay_over(darker, older)[:, 40:100, :3], 0.1, rtol=1e-6)


def test_a_photo_sees_the_panorama_in_its_own_frame():
    turn = rotation_y(0.5) @ rotation_x(0.2)
    whole = np.concatenate([smooth_map(), np.ones((64, 128, 1), np.float32)], axis=-1)
    known = seen_from(whole, turn, own=None)
    truth = rotate(smooth_map(), turn.T)
    np.testing.assert_allclose(inverse_response(known[..., :3]), truth, atol=0.01)
    np.testing.assert_allclose(seen_from(whole, turn, None, gain=2.0)[..., :3], response(truth / 2), atol=0.01)
    own = np.zeros_like(whole)
    own[:, :50] = [0.9, 0.8, 0.7, 1.0]
    mixed = seen_from(whole, turn, own)
    np.testing.assert_array_equal(mixed[:, :50], own[:, :50])
    np.testing.assert_array_equal(mixed[:, 50:], known[:, 50:])


# Lights


def shown_by(poses, first: np.ndarray) -> np.ndarray:
    """[64, 128]: what cameras turned so show beside the disc, in the first one's frame."""
    covers = []
    for pose in poses:
        crop = crop_object(take(pose))
        covers.append(window(crop.surroundings_map, first.T @ pose @ crop.camera_from_crop)[..., 3])
    return np.max(covers, axis=0) > 0.99


@pytest.mark.ci
def test_what_one_photo_shows_all_know(estimator):
    light = estimator.multiview([take(pose) for pose in POSES], POSES)
    truth = rotate(smooth_map(), POSES[0].T)
    seen = shown_by(POSES, POSES[0])
    assert seen.mean() > 3 * shown_by(POSES[:1], POSES[0]).mean() > 0.05
    wrong = np.abs(response(light.radiance) - response(truth))
    assert wrong[seen].mean() < 0.01
    assert light.confidence[seen].min() > 0.7
    assert light.info["hints"]["surroundings"] > 0.1
    # each with its own window alone: what one shows is lost among the guesses of the others
    apart = fuse_lights([estimator.from_photo(take(pose)) for pose in POSES], POSES)
    assert np.abs(response(apart.radiance) - response(truth))[seen].mean() > 3 * wrong[seen].mean()
    assert wrong[~seen].mean() > 0.03  # nobody knows there


@pytest.mark.parametrize("first", [0, 1])
def test_the_panorama_of_several_photos_shows_the_first(estimator, first):
    poses = [POSES[first], POSES[1 - first]]
    picture = estimator.multiview([take(pose) for pose in poses], poses).panorama(64, frame="camera")
    seen = picture.origin[..., 0] > 0.9
    assert seen.mean() > 0.02
    truth = rotate(smooth_map(), poses[0].T)
    assert np.abs(response(picture.radiance) - response(truth))[seen].mean() < 0.02


def test_photos_without_surroundings_are_fused_as_ever(estimator):
    photos = [take(pose, surroundings="none") for pose in POSES[:2]]
    together = estimator.multiview(photos, POSES[:2])
    apart = fuse_lights([estimator.from_photo(photo) for photo in photos], POSES[:2])
    np.testing.assert_array_equal(together.radiance, apart.radiance)
    assert "surroundings" not in together.info["hints"]


@pytest.mark.ci
def test_photos_are_let_go_when_their_object_is_cut_out(estimator):
    """Several are opened in turn; no two need be in memory."""
    alive = []

    def opened():
        for pose in POSES:
            gc.collect()
            assert all(pixels() is None for pixels in alive[:-1])
            photo = take(pose)
            alive.append(weakref.ref(photo.rgb))
            yield photo

    estimator.multiview(opened(), POSES)
    assert len(alive) == len(POSES)


def test_exposures_that_photos_tell_are_made_one_there_too(estimator):
    exposures = (1.0, 0.5)
    photos = [replace(take(pose, light), exposure=light) for pose, light in zip(POSES, exposures, strict=False)]
    light = estimator.multiview(photos, POSES[:2])
    truth, seen = rotate(smooth_map(), POSES[0].T), shown_by(POSES[1:2], POSES[0])
    np.testing.assert_allclose(np.median(light.radiance[seen] / truth[seen]), 1.0, atol=0.02)


def test_a_panorama_from_a_file_is_of_the_first_camera(estimator):
    first = rotate(smooth_map(), POSES[0].T)
    panorama = np.concatenate([response(first), np.ones((64, 128, 1), np.float32)], axis=-1)
    photos = [replace(take(pose), surroundings=GivenPanorama(small=panorama)) for pose in POSES[:3]]
    light = estimator.multiview(photos, POSES[:3])
    assert np.abs(response(light.radiance) - response(first)).mean() < 0.01


def test_the_command_gathers_what_photos_show(command, tmp_path):
    names = []
    for k, pose in enumerate(POSES):
        photo, mask = room_photo(smooth_map(), world_from_camera=pose)
        Image.fromarray(np.dstack([photo, mask])).save(tmp_path / f"{k}.png")
        names.append(tmp_path / f"{k}.png")
    (tmp_path / "poses.json").write_text(transforms(POSES))
    order = ("estimate", *names, "--poses", tmp_path / "poses.json", "--surroundings", "photo", "--fov", FOV_DEG)
    done = command(*order, "-o", tmp_path / "light", "--json", "-q")
    assert done.status == 0, done.err
    assert json.loads(done.out)["hints"]["surroundings"] > 0.1


@pytest.mark.ci
@pytest.mark.parametrize("given", ["photo", "panorama"])
def test_a_clip_gathers_what_its_frames_have_shown(given, tmp_path, estimator):
    """In the last frame's light is what only the first ones showed; the same after an end in between."""
    pytest.importorskip("av", reason="the extra `video` is not installed")
    from support.clips import write_clip

    from anyprobe.maps.radiance import read_radiance
    from anyprobe.video import run as run_module
    from anyprobe.video.clip import open_clip
    from anyprobe.video.following import MaskFollower
    from anyprobe.video.run import ClipRun

    poses = np.array([rotation_y(0.25 * k) for k in range(6)])
    taken = [room_photo(smooth_map(), world_from_camera=pose) for pose in poses]
    write_clip(tmp_path / "clip.mp4", [photo for photo, _ in taken], 24)
    (tmp_path / "masks").mkdir()
    for k, (_, mask) in enumerate(taken):
        Image.fromarray(mask).save(tmp_path / "masks" / f"{k}.png")
    panorama = np.dstack([np.uint8(255 * response(smooth_map())), np.full((64, 128), 255, np.uint8)])
    surroundings_map = "photo" if given == "photo" else panorama

    def run(folder, stop_at=None):
        follower = MaskFollower({"mask": tmp_path / "masks"}, {}, {"fov_deg": FOV_DEG}, surroundings_map)
        clip = ClipRun(open_clip(tmp_path / "clip.mp4"), folder, estimator, follower, {}, exr=True, poses=poses)

        def watch(done):
            if done == stop_at:
                raise KeyboardInterrupt

        clip(watch)
        return folder / "lights" / "000005.exr"

    monkeypatch = pytest.MonkeyPatch()
    with monkeypatch.context() as patched:
        patched.setattr(run_module, "SAVE_EVERY", 2)
        last = run(tmp_path / "a")
        with pytest.raises(KeyboardInterrupt):
            run(tmp_path / "b", stop_at=5)
        assert run(tmp_path / "b").read_bytes() == last.read_bytes()
    truth = rotate(smooth_map(), poses[-1].T)
    seen = shown_by(poses[:2], poses[-1]) if given == "photo" else np.ones((64, 128), bool)
    assert np.abs(response(read_radiance(last)) - response(truth))[seen].mean() < 0.03

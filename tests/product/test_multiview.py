"""Several photos of one place: maps fused, poses read, and one light of all from the command line."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from support.refused import refused
from support.scenes import made_map
from support.transforms import transforms

import anyprobe
from anyprobe.core.frames import rotation_x, rotation_y
from anyprobe.core.latlong import pixel_directions
from anyprobe.estimate.multiview import NOT_GIVEN, OFFSET, fuse, fuse_lights
from anyprobe.estimate.poses import read_poses
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin
from anyprobe.light.environment import integral, rotate
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import read_radiance
from anyprobe.pictures.images import read_image

D = pixel_directions(64)
ONE = np.ones((2, 64, 128), np.float32)


def flat(value: float) -> np.ndarray:
    return np.full((64, 128, 3), value, np.float32)


def emitter(direction, width: float, radiance: float) -> np.ndarray:
    """A cap of light over 0.2 all around, [64, 128, 3]."""
    there = D @ np.asarray(direction) > np.cos(width)
    return np.where(there[..., None], radiance, 0.2).astype(np.float32) * np.ones(3, np.float32)


# Maps


def test_fused_with_itself_a_map_stays():
    light = made_map()
    found = fuse(np.stack([light] * 2), np.ones((2, *light.shape[:2])))
    np.testing.assert_allclose(found, light, rtol=1e-4, atol=1e-5)


def test_maps_meet_at_their_weighted_geometric_mean():
    expected = (0.1 + OFFSET) ** 0.75 * (0.5 + OFFSET) ** 0.25 - OFFSET
    found = fuse(np.stack([flat(0.1), flat(0.5)]), np.stack([3 * ONE[0], ONE[0]]))
    # as much light as their geometric mean has in all would be more; nothing there is bright enough to take it
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_emitters_side_by_side_keep_their_light_and_one_alone_is_doubted():
    """Two guesses of one emitter that overlap by half: it is where both say, and no weaker in all."""
    left, right = (emitter((np.sin(a), 0, -np.cos(a)), 0.35, 60.0) for a in (-0.15, 0.15))
    found = fuse(np.stack([left, right]), ONE)
    np.testing.assert_allclose(integral(found), integral(left), rtol=0.02)
    both = (left[..., 0] > 1) & (right[..., 0] > 1)
    one = (left[..., 0] > 1) ^ (right[..., 0] > 1)
    assert found[both].min() > 59.0
    assert found[one].max() < 0.2 * found[both].min()


def test_small_light_sources_side_by_side_become_one_of_the_same_power():
    """Five photos place a lamp within 15 degrees, and no two at the same pixels; one sees another on the other side."""
    ways = [(np.sin(a), 0.3, -np.cos(a)) for a in np.linspace(-0.26, 0.26, 5)]
    ways = [np.array(way) / np.linalg.norm(way) for way in ways]
    maps = np.stack([emitter(way, 0.06, 300.0) for way in ways])
    maps[0] += emitter((0.0, 0.0, 1.0), 0.06, 300.0)
    found = fuse(maps.astype(np.float32), np.ones(maps.shape[:3], np.float32))
    np.testing.assert_allclose(integral(found), integral(maps.mean(axis=0)), rtol=0.02)
    light, each = find_dominant_light(found), [find_dominant_light(one) for one in maps[1:]]
    assert light.direction @ ways[2] > np.cos(np.radians(3))
    assert light.irradiance.mean() > 0.8 * np.mean([one.irradiance.mean() for one in each])


# Lights


def seen_from(world: np.ndarray, pose: np.ndarray, **info) -> Light:
    """What a camera turned so would say if it knew the half behind it, and nothing of the other."""
    known = D[..., 2] > 0
    radiance = np.maximum(rotate(world, pose.T), 0.0)
    radiance = np.where(known[..., None], radiance, 0.02).astype(np.float32)
    return Light(radiance=radiance, confidence=np.where(known, 1.0, 0.02).astype(np.float32), origin=Origin(**info))


def test_each_photo_tells_of_the_side_that_its_object_faces():
    slopes = np.array([[1.0, 0.2, 0.0], [0.0, 0.3, 1.0], [0.5, 1.0, 0.2]])
    world = (0.25 * np.exp(0.5 * D @ slopes)).astype(np.float32)
    poses = [rotation_x(0.2) @ rotation_y(0.4), rotation_x(0.2) @ rotation_y(0.4 + np.pi)]
    lights = [seen_from(world, pose, photo=name) for pose, name in zip(poses, "ab", strict=True)]
    fused = fuse_lights(lights, poses)
    truth = rotate(world, poses[0].T)
    off_seam = np.abs(D[..., 2]) > 0.1
    np.testing.assert_allclose(fused.radiance[off_seam], truth[off_seam], rtol=0.03)
    assert np.abs(lights[0].radiance - truth)[off_seam].max() > 0.2
    assert fused.confidence[off_seam].min() > 0.95
    assert fused.info["fused"] == ["a", "b"]
    shown = [replace(light, find_shown=lambda: "the first's") for light in lights]
    assert fuse_lights(shown, poses).shown is None, "matched by its map, not by one photo's pixels"
    assert fuse_lights(shown[:1], poses[:1]).shown == "the first's"
    swapped = fuse_lights(lights[::-1], poses[::-1])  # in the other's frame
    np.testing.assert_allclose(rotate(swapped.radiance, poses[0].T @ poses[1])[off_seam], truth[off_seam], rtol=0.05)


def test_exposures_that_photos_tell_are_made_one():
    poses = [np.eye(3), rotation_y(0.0)]
    dark, bright = (Light(radiance=flat(0.2 * e), origin=Origin(exposure=e)) for e in (1.0, 4.0))
    np.testing.assert_allclose(fuse_lights([dark, bright], poses).radiance, 0.2, rtol=1e-4)
    np.testing.assert_allclose(fuse_lights([bright, dark], poses).radiance, 0.8, rtol=1e-4)
    untold = Light(radiance=flat(0.8))
    mixed = fuse_lights([dark, untold], poses)
    np.testing.assert_allclose(mixed.radiance, np.sqrt(0.21 * 0.81) - OFFSET, rtol=1e-4)
    assert mixed.warnings == (NOT_GIVEN,)


def test_lights_without_poses_are_refused():
    for lights, poses in (([], []), ([Light(radiance=flat(1.0))], [])):
        with refused("poses"):
            fuse_lights(lights, poses)
    with refused("poses"):
        fuse_lights([Light(radiance=flat(1.0))] * 2, [np.eye(3), 2 * np.eye(3)])
    mirrored = np.diag([1.0, 1.0, -1.0])  # two of them make a rotation, and yet are none
    with refused("poses"):
        fuse_lights([Light(radiance=flat(1.0))] * 2, [mirrored, mirrored])
    assert anyprobe.fuse_lights is fuse_lights


def test_exif_tells_the_exposure(tmp_path):
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x829A: 1 / 50, 0x829D: 2.0, 0x8827: 200})  # s, f-number, ISO
    Image.new("RGB", (60, 40), "grey").save(tmp_path / "a.jpg", exif=exif)
    assert read_image(tmp_path / "a.jpg").exposure == pytest.approx(200 / 50 / 4)
    for broken in ({0x829D: 0.0}, {0x8827: 0}):
        exif.get_ifd(0x8769).update(broken)
        Image.new("RGB", (60, 40), "grey").save(tmp_path / "b.jpg", exif=exif)
        assert read_image(tmp_path / "b.jpg").exposure is None


# Poses


def test_poses_are_found_by_name(tmp_path):
    turn = rotation_y(0.5)
    four = np.eye(4)
    four[:3, :3], four[:3, 3] = turn, (1, 2, 3)
    frames = [
        {"file_path": "./images/v_10.png", "transform_matrix": four.tolist()},
        {"file_path": "./images/v_2", "transform_matrix": np.eye(4).tolist()},
    ]
    (tmp_path / "named.json").write_text(json.dumps({"camera_angle_x": 0.7, "frames": frames}))
    named = read_poses(tmp_path / "named.json")
    np.testing.assert_allclose(named.of([tmp_path / "v_2.png", tmp_path / "v_10.png"]), [np.eye(3), turn])
    np.testing.assert_allclose(named.in_order(), [np.eye(3), turn])
    with refused(source="named.json", naming="z.png"):
        named.of([tmp_path / "z.png"])
    with refused(source="named.json", naming="two photos v_2.png"):
        named.of([tmp_path / "left" / "v_2.png", tmp_path / "right" / "v_2.png"])
    frames[1]["file_path"] = "right/v_10.png"
    (tmp_path / "twice.json").write_text(json.dumps({"frames": frames}))
    with refused(source="twice.json", naming="two poses of v_10.png"):
        read_poses(tmp_path / "twice.json").of([tmp_path / "v_10.png"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("not json", "transforms.json of camera poses"),
        ("{}", '"frames"'),
        ("[]", '"frames"'),
        ('{"frames": [1]}', '"frames"'),
        ('{"frames": [{"transform_matrix": []}]}', '"file_path"'),
        ('{"frames": [{"file_path": "a"}]}', "a: expected"),
        (transforms([2 * np.eye(3)]), "0.png: expected a rotation"),
        (transforms([np.diag([1, 1, -1])]), "mirrored"),
        (transforms([np.eye(3)]).replace("1.0", str(10**400)), "0.png: expected"),
        (transforms([np.diag([np.nan, 1, 1])]), "expected a rotation"),
    ],
)
def test_file_that_holds_no_poses_is_one_line(tmp_path, content, words):
    (tmp_path / "poses.json").write_text(content)
    with refused(source="poses.json", naming=words):
        read_poses(tmp_path / "poses.json")


def poses_file(path, frames, **common):
    listed = [{"file_path": f"{k}.png", "transform_matrix": np.eye(4).tolist(), **one} for k, one in enumerate(frames)]
    path.write_text(json.dumps({"frames": listed, **common}))
    return read_poses(path)


def test_poses_tell_the_lens_where_the_photo_does_not(tmp_path):
    """Across and down; an entry's own before the object's for all; a photo that is upright takes in more downwards."""
    for name, size in (("wide.png", (60, 40)), ("high.png", (40, 60))):
        Image.new("RGB", size, "grey").save(tmp_path / name)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 36  # mm, as of 35 mm film
    exif[0x0112] = 6  # on its side
    Image.new("RGB", (60, 40), "grey").save(tmp_path / "told.jpg", exif=exif)
    names = ["wide.png", "high.png", "told.jpg"]
    photos = [tmp_path / name for name in names]
    known = poses_file(
        tmp_path / "a.json",
        [{"file_path": names[0]}, {"file_path": names[1]}, {"file_path": names[2]}],
        camera_angle_x=np.radians(50.0),
    )
    tall = 2 * np.degrees(np.arctan(np.tan(np.radians(25.0)) * 1.5))
    assert known.fovs_deg(photos, photos) == pytest.approx([50.0, tall, None])
    data = [photo.read_bytes() for photo in photos]
    assert known.fovs_deg([Path(name) for name in names], data) == pytest.approx([50.0, tall, None])
    assert known.clip_fov_deg(60, 40) == pytest.approx(50.0)
    assert known.clip_fov_deg(40, 60) == pytest.approx(tall)
    high = poses_file(tmp_path / "d.json", [{}], fl_x=50.0, w=60, h=100)
    assert high.clip_fov_deg(60, 100) == pytest.approx(90.0)
    assert poses_file(tmp_path / "e.json", [{}]).clip_fov_deg(60, 40) is None
    own = poses_file(
        tmp_path / "b.json",
        [{"file_path": "wide"}, {"file_path": "high", "fl_x": 100.0, "fl_y": 110.0}],
        fl_x=50.0,
        w=100,
        h=150,
        camera_angle_x=1.0,
    )
    assert own.fovs_deg(photos[:2], photos[:2]) == pytest.approx([90.0, 2 * np.degrees(np.arctan(75 / 110))])
    assert poses_file(tmp_path / "c.json", [{"file_path": "wide"}]).fovs_deg(photos[:1], photos[:1]) == [None]


# The command


def test_photos_with_poses_give_one_light(command, work, photo_path):
    other = work / "other.png"
    other.write_bytes(photo_path.read_bytes())
    poses = [np.eye(3), rotation_y(2.0)]
    (work / "poses.json").write_text(transforms(poses, (photo_path.name, "other.png")))
    done = command("estimate", photo_path, other, "--poses", work / "poses.json", "-o", "one", "--json", "-q")
    assert done.status == 0, done.err
    given = json.loads(done.out)
    assert given["fused"] == [photo_path.name, "other.png"]
    assert {path.name for path in (work / "one").iterdir()} == {
        f"{photo_path.stem}{kind}" for kind in (".exr", ".hdr", ".json", ".png", "_panorama.exr", "_origin.png")
    }
    lights = [anyprobe.estimate(photo_path), anyprobe.estimate(other)]
    expected = fuse_lights(lights, poses).radiance
    found = read_radiance(work / "one" / f"{photo_path.stem}.exr")
    np.testing.assert_allclose(found, expected, rtol=2e-3, atol=1e-4)
    assert np.abs(np.log((expected + 0.01) / (lights[0].radiance + 0.01))).mean() > 0.1


@pytest.mark.ci
def test_the_lens_of_the_poses_counts_unless_another_is_told(command, work, photo_path):
    said = transforms([np.eye(3)], [photo_path.name], fl_x=100, w=120, camera_angle_x=9e-1)
    (work / "poses.json").write_text(said)
    call = ("estimate", photo_path, "--poses", work / "poses.json", "-o", "one", "--json", "-q")
    given = json.loads(command(*call).out)
    assert given["long_fov_deg"] == pytest.approx(2 * np.degrees(np.arctan(0.6)), abs=1e-3)
    assert json.loads(command(*call, "--fov", "40").out)["long_fov_deg"] == 40

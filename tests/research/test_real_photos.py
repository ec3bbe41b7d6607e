"""Real photos with measured maps or known lamps: the folder's rules, and both turned to what the networks see."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.scenes import sphere_photo

from anyprobe.cli.app import main
from anyprobe.core.response import response
from anyprobe.estimate.surroundings import PhotoBackground
from anyprobe.light.light_sources import find_dominant_light
from anyprobe.maps.radiance import write_hdr
from anyprobe_train.evaluate.methods import Estimate
from research.real_photos.__main__ import app
from research.real_photos.lamps import ALL, ALONE, CONSTANT, DEFAULT, lamp_angles, load_lamps
from research.real_photos.maps import COLUMNS, load_real, read_real, score_real

GOOD = {"photo": "a.png", "mask": "m.png", "map": "a.hdr", "fov_deg": "60", "gain": "2", "kind": "specular"}
LAMP = {"photo": "sphere.png", "mask": "sphere_mask.png", "lamp": "0 0 1", "kind": "diffuse"}


@pytest.fixture
def folder(tmp_path):
    """A grey square at the right border of a photo, under a lamp straight ahead of the camera."""
    photo = np.zeros((120, 240, 3), np.uint8)
    photo[40:80, 180:220] = 128
    Image.fromarray(photo).save(tmp_path / "a.png")
    Image.fromarray((photo[..., 0] > 0).astype(np.uint8) * 255).save(tmp_path / "m.png")
    radiance = np.full((64, 128, 3), 0.125, np.float32)
    radiance[31:33, 63:65] = 8.0
    write_hdr(tmp_path / "a.hdr", radiance)
    sphere = sphere_photo(center=(96, 30), diameter=32)  # of 128 x 96: right of the middle and above it
    Image.fromarray(sphere[..., :3]).save(tmp_path / "sphere.png")
    Image.fromarray(sphere[..., 3]).save(tmp_path / "sphere_mask.png")
    return tmp_path


def behind_the_camera(photo):
    """A method whose map has one lamp, straight behind the crop's camera: at (0, 0, 1), on its seam."""
    radiance = np.full((64, 128, 3), 0.125, np.float32)
    radiance[31:33, [0, -1]] = 8.0
    return Estimate(ldr=response(radiance), radiance=radiance)


def away_from_the_sphere(fov_deg):
    """Unit direction from sphere.png's sphere to its camera: (0, 0, 1) of the crop, in the camera's frame."""
    focal = 64 / np.tan(np.radians(fov_deg / 2))
    towards = np.array([-(96 - 64) / focal, (30 - 48) / focal, 1.0])
    return towards / np.linalg.norm(towards)


def write(folder, *rows):
    with (folder / "manifest.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def test_map_comes_in_the_crop_s_frame_and_the_photo_s_exposure(folder):
    write(folder, GOOD)
    (pair,) = load_real(folder, read_real(folder))
    assert pair.crop.shape == (128, 128, 4)
    assert np.median(pair.radiance) == pytest.approx(0.25, rel=0.01)  # gain 2
    direction = find_dominant_light(pair.radiance).direction
    # the object stands 80 px right of the middle, 120 px are tan 30: the lamp is that far left of it
    expected = np.degrees(np.arctan(80 / 120 * np.tan(np.radians(30))))
    assert np.degrees(np.arctan2(direction[0], -direction[2])) == pytest.approx(-expected, abs=1.5)


def test_groups_are_scored_apart(folder):
    write(folder, GOOD, GOOD | {"kind": "diffuse", "gain": "1"})
    truth = {}

    def perfect(pair):
        truth[pair.kind] = response(pair.radiance)
        return Estimate(ldr=truth[pair.kind], radiance=pair.radiance)

    def black(pair):
        return Estimate(ldr=np.zeros((64, 128, 3), np.float32))

    groups = score_real(load_real(folder, read_real(folder)), {"perfect": perfect, "black": black})
    assert set(groups) == {"specular", "diffuse"}
    for kind, one in groups.items():
        rows = {row["method"]: row for row in one["rows"]}
        assert one["pairs"] == 1
        assert rows["perfect"]["sphere_ssim"] == pytest.approx(1.0)
        assert rows["perfect"]["dominant_light_deg"] == 0.0
        expected = np.sqrt(np.square(truth[kind]).mean())
        assert rows["black"]["ldr_rmse"] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("fov_deg", ["", "90"])  # 60 where neither the row nor the photo says
def test_a_lamp_s_angle_is_that_to_an_object_beside_the_middle(folder, fov_deg):
    x, y, z = away_from_the_sphere(float(fov_deg or 60))
    off = np.degrees(np.arccos(z))
    assert off > 15
    for lamp, expected in (
        ("0 0 1", off),
        (f"{x} {y} {z}", 0.0),
        (f"{-30 * x} {-30 * y} {30 * z}", 2 * off),  # of any length
        (f"{-x} {-y} {-z}", 180.0),
    ):
        write(folder, LAMP | {"lamp": lamp, "fov_deg": fov_deg})
        (photo,) = load_lamps(folder, read_real(folder))
        angles = lamp_angles(photo, {"behind": behind_the_camera})
        assert set(angles) == {CONSTANT, "behind"}
        for one in angles.values():
            assert one.deg == pytest.approx(expected, abs=0.02)
            assert one.said_deg is None


class FixedLight:
    """An estimator that says one direction of every photo, in its camera's frame, and keeps which it saw."""

    def __init__(self, direction):
        radiance = np.ones((64, 128, 3), np.float32)
        self.light, self.seen = replace(find_dominant_light(radiance), direction=direction, error_deg=12.0), []

    def from_photo(self, photo):
        self.seen.append(photo.surroundings is not None)
        return self

    def dominant_light(self):
        return self.light


def test_estimators_answer_in_the_camera_s_frame_for_the_object_alone_and_the_whole_photo(folder):
    direction = away_from_the_sphere(60.0)
    write(folder, LAMP | {"lamp": " ".join(map(str, direction))})
    (photo,) = load_lamps(folder, read_real(folder))
    estimator = FixedLight(direction)
    shown = replace(photo.photo, surroundings=PhotoBackground())
    angles = lamp_angles(replace(photo, photo=shown), {}, {"": estimator})
    assert list(angles) == [CONSTANT, ALONE, DEFAULT]
    for way in (ALONE, DEFAULT):
        assert angles[way].deg == pytest.approx(0, abs=1e-3)
        assert angles[way].said_deg == 12.0
    assert estimator.seen == [False, True]


@pytest.mark.ci
@pytest.mark.parametrize("words", [[], ["score"]])
def test_a_mixed_folder_gives_both_kinds(folder, command, words):
    write(folder, GOOD, LAMP)
    out = folder / "out.json"
    ended = command(*words, folder, "--model", "paper", "-o", out, main=lambda: main(app))
    assert ended.status == 0, ended.err
    content = json.loads(out.read_text())
    assert set(content["maps"]) == {"specular"}
    assert content["maps"]["specular"]["pairs"] == content["lamps"][ALL]["photos"] == 1
    (name,) = content["photos"]
    assert name == f"{folder.name}/sphere.png"
    angles = content["photos"][name]
    assert list(angles) == [CONSTANT, "chrome sphere", ALONE, DEFAULT]
    for method, row in content["lamps"]["sphere"]["rows"].items():
        assert row["mean_deg"] == row["median_deg"] == pytest.approx(angles[method]["deg"], abs=0.006)


def test_a_table_of_light_directions_alone_is_read(folder):
    (folder / "lights.csv").write_text(
        "file,mask,object,material,x,y,z\nsphere.png,sphere_mask.png,sphere,matte,0,0.6,0.8\n"
    )
    (row,) = read_real(folder)
    assert (row["photo"], row["mask"], row["lamp"]) == ("sphere.png", "sphere_mask.png", "0 0.6 0.8")
    (photo,) = load_lamps(folder, [row])
    assert photo.object == "sphere"
    (photo,) = load_lamps(folder, [row | {"object": ""}])
    assert photo.object == "sphere", "by its mask"

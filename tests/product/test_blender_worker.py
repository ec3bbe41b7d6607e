"""The Blender extension's worker, which needs no Blender: what it asks of this library is there."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import anyprobe
from anyprobe.core.frames import is_rotation
from anyprobe.estimate.ground import up_of
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import read_radiance

ROOT = Path(__file__).parents[2]
WORKER = ROOT / "integrations" / "blender" / "light_from_photo" / "worker.py"
NOTHING = dict.fromkeys(
    ("mask", "click", "exclude", "box", "material", "albedo", "roughness", "normals", "fov_deg", "pitch_deg", "turn")
)


def loaded(path: Path):
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def answer(folder, *, apart: bool = False, **order):
    """What the worker writes; apart: run in a process of its own, without this one's paths."""
    photo = {"file": str(ROOT / "examples" / "table.png")}
    whole = {"photo": photo, "name": "table", "background": False, "detail": False, "library": None, "heading_deg": 0}
    (folder / "order.json").write_text(json.dumps({**NOTHING, **whole, "python_path": sys.path, **order}))
    if apart:
        subprocess.run([sys.executable, "-I", str(WORKER), str(folder)], check=True, timeout=300)
    else:
        loaded(WORKER).main(folder)
    return json.loads((folder / "answer.json").read_text())


@pytest.mark.ci
def test_estimate_is_another_than_pythons(tmp_path):
    found = answer(tmp_path, apart=True, do="estimate", fov_deg=50, pitch_deg=15, material="plastic", heading_deg=30)
    light = anyprobe.estimate(ROOT / "examples" / "table.png", fov_deg=50, pitch_deg=15, material="plastic")
    turn = np.array(found["turn"])
    assert is_rotation(turn)
    forward = turn @ [0, 0, -1]
    np.testing.assert_allclose(np.degrees([np.arctan2(-forward[0], forward[1]), np.arcsin(-forward[2])]), [30, 15])
    for source, wanted in zip(found["sources"], light.sources(), strict=True):
        assert turn @ wanted.direction @ source["towards"] > 0.9999
        np.testing.assert_allclose(source["irradiance"], wanted.irradiance, rtol=1e-4)
        assert source["angle_deg"] == pytest.approx(2 * wanted.radius_deg, abs=0.01)
    said = json.loads((tmp_path / "light_blender.json").read_text())
    assert said["dominant_light"]["error_deg"] == round(found["error_deg"], 1)
    assert found["error_deg"] == pytest.approx(light.dominant_light().error_deg, abs=0.1)
    assert said["origin"]["photo"] == "table"
    assert said["origin"]["level"] == found["level"]
    assert (
        found["level"]
        == "+Y is up: turned by the camera's pitch of 15.0 and roll of 0.0 degrees, given, give or take 1"
    )
    full, rest = (read_radiance(tmp_path / found[name]) for name in ("full", "rest"))
    assert full.max() > rest.max()
    assert found["foot"][2] == pytest.approx(-1)  # the camera's height over the ground is 1
    assert found["long_fov_deg"] == pytest.approx(50)
    assert 0.1 < found["object_size"] < 10
    chrome, matte = (np.asarray(Image.open(tmp_path / found[name])) / 255 for name in ("chrome", "matte"))
    assert chrome.shape == matte.shape == (128, 128, 4)
    assert not chrome[0, 0].any()
    ball = matte[..., 3] == 1
    assert ball.mean() == pytest.approx(np.pi / 4, abs=0.01)
    y, x = np.mgrid[1:-1:128j, -1:1:128j]
    brightness = matte[..., :3].mean(axis=-1)
    brighter = [np.corrcoef(axis[ball], brightness[ball])[0, 1] for axis in (x, y)]
    main = light.dominant_light().direction
    assert np.dot(brighter, main[:2]) > 0.5 * np.linalg.norm(main[:2])  # bright where the light comes from
    assert chrome[ball].std() > matte[ball].std()


@pytest.mark.ci
def test_the_panorama_of_the_place_has_the_estimates_light(tmp_path):
    (tmp_path / "smooth").mkdir()
    (tmp_path / "place").mkdir()
    smooth, place = (
        read_radiance(tmp_path / name / answer(tmp_path / name, do="estimate", detail=name == "place")["full"])
        for name in ("smooth", "place")
    )
    assert len(place) == 512 > len(smooth)
    before, after = project(smooth), project(place)
    assert np.linalg.norm(after - before) < 0.02 * np.linalg.norm(before)


@pytest.mark.ci
def test_normals_that_blender_holds_are_refused_or_bent(tmp_path):
    """Colours and vectors give one light, which is not that of the photo alone."""
    photo = ROOT / "examples" / "vase.png"
    mask = np.asarray(Image.open(photo).convert("RGBA"))[..., 3] > 127
    y, x = np.mgrid[: mask.shape[0], : mask.shape[1]] / max(mask.shape)
    n = np.stack([x - x[mask].mean(), y[mask].mean() - y, np.full_like(x, 0.5)], axis=-1)
    n = np.where(mask[..., None], n / np.linalg.norm(n, axis=-1, keepdims=True), 0).astype(np.float32)
    colors = np.where(mask[..., None], 0.5 + 0.5 * n, 0).astype(np.float32)
    found = []
    for values in (n, colors, None):
        given = None
        if values is not None:
            np.save(tmp_path / "pixels.npy", np.dstack([values, np.ones(mask.shape, np.float32)]))
            given = {"pixels": str(tmp_path / "pixels.npy"), "linear": True}
        answered = answer(tmp_path, do="estimate", photo={"file": str(photo)}, normals=given)
        found.append(read_radiance(tmp_path / answered["full"]))
    np.testing.assert_allclose(found[0], found[1], rtol=0.02, atol=0.01)
    assert np.abs(found[0] - found[2]).mean() > 0.01


@pytest.mark.ci
def test_panoramas_that_cannot_be_read_are_left_out_in_silence(tmp_path):
    folder = tmp_path / "panoramas"
    folder.mkdir()
    shutil.copy(ROOT / "examples" / "vase_truth.exr", folder)
    (folder / "damaged.hdr").write_bytes(b"no picture")
    found = answer(tmp_path, do="estimate", photo={"file": str(ROOT / "examples" / "vase.png")}, library=str(folder))
    said = "\n".join(found["warnings"])
    assert "Panorama vase_truth" in said
    assert found["error_deg"] is None  # it is no estimate's light
    assert ", guessed, give or take " in found["level"]  # as of a cut-out
    assert "left out: " in said
    assert "damaged.hdr" in said


def test_the_zip_cannot_be_built():
    wanted = loaded(WORKER.parents[1] / "build.py").wanted()
    assert {"onnxruntime", "OpenImageIO", "pillow"} <= {one.partition("==")[0] for one in wanted}
    assert all("==" in one for one in wanted)


@pytest.mark.ci
@pytest.mark.parametrize(("pitch", "roll"), [(0, 0), (25, 0), (25, 12), (-10, -8), (90, 0)])
def test_a_camera_is_headed_as_asked_and_level_in_spite_of_its_pitch_and_roll(pitch, roll):
    turn = loaded(WORKER).turned(30.0, up_of(pitch, roll))
    assert is_rotation(turn)
    np.testing.assert_allclose(turn @ up_of(pitch, roll), (0, 0, 1), atol=1e-9)
    ahead = turn @ (0, 0, -1)
    np.testing.assert_allclose(ahead[2], -np.sin(np.radians(pitch)), atol=1e-9)
    if pitch < 90:
        assert np.degrees(np.arctan2(-ahead[0], ahead[1])) == pytest.approx(30)


def test_a_pitch_alone_turns_about_the_picture_s_row():
    """Looking down by 20 degrees towards +Y: the picture's right stays Blender's +X."""
    np.testing.assert_allclose(loaded(WORKER).turned(0.0, up_of(20)) @ (1, 0, 0), (1, 0, 0), atol=1e-9)

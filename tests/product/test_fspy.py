"""A camera of fSpy: lens, pitch and roll."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest

from anyprobe.cli.options import ObjectOptions
from anyprobe.core.frames import rotation_x, rotation_z
from anyprobe.errors import InputError
from anyprobe.estimate.settings import Settings
from anyprobe.files.fspy import read_fspy
from anyprobe.hints import Hints

PITCH, ROLL = 25.0, -6.0


def project() -> dict:
    """As fSpy saves it: Z up, the camera looks along its own -Z."""
    camera_from_level = rotation_z(-np.radians(ROLL)) @ rotation_x(np.radians(PITCH))
    zup_from_yup = rotation_x(np.pi / 2)
    rows = np.eye(4)
    rows[:3, :3] = zup_from_yup @ camera_from_level.T
    return {
        "cameraParameters": {
            "cameraTransform": {"rows": rows.tolist()},
            "horizontalFieldOfView": np.radians(50.0),
            "verticalFieldOfView": np.radians(38.0),
        }
    }


def write(path, said) -> None:
    text = json.dumps(said).encode()
    path.write_bytes(struct.pack("<4sIII", b"fspy", 1, len(text), 3) + text + b"jpg")


def options(given=None, **more):
    return ObjectOptions(given=given or Hints(), finder=Settings(), **more)


def test_lens_pitch_and_roll(tmp_path):
    write(tmp_path / "a.fspy", project())
    (tmp_path / "a.json").write_text(json.dumps(project()["cameraParameters"]))
    for name in ("a.fspy", "a.json"):
        found = read_fspy(tmp_path / name)
        assert found == pytest.approx({"fov_deg": 50.0, "pitch_deg": PITCH, "roll_deg": ROLL})
    hints = options(camera=tmp_path / "a.fspy").hints()
    assert (hints.fov_deg, hints.roll_deg) == (pytest.approx(50.0), pytest.approx(ROLL))


def test_what_is_no_camera_is_one_line(tmp_path):
    write(tmp_path / "unsolved.fspy", {"cameraParameters": None})
    (tmp_path / "text.fspy").write_text("hello")
    (tmp_path / "cut.fspy").write_bytes(b"fspy\x01")
    mirrored = project()
    mirrored["cameraParameters"]["cameraTransform"]["rows"][0][0] *= -3
    write(tmp_path / "mirrored.fspy", mirrored)
    for name, words in (
        ("unsolved.fspy", "expected a solved camera"),
        ("text.fspy", "got something else"),
        ("cut.fspy", "got a damaged one"),
        ("mirrored.fspy", "got an impossible camera"),
        ("none.fspy", "no such file"),
    ):
        with pytest.raises(InputError, match=words):
            read_fspy(tmp_path / name)
    write(tmp_path / "solved.fspy", project())
    with pytest.raises(InputError) as refused:
        options(Hints(fov_deg=50.0), camera=tmp_path / "solved.fspy").hints()
    assert refused.value.subject == ("camera", "fov_deg")

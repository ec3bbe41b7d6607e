"""The Blender extension's worker, which needs no Blender: what it asks of this library is there."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import anyprobe
from anyprobe.core.frames import is_rotation
from anyprobe.files.radiance import read_radiance

ROOT = Path(__file__).parents[2]
WORKER = ROOT / "integrations" / "blender" / "light_from_photo" / "worker.py"
NOTHING = dict.fromkeys(
    ("mask", "click", "exclude", "box", "material", "albedo", "roughness", "normals", "fov_deg", "pitch_deg", "turn")
)


def answer(folder, **order):
    """What the worker writes, run apart from this process's paths."""
    photo = {"file": str(ROOT / "examples" / "table.png")}
    whole = {"photo": photo, "name": "table", "background": False, "detail": False, "library": None, "heading_deg": 0}
    (folder / "order.json").write_text(json.dumps({**NOTHING, **whole, "python_path": sys.path, **order}))
    subprocess.run([sys.executable, "-I", str(WORKER), str(folder)], check=True, timeout=300)
    return json.loads((folder / "answer.json").read_text())


def test_estimate_is_another_than_pythons(tmp_path):
    found = answer(tmp_path, do="estimate", fov_deg=50, pitch_deg=15, material="plastic", heading_deg=30)
    light = anyprobe.estimate(ROOT / "examples" / "table.png", fov_deg=50, pitch_deg=15, material="plastic")
    turn = np.array(found["turn"])
    assert is_rotation(turn)
    forward = turn @ [0, 0, -1]
    np.testing.assert_allclose(np.degrees([np.arctan2(-forward[0], forward[1]), np.arcsin(-forward[2])]), [30, 15])
    for source, wanted in zip(found["sources"], light.sources(), strict=True):
        assert turn @ wanted.direction @ source["towards"] > 0.9999
        np.testing.assert_allclose(source["irradiance"], wanted.irradiance, rtol=0.05)
        assert abs(source["angle_deg"] - 2 * wanted.radius_deg) < 2.1  # of resampled pixels, 2.8 degrees wide
    full, rest = (read_radiance(tmp_path / found[name]) for name in ("full", "rest"))
    assert full.max() > rest.max()
    assert found["foot"][2] == pytest.approx(-1)  # the camera's height over the ground is 1
    assert found["long_fov_deg"] == pytest.approx(50)
    assert 0.1 < found["object_size"] < 10


def test_refusals_are_lost(tmp_path):
    refused = answer(tmp_path, do="estimate", material="unobtainium")
    assert "material: expected one of" in refused["error"]


def test_advice_is_for_python(tmp_path):
    from anyprobe.masks.weights import REMEDY

    Image.new("RGB", (320, 240), (90, 120, 150)).save(tmp_path / "plain.png")
    said = answer(tmp_path, do="estimate", photo={"file": str(tmp_path / "plain.png")})["error"]
    assert said.endswith("pass a click, a box or a mask picture, or a photo with an alpha channel (by Mark Object)")
    sys.path.insert(0, str(WORKER.parent))
    try:
        from worker import in_the_panel
    finally:
        sys.path.pop(0)
    assert "pip" not in in_the_panel(f"wrong on one photo in three; for a better one {REMEDY}")
    assert in_the_panel("the object is white") == "the object is white"


def test_materials_are_unknown(tmp_path):
    assert "gold" in answer(tmp_path, do="materials")["materials"]

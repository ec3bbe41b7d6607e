"""A saved map is exported alike by the command line, by Python and over HTTP."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile

import numpy as np
import pytest

from anyprobe.core.frames import rotation_y
from anyprobe.estimate.ground import Ground
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.serve.api import create_app

GROUND = Ground(pitch_deg=20.0, pitch_error_deg=4.0, roll_deg=3.0, contact=(200.0, 300.0), source="estimated")
RADIANCE = np.full((64, 128, 3), 0.125, np.float32)
RADIANCE[20:24, 30:34] = 64.0


def made_light(ground: Ground | None = GROUND) -> Light:
    return Light(radiance=RADIANCE, origin=Origin(photo="vase.jpg", model="lift", long_fov_deg=50.0, ground=ground))


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator), raise_server_exceptions=False) as client:
        yield client


def sent(client, light: bytes, sidecar: bytes | None, kind: str = ".exr", **fields: str):
    files = {"photo": (f"light{kind}", light)} | ({} if sidecar is None else {"sidecar": ("light.json", sidecar)})
    return client.post("/v1/export/webxr", files=files, data=fields)


def described(answer) -> dict:
    assert answer.status_code == 200, answer.text
    return json.loads(zipfile.ZipFile(io.BytesIO(answer.content)).read("light_webxr.json"))


@pytest.mark.ci
@pytest.mark.parametrize("kind", [".exr", ".hdr"])
@pytest.mark.parametrize("frame", ["level", "camera"])
@pytest.mark.parametrize("light", [made_light(), made_light(None), made_light().rotate(rotation_y(0.7))])
def test_every_door_says_the_same_of_a_light(work, command, client, kind, frame, light):
    map_bytes = light.save(f"light{kind}").read_bytes()
    sidecar = light.save("light.json").read_bytes()
    command("export", f"light{kind}", "--to", "webxr", "--frame", frame, "-o", "out")
    by_command = json.loads((work / "out" / "light_webxr.json").read_text())
    light.export("webxr", "own", frame=frame)
    by_python = json.loads((work / "own" / "light_webxr.json").read_text())
    by_http = described(sent(client, map_bytes, sidecar, kind, frame=frame))
    assert by_http == by_command
    for part in ("origin", "dominant_light"):
        assert by_http[part].keys() == by_python[part].keys()
    assert by_http["origin"].get("level") == by_python["origin"].get("level")
    assert by_http["dominant_light"]["error_deg"] == by_python["dominant_light"]["error_deg"] > 0


def test_a_level_export_stands_upright_and_says_by_what(work, client):
    light = made_light()
    level = described(sent(client, light.save("light.exr").read_bytes(), light.save("light.json").read_bytes()))
    assert level["origin"]["level"].startswith("+Y is up: turned by the camera's pitch of 20.0 and roll of 3.0 degrees")
    np.testing.assert_allclose(np.array(level["world_from_camera"]) @ GROUND.up, [0, 1, 0], atol=1e-5)


def test_of_a_map_alone_nothing_is_said(work, client):
    alone = described(sent(client, made_light().save("light.exr").read_bytes(), None))
    assert alone["origin"] == {}
    assert alone["world_from_camera"] == np.eye(3).tolist()
    assert "error_deg" not in alone["dominant_light"]


STATED = {"pitch_deg": 20.0, "pitch_error_deg": 4.0, "roll_deg": 3.0, "contact": [1, 2], "source": "given"}


@pytest.mark.parametrize("change", [{"pitch_deg": "20"}, {"roll_deg": None}, {"pitch_error_deg": [1]}, {"contact": 7}])
def test_a_damaged_sidecar_is_one_line(work, command, client, change):
    wrong = json.dumps({"ground": STATED | change})
    light = made_light().save("light.exr").read_bytes()
    answer = sent(client, light, wrong.encode())
    assert answer.status_code == 422, answer.text
    line = answer.json()["detail"]
    assert line.startswith("sidecar: expected the .json of this map as it was written")
    assert answer.json()["subject"] == ["sidecar"]
    assert tempfile.gettempdir() not in answer.text
    (work / "light.json").write_text(wrong)
    complaint = command("export", "light.exr", "--to", "webxr").complaint
    assert complaint.startswith("anyprobe: light.json: expected the ")
    assert complaint.endswith("save the light again, or move the .json away")


def test_sidecars_and_frames_that_are_none_are_refused(work, client):
    light = made_light().save("light.exr").read_bytes()
    for fields, subject in (({"frame": "levle"}, "frame"), ({"sidecar": "{}"}, "sidecar")):
        answer = client.post("/v1/export/webxr", files={"photo": ("light.exr", light)}, data=fields)
        assert (answer.status_code, answer.json()["subject"]) == (422, [subject])
    for depth in (100, 600, 2000, 20_000):  # from which on one is refused depends on Python's version
        deep = b'{"photo": ' + b"[" * depth + b"]" * depth + b"}"
        assert sent(client, light, deep).status_code in (200, 422), depth
    assert sent(client, light, b" " * (2**24 + 1)).json()["detail"] == "sidecar: expected at most 16 MiB, got more"
    exported = b'{"target": "blender", "map": {"rolled_quarters_right": -1}}'
    plain = Light(radiance=RADIANCE).save("plain.hdr").read_bytes().replace(b"frame=", b"other=")
    assert "got one exported for blender" in sent(client, plain, exported, ".hdr").json()["detail"]

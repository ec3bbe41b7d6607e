"""What the HTTP API refuses by its name, its method or its frame: nothing that is sent is left out without a word."""

from __future__ import annotations

import ast
import io
import json
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support.transforms import transforms

from anyprobe.core.frames import rotation_y, world_from_camera
from anyprobe.estimate.runtime import DEFAULT_MODEL
from anyprobe.export.targets import export
from anyprobe.maps.radiance import write_hdr

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.serve import openapi
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import CLIENT_GONE, create_app
from anyprobe.serve.limits import Limits
from anyprobe.serve.page import Page


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator), raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


RADIANCE = np.full((64, 128, 3), 0.125, np.float32)
RADIANCE[20:24, 30:34] = 64.0
"""A map with one emitter, which .hdr holds as it is."""


def as_hdr(radiance: np.ndarray, folder) -> bytes:
    write_hdr(folder / "light.hdr", radiance)
    return (folder / "light.hdr").read_bytes()


def refusal(answer, status: int = 422) -> str:
    """The one line of an answer that refuses."""
    assert answer.status_code == status, answer.text
    line = answer.json()["detail"]
    assert "\n" not in line
    return line


def exported(target: str, folder, suffix: str, **options) -> bytes:
    """RADIANCE as the file of one target."""
    export(RADIANCE, target, folder, **options)
    return (folder / f"light_{target}{suffix}").read_bytes()


# Names


@pytest.mark.parametrize(
    ("address", "name", "known"),
    [
        ("estimate", "not", "click, exclude, box, near, far, fov,"),
        ("estimate", "clik", "include, format"),
        ("estimate", "world_from_camera", "material"),
        ("mask", "material", "one of click, exclude, box, near, far, fov, pitch, roll, format, got"),
        ("photo", "fov", "expected none here"),
        ("fuse", "clik", "surroundings"),
        ("export/three", "yaw", "one of exposure, world_from_camera, frame, got"),
    ],
)
def test_an_unknown_parameter_is_named_and_so_are_the_known_ones(client, photo, address, name, known):
    sent = {"content": photo}
    if address == "fuse":
        sent = {"files": {"photo": ("p.png", photo)}, "data": {"poses": transforms([np.eye(3)], ["p.png"])}}
    line = refusal(client.post(f"/v1/{address}", params={name: "10,10"}, **sent))
    assert line.startswith("query parameter: expected ")
    assert line.endswith(f"got {name!r}" + ("; did you mean click?" if (address, name) == ("estimate", "clik") else ""))
    assert known in line


@pytest.mark.parametrize(
    ("address", "name", "advice"),
    [("estimate", "not", ""), ("fuse", "poles", "; did you mean poses?"), ("mask", "include", "")],
)
@pytest.mark.parametrize("as_file", [True, False])
def test_an_unknown_field_of_a_form_is_named(client, photo, address, name, advice, as_file):
    files = {"photo": ("p.png", photo)} | ({name: ("x.png", photo)} if as_file else {})
    line = refusal(client.post(f"/v1/{address}", files=files, data={} if as_file else {name: "10,10"}))
    assert line.startswith("form field: expected one of photo, ")
    assert line.endswith(f"got {name!r}{advice}")


def test_a_mistyped_photo_is_not_called_absent(client, photo):
    assert "got 'phot'" in refusal(client.post("/v1/estimate", files={"phot": ("p.png", photo)}))


def test_all_that_is_described_is_taken(client, photo):
    """And so nothing is described that would be refused."""
    given = {
        "fov": "60",
        "pitch": "20",
        "roll": "1",
        "normals": "sphere",
        "surroundings": "photo",
        "material": "matte",
        "albedo": "0.5",
        "roughness": "0.4",
        "emitters": "expected",
        "looks": "2",
        "include": "mask",
        "format": "json",
    }
    pointed = {"box": "24,8,104,88", "click": "64,48", "exclude": "2,2"}
    cut = {"near": "1", "far": "2"}
    poses = {"poses": transforms([np.eye(3)], ["p.png"])}
    assert set(openapi.query_names(openapi.ESTIMATE_ROUTE)) == {*given, *pointed, *cut}
    assert set(openapi.query_names(openapi.FUSE_ROUTE)) == set(given) | {"box"}
    files = {"photo": ("p.png", photo)}
    for address, data in (("estimate", {}), ("fuse", poses)):
        assert client.post(f"/v1/{address}", files=files, data=data, params=given).status_code == 200


@pytest.mark.ci
@pytest.mark.parametrize("name", ["mask", "normals", "surroundings", "confidence"])
def test_a_photo_is_bounded_whatever_its_name(estimator, photo, name):
    with TestClient(create_app(estimator, Limits(max_pixels=1000))) as client:
        assert f"{name}: expected at most" in refusal(client.post("/v1/mask", files={"photo": (name, photo)}), 413)


# Statuses

DOORS = Path(create_app.__code__.co_filename).parent
UNDESCRIBED = {404, 405, CLIENT_GONE}
"""No operation of the API: other addresses and methods, and what nobody reads."""


def operations(app) -> list[tuple[str, str, set[int]]]:
    """Address, method and described statuses of each."""
    paths = app.openapi()["paths"]
    return [
        (path.replace("{target}", "three"), method, {int(status) for status in one["responses"]})
        for path, methods in paths.items()
        for method, one in methods.items()
    ]


def test_every_status_that_the_server_s_code_names_is_described(client):
    found = set()
    for file in DOORS.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            values = [*node.args, *(one.value for one in node.keywords)] if isinstance(node, ast.Call) else []
            numbers = [part for value in values for part in ast.walk(value) if isinstance(part, ast.Constant)]
            found |= {one.value for one in numbers if isinstance(one.value, int) and 400 <= one.value < 600}
    described = set().union(*(statuses for _, _, statuses in operations(client.app)))
    assert {400, 401, 403, 406, 408, 413, 422, 429, 500, 501} <= found
    assert found - UNDESCRIBED <= described


class Failing:
    """Networks that fail at everything, with a name."""

    model_id = "failing"

    def __getattr__(self, name):
        raise RuntimeError(name)


def test_each_address_answers_with_statuses_that_are_described_for_it():
    """By a foreign name or page, without a token, in no format, with nothing or too much, where no place is free."""
    app = create_app(Failing(), Limits(max_bytes=1000, workers=1), hosts=["localhost"], token="secret")
    full = create_app(Failing(), Limits(workers=1, waiting=-1), hosts=["localhost"])
    ours = {"Authorization": "Bearer secret"}
    ways = [
        (app, 400, {**ours, "Host": "elsewhere.example"}, b""),
        (app, 401, {}, b""),
        (app, 403, {**ours, "Origin": "https://elsewhere.example"}, b""),
        (app, 406, {**ours, "Accept": "text/css"}, b""),
        (app, 413, ours, bytes(1001)),
        (app, 422, ours, b""),
        (app, 400, {**ours, "Content-Type": "multipart/form-data"}, b"no boundary"),
        (full, 429, {}, b""),
    ]
    seen = set()
    for at, status, headers, body in ways:
        with TestClient(at, base_url="http://localhost", raise_server_exceptions=False) as client:
            for address, method, described in operations(at):
                answer = client.request(method, address, headers=headers, content=body if method == "post" else None)
                assert answer.status_code in described, (address, status, answer.text)
                if method == "post" and status in described:
                    assert answer.status_code == status, (address, answer.text)
                    seen.add(status)
                if answer.status_code >= 400:
                    assert {"type", "title", "status", "detail", "code"} <= set(answer.json())
    assert seen == {400, 401, 403, 406, 413, 422, 429}


# Maps


@pytest.mark.parametrize(("target", "suffix"), [("usd", ".exr"), ("blender", ".exr")])
def test_a_map_of_another_program_is_not_turned_twice(client, tmp_path, target, suffix):
    line = refusal(client.post("/v1/export/webxr", content=exported(target, tmp_path, suffix)))
    assert line.startswith("map: expected a map with the front in its centre, got ")
    assert tempfile.gettempdir() not in line
    assert "map.exr" not in line


@pytest.mark.parametrize("given", ["30,20", "30,20,10", ",".join(map(str, rotation_y(0.5).ravel().tolist()))])
@pytest.mark.parametrize("in_form", [True, False])
def test_an_export_is_turned_as_the_camera_stood(client, tmp_path, given, in_form):
    numbers = [float(one) for one in given.split(",")]
    turn = np.reshape(numbers, (3, 3)) if len(numbers) == 9 else world_from_camera(*np.radians(numbers))
    light = as_hdr(RADIANCE, tmp_path)
    asked = {"world_from_camera": given, "exposure": "1"}
    sent = {"files": {"photo": ("m.hdr", light)}, "data": asked} if in_form else {"content": light, "params": asked}
    answer = client.post("/v1/export/webxr", **sent)
    assert answer.status_code == 200, answer.text
    archive = zipfile.ZipFile(io.BytesIO(answer.content))
    (tmp_path / "again").mkdir()
    expected = json.loads(exported("webxr", tmp_path / "again", ".json", world_from_camera=turn, exposure_ev=1.0))
    found = json.loads(archive.read("light_webxr.json"))
    assert found["world_from_camera"] == expected["world_from_camera"]
    assert found["exposure_ev"] == 1.0
    assert found["sh"] == expected["sh"]


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"world_from_camera": "1,2,3,4"}, "world_from_camera: expected YAW,ELEVATION[,ROLL] in degrees or nine"),
        ({"world_from_camera": "left"}, "got 'left'"),
        ({"world_from_camera": "1,0,0,0,1,0,0,0,2"}, "world_from_camera: expected a [3, 3] rotation"),
        ({"exposure": "bright"}, "exposure: expected a number, got 'bright'"),
        ({"exposure": "31"}, "exposure: expected stops from -30 to 30"),
    ],
)
def test_a_turn_or_exposure_that_is_none_is_one_line(client, tmp_path, given, word):
    light = as_hdr(RADIANCE, tmp_path)
    assert word in refusal(client.post("/v1/export/webxr", content=light, params=given))


# Formats, methods and hosts


def test_formats_that_can_be_had_are_listed_once(client, photo):
    line = refusal(client.post("/v1/estimate?format=bmp", content=photo), 406)
    assert line.endswith("format=json|exr|hdr|png")


@pytest.mark.parametrize("with_page", [True, False])
def test_another_method_is_told_which_one_the_address_takes(estimator, with_page):
    """The page's own addresses, which are all that are left, hide none of the API's."""
    page = Page(estimator, DEFAULT_MODEL) if with_page else None
    with TestClient(create_app(estimator, page=page)) as client:
        for address in ("estimate", "fuse", "mask", "photo", "export/blender"):
            answer = client.get(f"/v1/{address}")
            assert refusal(answer, 405) == "expected POST, got GET"
            assert answer.headers["allow"] == "POST"
        assert refusal(client.post("/v1/targets"), 405) == "expected GET, got POST"
        for method in ("get", "post", "delete"):
            refusal(getattr(client, method)("/v1/nowhere"), 404)
        if page is not None:
            assert refusal(client.post("/"), 405) == "expected GET, got POST"
        assert client.get("/healthz").status_code == 200
        assert client.get("/").status_code == (200 if with_page else 404)


@pytest.mark.parametrize(
    ("host", "known"), [("localhost:8000", True), ("[::1]:8000", True), ("rebound.example", False)]
)
def test_a_foreign_name_is_told_how_to_be_let_in(estimator, host, known):
    names = ["127.0.0.1", "127.0.0.1", "localhost", "[::1]"]
    with TestClient(create_app(estimator, hosts=names)) as client:
        answer = client.get("/healthz", headers={"Host": host})
        if known:
            assert answer.status_code == 200
            return
        assert refusal(answer, 400) == (
            "host: expected 127.0.0.1 or localhost or [::1], got 'rebound.example'; "
            "to serve under another name, start with --allow-host NAME"
        )
        assert answer.headers["X-Content-Type-Options"] == "nosniff"

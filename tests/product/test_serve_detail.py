"""Detail over HTTP: the package's own light with detail, and a map that gets it."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from support.places import place

from anyprobe.core.frames import rotation_y
from anyprobe.estimate.result import Light
from anyprobe.light.environment import reduced
from anyprobe.light.filtering import blur_cosine_power
from anyprobe.light.harmonics import project
from anyprobe.maps.radiance import map_attributes, read_radiance, write_exr

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import create_app
from anyprobe.serve.limits import Limits


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator, Limits(workers=1)), raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


def radiance(answer) -> np.ndarray:
    assert answer.status_code == 200, answer.text
    packed = answer.json()["radiance"]
    return np.frombuffer(base64.b64decode(packed["base64"]), "<f4").reshape(packed["shape"])


def exr(values: np.ndarray, folder, name: str = "map", **settings) -> bytes:
    write_exr(folder / f"{name}.exr", values, **settings)
    return (folder / f"{name}.exr").read_bytes()


@pytest.mark.ci
def test_an_estimate_with_detail_is_the_package_s_own(client, estimator, photo, photo_rgba):
    answer = client.post("/v1/estimate?detail=plausible&size=128&include=radiance", content=photo)
    expected = estimator(photo_rgba).with_detail(size=128)
    np.testing.assert_allclose(radiance(answer), expected.radiance, rtol=1e-3, atol=1e-3)
    assert answer.json()["detail"] == expected.info["detail"]
    assert answer.json()["size"] == [256, 128]
    plain = client.post("/v1/estimate?detail=none", content=photo).json()
    assert "detail" not in plain
    assert plain["size"] == [128, 64]


@pytest.mark.ci
def test_the_photo_s_surroundings_are_in_it_at_the_photo_s_resolution(client, photo_rgba):
    """As Estimator(detail="plausible") has them, of pixels that the server's own process never sees."""
    import anyprobe

    opaque, mask = photo_rgba[..., :3], photo_rgba[..., 3]
    parts = {"photo": ("p.png", as_png(np.ascontiguousarray(opaque))), "mask": ("m.png", as_png(mask))}
    fields = {"surroundings": "photo", "detail": "plausible", "size": "256", "include": "radiance"}
    expected = anyprobe.Estimator(detail="plausible", size=256)(opaque, mask=mask, surroundings="photo")
    given = radiance(client.post("/v1/estimate", files=parts, data=fields))
    np.testing.assert_allclose(given, expected.radiance, rtol=1e-3, atol=1e-3)


def test_a_fused_light_takes_detail_too(client, photo):
    poses = f"[{np.eye(3).tolist()}, {rotation_y(0.8).tolist()}]"
    files = [("photo", ("a.png", photo)), ("photo", ("b.png", photo)), ("poses", ("p.json", poses.encode()))]
    answer = client.post("/v1/fuse", files=files, data={"detail": "plausible", "size": "64"})
    assert answer.json()["detail"]["kind"] == "plausible"


@pytest.mark.ci
def test_a_map_gets_detail_by_its_confidence_and_keeps_its_harmonics(client, tmp_path):
    """What the page asks for: the map is its own, the structure the server's."""
    estimate = np.maximum(blur_cosine_power(reduced(place(3), 64), 30.0), 0.0)
    confidence = np.zeros((64, 128, 3), np.float32)
    confidence[:20] = 1.0
    for given, said in (({}, None), ({"confidence": ("c.exr", exr(confidence, tmp_path))}, confidence[..., 0])):
        files = {"photo": ("map.exr", exr(estimate, tmp_path)), **given}
        answer = client.post("/v1/detail?size=128&format=hdr", files=files)
        assert answer.status_code == 200, answer.text
        (tmp_path / "fine.hdr").write_bytes(answer.content)
        fine = read_radiance(tmp_path / "fine.hdr")
        expected = Light(radiance=estimate, confidence=said).with_detail(size=128)
        np.testing.assert_allclose(fine, expected.radiance, rtol=0.02, atol=0.01)
        np.testing.assert_allclose(project(fine), project(estimate), atol=5e-3 * np.abs(project(estimate)).max())
        assert expected.info["detail"]["from"] in map_attributes(tmp_path / "fine.hdr")["detail"]


@pytest.mark.parametrize(
    ("route", "body", "query", "words"),
    [
        ("estimate", "photo", "detail=sharp", "expected one of none, plausible"),
        ("estimate", "photo", "detail=plausible&size=100", "expected one of 64, 128, 256, 512"),
        ("detail", "photo", "", "expected an OpenEXR .exr file"),
        ("detail", "fine", "", "got one with detail"),
        ("detail", "map", "detail=plausible", "expected one of size, format"),
        ("detail", "small", "", "at least 64 rows"),
    ],
)
def test_what_cannot_be_used_is_one_line(client, photo, tmp_path, route, body, query, words):
    bodies = {
        "photo": photo,
        "map": exr(np.ones((64, 128, 3), np.float32), tmp_path),
        "small": exr(np.ones((32, 64, 3), np.float32), tmp_path),
        "fine": exr(np.ones((64, 128, 3), np.float32), tmp_path, attributes={"detail": "plausible"}),
    }
    answer = client.post(f"/v1/{route}?{query}", content=bodies[body])
    assert answer.status_code == 422, answer.text
    assert words in answer.json()["detail"]
    assert str(tmp_path) not in answer.json()["detail"]


def test_a_confidence_of_another_size_is_refused(client, tmp_path):
    files = {
        "photo": ("map.exr", exr(np.ones((64, 128, 3), np.float32), tmp_path)),
        "confidence": ("c.exr", exr(np.ones((32, 64, 3), np.float32), tmp_path)),
    }
    answer = client.post("/v1/detail", files=files)
    assert answer.status_code == 422
    assert "expected the map's size" in answer.json()["detail"]


def test_a_size_without_detail_is_refused(client, photo):
    answer = client.post("/v1/estimate?size=64", content=photo)
    assert (answer.status_code, answer.json()["detail"]) == (
        422,
        "size: does nothing without detail; send detail plausible, or leave out size",
    )

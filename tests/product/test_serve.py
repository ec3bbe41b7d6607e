"""The HTTP API: what it answers, what it refuses and how, and what it never tells."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import os
import signal
import threading
import time
import zipfile
from functools import partial

import numpy as np
import pytest
from PIL import Image
from support.openapi_client import OpenApiClient
from support.scenes import made_map
from support.transforms import transforms

import anyprobe
from anyprobe.core.frames import rotation_y
from anyprobe.errors import InputError
from anyprobe.maps.radiance import read_radiance

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("pebble", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.cli.serve import _token, is_loopback
from anyprobe.estimate.result import Light
from anyprobe.inputs.settings import DEFAULT_MODEL
from anyprobe.pictures.images import png_bytes as as_png
from anyprobe.serve import tasks
from anyprobe.serve.api import create_app
from anyprobe.serve.limits import MAX_PHOTOS, Limits
from anyprobe.serve.page import Page
from anyprobe.serve.pool import Cancelled, WorkerPool
from anyprobe.session import Shot

LIMITS = Limits(max_bytes=400_000, max_pixels=20_000, workers=1, waiting=1, upload_s=5.0)
TURNS = [np.eye(3), rotation_y(0.8)]


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator, LIMITS), raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


def post(client, address: str, photo: bytes | list[bytes], name: str = "photo.png", headers=None, **fields):
    """Send a photo or several, files as bytes and texts as they are."""
    photos = photo if isinstance(photo, list) else [photo]
    files = [("photo", (name if len(photos) == 1 else f"{k}.png", one)) for k, one in enumerate(photos)]
    files += [(field, ("x", one)) for field, value in fields.items() for one in _listed(value) if _is_file(one)]
    texts = {field: value for field, value in fields.items() if not any(map(_is_file, _listed(value)))}
    return client.post(address, files=files, data=texts, headers=headers)


def _listed(value) -> list:
    return value if isinstance(value, list) else [value]


def _is_file(value) -> bool:
    return isinstance(value, bytes)


def refusal(answer, status: int = 422) -> dict:
    """The data of an answer that refuses."""
    assert answer.status_code == status, answer.text
    said = answer.json()
    assert {"type", "title", "status", "detail", "code"} <= set(said)
    assert "\n" not in said["detail"]
    assert "Traceback" not in said["detail"]
    return said


def radiance(answer) -> np.ndarray:
    assert answer.status_code == 200, answer.text
    packed = answer.json()["radiance"]
    return np.frombuffer(base64.b64decode(packed["base64"]), "<f4").reshape(packed["shape"])


# Lights


def test_form_gives_the_same_light_as_the_package(client, estimator, photo_rgba, photo_mask):
    fields = {"mask": as_png(photo_mask), "include": "radiance", "fov": "60", "surroundings": "none"}
    answer = post(client, "/v1/estimate", as_png(photo_rgba[..., :3]), "sphere.png", **fields)
    np.testing.assert_allclose(radiance(answer), estimator(photo_rgba, fov_deg=60).radiance, rtol=1e-3, atol=1e-3)
    assert (answer.json()["photo"], answer.json()["fov_source"]) == ("sphere.png", "given")


@pytest.mark.parametrize(("accept", "suffix"), [("image/x-exr", "exr"), ("image/vnd.radiance;q=0.9, text/html", "hdr")])
def test_map_comes_in_the_format_that_is_accepted(client, estimator, photo, photo_rgba, tmp_path, accept, suffix):
    path = tmp_path / f"map.{suffix}"
    path.write_bytes(post(client, "/v1/estimate", photo, headers={"Accept": accept}).content)
    np.testing.assert_allclose(read_radiance(path), estimator(photo_rgba).radiance, rtol=0.01, atol=0.01)
    assert post(client, f"/v1/estimate?format={suffix}", photo).content == path.read_bytes()
    refusal(post(client, "/v1/estimate", photo, headers={"Accept": "text/css"}), 406)


def test_mask_shows_what_the_estimate_uses(client, photo, photo_mask):
    answer = post(client, "/v1/mask", photo)
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(answer.content))), photo_mask)
    given = post(client, "/v1/mask?format=json", photo).json()
    assert given["size"] == [photo_mask.shape[1], photo_mask.shape[0]]
    assert (given["source"], given["confidence"]) == ("alpha", None)


@pytest.mark.ci
def test_what_is_known_reaches_the_estimate(client, estimator, photo, photo_rgba):
    normals = np.full((*photo_rgba.shape[:2], 3), (128, 128, 255), np.uint8)  # all of it faces the camera
    given = {"material": "plastic", "albedo": "0.2,0.3,0.4"}
    answer = post(client, "/v1/estimate", photo, normals=as_png(normals), **given).json()
    expected = estimator(photo_rgba, normals=normals, material="plastic", albedo=(0.2, 0.3, 0.4)).info["hints"]
    assert answer["hints"]["material"]["albedo"] == [0.2, 0.3, 0.4]
    np.testing.assert_allclose(answer["hints"]["gain"], expected["gain"], rtol=1e-3)
    assert post(client, "/v1/estimate", photo, normals="sphere").json()["hints"] == {"normals": True}
    assert post(client, "/v1/estimate", photo, pitch="25").json()["pitch_deg"] == 25.0


def test_several_photos_with_poses_give_one_light(client, estimator, photo_rgba):
    pictures = [photo_rgba, np.ascontiguousarray(photo_rgba[:, ::-1])]
    photos = [as_png(one) for one in pictures]
    answer = post(client, "/v1/estimate", photos, poses=transforms(TURNS).encode(), include="radiance")
    expected = anyprobe.fuse_lights([estimator(one) for one in pictures], TURNS)
    np.testing.assert_array_equal(radiance(answer), expected.radiance)
    rgb = [as_png(one[..., :3]) for one in pictures]
    masks = [as_png(one[..., 3]) for one in pictures]
    given = {"poses": transforms(TURNS, camera_angle_x=np.radians(50)), "mask": masks, "include": "radiance"}
    masked = post(client, "/v1/estimate", rgb, surroundings="none", **given)
    assert masked.json()["long_fov_deg"] == pytest.approx(50, abs=1e-3)
    assert masked.json()["fused"] == ["0.png", "1.png"]


@pytest.mark.parametrize(
    ("count", "fields", "subject"),
    [
        (2, {}, "poses"),
        (2, {"poses": "{}"}, "poses"),
        (2, {"poses": transforms([np.eye(3)])}, "poses"),
        (2, {"poses": transforms(TURNS), "box": "1,2,3,4"}, "box"),
        (2, {"poses": transforms(TURNS), "click": "1,2"}, "click"),
        (MAX_PHOTOS + 1, {}, "photo"),
    ],
)
def test_several_photos_that_lack_something_are_refused(client, photo, count, fields, subject):
    assert refusal(post(client, "/v1/estimate", [photo] * count, **fields))["subject"] == [subject]


@pytest.mark.parametrize(
    ("address", "fields", "subject"),
    [
        ("mask", {}, "photo"),
        ("photo", {}, "photo"),
        ("export/three", {}, "photo"),
        ("estimate", {"poses": transforms(TURNS), "fov": ["50", "60"]}, "fov"),
    ],
)
def test_a_field_sent_twice_where_one_is_read_is_refused(client, photo, address, fields, subject):
    said = refusal(post(client, f"/v1/{address}", [photo] * 2, **fields))
    assert said["subject"] == [subject]
    assert "expected one, got 2" in said["detail"]


def test_a_field_in_the_address_is_refused(client, photo):
    said = refusal(post(client, "/v1/estimate?fov=40", photo))
    assert said["detail"].startswith("fov: expected it in the form, got it in the address; ")
    assert post(client, "/v1/mask?format=json&_=1", photo).status_code == 200


def test_unknown_fields_are_refused_and_the_nearest_is_named(client, photo):
    assert "did you mean include?" in refusal(post(client, "/v1/estimate", photo, inclde="mask"))["detail"]
    assert refusal(client.post("/v1/estimate", content=photo))["subject"] == ["photo"]


# Pictures and exports


def test_photo_of_any_format_becomes_an_upright_png(client, photo_rgba):
    image = Image.fromarray(photo_rgba[..., :3])
    exif = Image.Exif()
    exif[0x0112] = 6  # turned: the first row is the right side
    stream = io.BytesIO()
    image.save(stream, format="TIFF", exif=exif)
    answer = post(client, "/v1/photo", stream.getvalue())
    assert Image.open(io.BytesIO(answer.content)).size == (image.height, image.width)


def test_client_made_from_the_description_calls_each_address(client, photo, tmp_path):
    made, called = OpenApiClient(client), set()
    exr = Light(radiance=made_map()).save(tmp_path / "l.exr").read_bytes()
    for address, method in made.operations:
        if method == "get":
            assert made.call(address, "get").status_code == 200
        elif "{target}" in address:
            for target in made.choices(address, "target"):
                answer = made.call(address, "post", {"target": target}, photo=exr)
                assert f"light_{target}.json" in zipfile.ZipFile(io.BytesIO(answer.content)).namelist()
        else:
            assert made.call(address, "post", photo=photo).status_code == 200
            assert made.call(address, "post", photo=b"no photo").status_code == 422
        called.add(address)
    state = {"/healthz", "/readyz", "/metrics"}
    assert called - state == {"/v1/estimate", "/v1/mask", "/v1/photo", "/v1/export/{target}", "/v1/targets"}


# Bounds


def test_too_many_bytes_and_pixels_are_413(client, photo):
    body = bytes(LIMITS.max_bytes + 1)
    refusal(client.post("/v1/estimate", content=body), 413)
    pieces = (body[i : i + 9999] for i in range(0, len(body), 9999))  # chunked: no length is announced
    form = {"Content-Type": "multipart/form-data; boundary=x"}
    refusal(client.post("/v1/estimate", content=pieces, headers=form), 413)
    bomb = as_png(np.zeros((400, 400), np.uint8))
    refusal(post(client, "/v1/estimate", bomb), 413)
    refusal(post(client, "/v1/estimate", photo, mask=bomb), 413)
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 8000\n"
    refusal(post(client, "/v1/export/three", header), 413)


def test_a_full_queue_is_429_and_says_when_to_come_back(client, photo):
    pool = client.app.state.pool
    pool.taken = LIMITS.places
    try:
        answer = post(client, "/v1/estimate", photo)
        refusal(answer, 429)
        assert answer.headers["retry-after"] == "1"
        assert client.get("/readyz").status_code == 503
    finally:
        pool.taken = 0
    assert client.get("/readyz").json() == {"status": "ready"}
    assert post(client, "/v1/photo", photo).status_code == 200
    assert pool.taken == 0


def test_a_body_that_does_not_come_is_408(estimator):
    async def receive():
        await asyncio.sleep(60)

    sent = []

    async def send(message):
        sent.append(message)

    headers = [(b"host", b"x"), (b"content-type", b"multipart/form-data; boundary=x")]
    scope = {"type": "http", "method": "POST", "path": "/v1/photo", "headers": headers, "query_string": b""}
    scope |= {"http_version": "1.1", "scheme": "http", "root_path": "", "raw_path": b"/v1/photo"}
    app = create_app(estimator, Limits(upload_s=0.05))
    asyncio.run(app(scope, receive, send))
    assert sent[0]["status"] == 408
    assert app.state.pool.taken == 0


async def _nobody_leaves() -> None:
    await asyncio.Event().wait()


@pytest.fixture(scope="module")
def decode():
    """Run a task in a pool's processes."""
    pool = WorkerPool(Limits(workers=1, quick_s=8.0, decode_s=8.0, decode_mb=250))

    def run(task, quick=False, gone=_nobody_leaves):
        return asyncio.run(pool.decode(task, quick, gone))

    yield run
    pool.close()


def black(side: int) -> bytes:
    """A PNG of few bytes and many pixels."""
    stream = io.BytesIO()
    Image.new("RGB", (side, side)).save(stream, format="PNG")
    return stream.getvalue()


def _dies(once: str) -> int:
    """End this process, the first time or each time."""
    if once and os.path.exists(once):
        return os.getpid()
    if once:
        open(once, "w", encoding="utf-8").close()
    os.kill(os.getpid(), signal.SIGKILL)
    return 0


@pytest.mark.ci
def test_a_process_that_ends_is_replaced_and_its_work_done_once_more(decode, tmp_path, photo):
    assert decode(partial(_dies, str(tmp_path / "died"))) != os.getpid()
    with pytest.raises(InputError, match="memory"):
        decode(partial(_dies, ""))
    assert decode(partial(tasks.mask, Shot(source=photo, name="photo"), 10**9, True))["source"] == "alpha"


@pytest.mark.ci
def test_what_takes_too_long_or_too_much_memory_is_ended(decode):
    with pytest.raises(InputError, match="slower"):
        decode(partial(time.sleep, 60))
    with pytest.raises(InputError, match="memory"):
        decode(partial(tasks.upright, Shot(source=black(9000), name="photo"), 10**9))


@pytest.mark.ci
def test_who_leaves_ends_the_work(decode):
    async def leaves() -> None:
        pass

    start = time.monotonic()
    with pytest.raises(Cancelled):
        decode(partial(time.sleep, 60), gone=leaves)
    assert time.monotonic() - start < 5


# Who may ask


@pytest.mark.ci
def test_a_token_is_asked_for_by_all_but_the_health(estimator, photo):
    with TestClient(create_app(estimator, token="secret-secret"), base_url="https://testserver") as client:
        assert client.get("/healthz").status_code == 200
        for headers in ({}, {"Authorization": "Bearer other"}, {"Authorization": "secret-secret"}):
            answer = post(client, "/v1/photo", photo, headers=headers)
            assert answer.status_code == 401
            assert "secret" not in answer.text
        good = {"Authorization": "Bearer secret-secret"}
        assert post(client, "/v1/photo", photo, headers=good).status_code == 200
        document = client.get("/openapi.json", headers=good).json()
        assert document["components"]["securitySchemes"] == {"HTTPBearer": {"type": "http", "scheme": "bearer"}}
        answer = client.get("/v1/targets?token=secret-secret", follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (303, "/v1/targets")
        assert {"HttpOnly", "SameSite=strict", "Secure"} <= set(answer.headers["set-cookie"].split("; "))
        assert client.get("/v1/targets").status_code == 200  # the cookie


def test_a_token_is_made_where_other_machines_come_in():
    assert _token(None, True) is None
    assert len(_token(None, False)) >= 16
    assert _token("none", False) is None
    for bad in ("short", "with space in", "é" * 20, ""):
        with pytest.raises(InputError) as caught:
            _token(bad, True)
        assert caught.value.subject == ("token",)


def test_pages_of_other_origins_are_kept_out(client, estimator, photo):
    foreign = {"Origin": "https://elsewhere.example", "Sec-Fetch-Site": "cross-site"}
    refusal(post(client, "/v1/photo", photo, headers=foreign), 403)
    for origin in ("http://elsewhere.example", "null"):  # over plain http a browser sends Origin alone
        refusal(post(client, "/v1/photo", photo, headers={"Origin": origin}), 403)
    assert post(client, "/v1/photo", photo, headers={"Origin": "http://testserver"}).status_code == 200
    with TestClient(create_app(estimator, LIMITS, origins=["https://elsewhere.example"], token="secret")) as shut:
        asking = {"Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "authorization"}
        asked = shut.options("/v1/estimate", headers={**foreign, **asking})  # as browsers do, without the token
        assert asked.status_code == 200
        told = {**foreign, "Authorization": "Bearer secret"}
        answer = post(shut, "/v1/photo", photo, headers=told)
        assert answer.headers["access-control-allow-origin"] == "https://elsewhere.example"
        refusal(post(shut, "/v1/photo", photo, headers=foreign), 401)


@pytest.mark.parametrize(("host", "status"), [("localhost:8000", 200), ("[::1]:8000", 200), ("rebound.example", 400)])
def test_foreign_names_for_this_machine_are_refused(estimator, host, status):
    with TestClient(create_app(estimator, hosts=["localhost", "[::1]", "::1"])) as client:
        assert client.get("/healthz", headers={"Host": host}).status_code == status


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "localhost", "::1", "[::1]"])
def test_a_loopback_is_known(host):
    assert is_loopback(host)
    assert not is_loopback({"127.0.0.1": "0.0.0.0", "::1": "::"}.get(host, "192.168.1.2"))


# What is told


def test_no_answer_tells_a_path_of_the_machine(client, photo, tmp_path):
    given = post(client, "/v1/estimate", photo, str(tmp_path / "sphere.png"), include="stages,mask,radiance").json()
    assert given["photo"] == "sphere.png"
    assert (given["mask"]["source"], given["mask"]["media_type"]) == ("alpha", "image/png")
    assert str(tmp_path) not in json.dumps(given)

    class Fails:
        model_id = "fails"

        def with_settings(self, **settings):
            raise RuntimeError(f"cannot open {tmp_path}/secret")

    with TestClient(create_app(Fails(), LIMITS), raise_server_exceptions=False) as failing:
        assert "secret" not in refusal(post(failing, "/v1/estimate", photo), 500)["detail"]


def test_every_answer_lets_threads_run_and_nothing_be_embedded(client):
    for answer in (client.get("/healthz"), client.get("/nowhere"), client.post("/v1/estimate")):
        assert answer.headers["Cross-Origin-Opener-Policy"] == "same-origin"
        assert answer.headers["Cross-Origin-Embedder-Policy"] == "require-corp"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]


def test_the_page_hides_no_address_and_is_packed(estimator):
    with TestClient(create_app(estimator, page=Page(estimator, DEFAULT_MODEL))) as client:
        for address in ("estimate", "mask", "photo", "export/blender"):
            refusal(client.get(f"/v1/{address}"), 405)
        refusal(client.get("/v1/nowhere"), 404)
        refusal(client.post("/"), 405)
        for address in ("/", "/weights/light.onnx", "/openapi.json"):
            assert client.get(address).headers["content-encoding"] == "gzip", address


def test_metrics_count_requests_by_route_and_status(client, photo):
    post(client, "/v1/mask", photo)
    post(client, "/v1/export/three", b"no map")
    client.get("/a-word-of-the-clients")
    text = client.get("/metrics").text
    assert 'anyprobe_requests_total{route="/v1/mask",status="200"}' in text
    assert 'anyprobe_requests_total{route="/v1/export/{target}",status="422"}' in text
    assert f"anyprobe_places {float(LIMITS.places)}" in text
    assert "a-word-of" not in text


@pytest.mark.ci
def test_a_plain_photo_does_not_wait_behind_slow_files(estimator, photo):
    with TestClient(create_app(estimator, Limits(workers=1))) as client:
        pool = client.app.state.pool
        post(client, "/v1/photo", photo)  # its process is there
        slow = [pool._lanes["slow"].schedule(time.sleep, args=(30,)) for _ in "ab"]
        done = threading.Event()
        threading.Thread(target=lambda: post(client, "/v1/photo", photo).status_code == 200 and done.set()).start()
        assert done.wait(20)
        assert not any(one.done() for one in slow)
        for one in slow:
            one.cancel()

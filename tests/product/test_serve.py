"""The HTTP API: what it answers, what it refuses and how, and what it never tells."""

from __future__ import annotations

import asyncio
import base64
import io
import json
import threading
import zipfile

import numpy as np
import pytest
from PIL import Image
from support.scenes import made_map

from anyprobe.core.frames import rotation_y
from anyprobe.maps.radiance import read_radiance

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.cli.serve import is_loopback
from anyprobe.estimate.photo import load_photo
from anyprobe.estimate.result import Light
from anyprobe.scatter.materials import Material
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import CLIENT_GONE, create_app
from anyprobe.serve.limits import Limits
from anyprobe.serve.pool import Busy, Cancelled, WorkerPool

LIMITS = Limits(max_bytes=200_000, max_pixels=20_000, workers=1, waiting=1, upload_s=5.0)


@pytest.fixture(scope="module")
def client(estimator):
    with TestClient(create_app(estimator, LIMITS), raise_server_exceptions=False) as client:
        yield client


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


def complaint(answer, status: int) -> str:
    """The one line of an answer that refuses."""
    assert answer.status_code == status, answer.text
    assert {"detail", "code", "status"} <= set(answer.json())
    line = answer.json()["detail"]
    assert "\n" not in line
    assert "Traceback" not in line
    return line


def test_body_or_form_give_the_same_light_as_the_package(client, estimator, photo, photo_rgba, photo_mask):
    expected = estimator(photo_rgba)
    raw = client.post("/v1/estimate?include=radiance", content=photo)
    parts = {"photo": ("sphere.jpg", as_png(photo_rgba[..., :3])), "mask": ("m.png", as_png(photo_mask))}
    form = client.post("/v1/estimate", files=parts, data={"include": "radiance", "fov": "65", "surroundings": "none"})
    for answer in (raw, form):
        given = answer.json()
        found = np.frombuffer(base64.b64decode(given["radiance"]["base64"]), "<f4")
        assert given["radiance"]["shape"] == list(expected.radiance.shape)
        np.testing.assert_allclose(found.reshape(expected.radiance.shape), expected.radiance, rtol=1e-3, atol=1e-3)
        np.testing.assert_allclose(given["dominant_light"]["direction"], expected.dominant_light().direction, atol=1e-2)
    assert form.json()["photo"] == "sphere.jpg"
    assert form.json()["fov_source"] == "given"


@pytest.mark.parametrize(("accept", "suffix"), [("image/x-exr", "exr"), ("image/vnd.radiance;q=0.9, text/html", "hdr")])
def test_map_comes_in_the_format_that_is_accepted(client, estimator, photo, photo_rgba, tmp_path, accept, suffix):
    path = tmp_path / f"map.{suffix}"
    path.write_bytes(client.post("/v1/estimate", content=photo, headers={"Accept": accept}).content)
    np.testing.assert_allclose(read_radiance(path), estimator(photo_rgba).radiance, rtol=0.01, atol=0.01)
    assert client.post(f"/v1/estimate?format={suffix}", content=photo).content == path.read_bytes()


def test_accept_that_nothing_meets_is_refused(client, photo):
    line = complaint(client.post("/v1/estimate", content=photo, headers={"Accept": "text/css"}), 406)
    assert "image/x-exr" in line


@pytest.mark.ci
def test_mask_shows_what_the_estimate_uses(client, photo, photo_rgba, photo_mask):
    answer = client.post("/v1/mask", content=photo)
    assert answer.headers["content-type"] == "image/png"
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(answer.content))), photo_mask)
    given = client.post("/v1/mask?format=json", content=photo).json()
    assert given["size"] == [photo_mask.shape[1], photo_mask.shape[0]]
    assert (given["source"], given["confidence"]) == ("alpha", None)
    opaque = as_png(photo_rgba[..., :3])
    found = client.post("/v1/mask?format=json&click=64,48", content=opaque).json()
    assert found["source"] == "click"
    assert found["confidence"] == round(load_photo(opaque, click=(64, 48)).mask_confidence, 4)


def test_clicks_and_boxes_reach_the_mask(client, photo_rgba):
    opaque = as_png(photo_rgba[..., :3])
    line = complaint(client.post("/v1/mask?click=500,2", content=opaque), 422)
    assert "500,2" in line
    assert "exclude: " in complaint(client.post("/v1/mask?exclude=500,2", content=opaque), 422)
    assert "box" in complaint(client.post("/v1/mask", content=opaque, params={"box": "5,5,4,9"}), 422)


def test_what_is_known_of_the_object_reaches_the_estimate(client, estimator, photo, photo_rgba):
    normals = np.full((*photo_rgba.shape[:2], 3), (128, 128, 255), np.uint8)  # all of it faces the camera
    parts = {"photo": ("sphere.png", photo), "normals": ("n.png", as_png(normals))}
    answer = client.post("/v1/estimate", files=parts, data={"material": "plastic", "albedo": "0.2,0.3,0.4"})
    given = answer.json()["hints"]
    assert given["normals"] is True
    assert given["material"]["albedo"] == [0.2, 0.3, 0.4]
    expected = estimator(
        photo_rgba,
        normals=normals,
        material=Material(albedo=np.array([0.2, 0.3, 0.4]), f0=np.full(3, 0.045), alpha=0.12),
    )
    np.testing.assert_allclose(given["gain"], expected.info["hints"]["gain"], rtol=1e-3)
    rough = client.post("/v1/estimate?material=plastic&roughness=0.5", content=photo).json()["hints"]
    expected = estimator(photo_rgba, material="plastic", roughness=0.5).info["hints"]
    assert rough["material"] == expected["material"]
    assert rough["material"]["alpha"] == 0.25
    assert client.post("/v1/estimate", content=photo).json()["hints"] == {"normals": False}
    for sphere in (
        client.post("/v1/estimate?normals=sphere", content=photo),
        client.post("/v1/estimate", files={"photo": ("sphere.png", photo)}, data={"normals": "sphere"}),
    ):
        assert sphere.json()["hints"] == {"normals": True}
    opaque, mask = as_png(photo_rgba[..., :3]), as_png(photo_rgba[..., 3])
    seen = client.post(
        "/v1/estimate", files={"photo": ("b.png", opaque), "mask": ("m.png", mask)}, data={"surroundings": "photo"}
    )
    assert 0 < seen.json()["hints"]["surroundings"] < 0.2
    panorama = np.random.default_rng(0).integers(0, 255, (64, 128, 3), np.uint8)
    files = {"photo": ("sphere.png", photo), "surroundings": ("p.png", as_png(panorama))}
    assert client.post("/v1/estimate", files=files).json()["hints"]["surroundings"] == 1.0
    exr = {**parts, "normals": ("n.exr", b"\x76\x2f\x31\x01")}
    assert "16-bit PNG" in complaint(client.post("/v1/estimate", files=exr), 422)


def test_depth_gives_normals_and_mask(client):
    y, x = np.mgrid[-1:1:96j, -1.3:1.3:128j]
    depth = np.where(x * x + y * y < 0.36, 3.0 - np.sqrt(np.maximum(0.36 - x * x - y * y, 0.0)), 5.0)
    photo = as_png(np.full((96, 128, 3), 102, np.uint8))
    millimetres = as_png(np.round(1000 * depth).astype(np.uint16))
    files = {"photo": ("p.png", photo), "depth": ("d.png", millimetres)}
    answer = client.post("/v1/estimate", files=files, data={"near": "2100", "far": "4000", "fov": "50"}).json()
    assert (answer["hints"]["normals"], answer["mask"]["source"]) == (True, "depth")


def test_emitters_are_spread_where_that_is_asked(client, estimator, photo, photo_rgba):
    """For this answer alone; the next one is drawn again."""
    answer = client.post("/v1/estimate?emitters=expected&include=radiance", content=photo).json()
    assert answer["emitters"] == "expected"
    packed = answer["radiance"]
    radiance = np.frombuffer(base64.b64decode(packed["base64"]), "<f4").reshape(packed["shape"])
    np.testing.assert_allclose(
        radiance, estimator.with_settings(emitters="expected")(photo_rgba).radiance, rtol=1e-4, atol=1e-5
    )
    assert client.post("/v1/estimate", content=photo).json()["emitters"] == "mode"


@pytest.mark.parametrize(
    ("query", "body", "word"),
    [
        ("", b"", "nothing"),
        ("", b"no picture at all", "expected an image"),
        ("?box=1,2", None, "X0,Y0,X1,Y1"),
        ("?fov=wide", None, "a number"),
        ("?fov=nan", None, "a number"),
        ("?fov=500", None, "170"),
        ("?include=everything", None, "radiance"),
        ("?material=granite", None, "chrome"),
        ("?normals=cube", None, "or sphere"),
        ("?surroundings=room", None, "or photo"),
        ("?albedo=0.5,0.5", None, "a number or R,G,B"),
        ("?albedo=2", None, "up to 1"),
        ("?roughness=0", None, "roughness: expected a number from 0.1 to 1"),
        ("?roughness=0.3,0.4", None, "roughness: expected a number"),
        ("?emitters=bright", None, "expected one of mode, expected"),
        ("?emitters=expcted", None, "did you mean expected?"),
        ("?emiters=mode", None, "did you mean emitters?"),
        ("?fov=60&fov=70", None, "expected one value, got 2"),
    ],
)
def test_what_cannot_be_used_is_named_in_one_line(client, photo, query, body, word):
    assert word in complaint(client.post(f"/v1/estimate{query}", content=photo if body is None else body), 422)


def test_too_many_bytes_are_refused_by_their_announcement_and_by_their_count(client):
    body = bytes(LIMITS.max_bytes + 1)
    complaint(client.post("/v1/estimate", content=body), 413)
    pieces = (body[i : i + 9999] for i in range(0, len(body), 9999))  # chunked: no length is announced
    complaint(client.post("/v1/estimate", content=pieces), 413)


@pytest.mark.parametrize("part", ["photo", "mask"])
def test_too_many_pixels_are_refused_before_they_are_decoded(client, photo, part):
    bomb = as_png(np.zeros((400, 400), np.uint8))
    assert len(bomb) < 1000
    parts = {"photo": ("p.png", photo), "mask": ("m.png", photo)} | {part: ("bomb.png", bomb)}
    assert "pixels" in complaint(client.post("/v1/estimate", files=parts), 413)


@pytest.mark.ci
def test_full_house_answers_429_and_when_to_come_back(estimator, photo):
    started, go_on = threading.Event(), threading.Event()

    class Slow:
        model_id = "slow"

        def with_settings(self):
            return self

        def from_crop(self, photo, crop, start):
            started.set()
            go_on.wait(20)
            return estimator.from_crop(photo, crop)

    limits = Limits(workers=1, waiting=0, retry_after_s=7)
    with TestClient(create_app(Slow(), limits)) as client:
        first: list = []
        thread = threading.Thread(target=lambda: first.append(client.post("/v1/estimate", content=photo)))
        thread.start()
        assert started.wait(30)
        assert client.get("/healthz").json()["taken"] == 1
        refused = client.post("/v1/estimate", content=photo)
        go_on.set()
        thread.join(20)
        assert "again" in complaint(refused, 429)
        assert refused.headers["Retry-After"] == "7"
        assert first[0].status_code == 200
        assert client.post("/v1/estimate", content=photo).status_code == 200


def test_who_is_sent_away_may_first_say_all(estimator):
    """Or the connection closes on a body half sent, and the answer with it."""
    app = create_app(estimator, Limits(workers=1, waiting=-1))  # no place at all
    parts, sent, taken_before = [b"x" * 1000] * 5, [], []

    async def receive():
        more = bool(parts)
        return {"type": "http.request", "body": parts.pop() if more else b"", "more_body": more}

    async def send(message):
        taken_before.append(5 - len(parts))
        sent.append(message)

    scope = {"type": "http", "method": "POST", "path": "/v1/estimate", "raw_path": b"/v1/estimate"}
    scope |= {"query_string": b"", "headers": [(b"content-length", b"5000")], "http_version": "1.1"}
    asyncio.run(app(scope | {"scheme": "http", "server": ("a", 1), "client": ("b", 2)}, receive, send))
    assert sent[0]["status"] == 429
    assert taken_before[0] == 5


def test_who_leaves_while_waiting_is_not_computed():
    limits = Limits(workers=1, waiting=5)
    go_on = threading.Event()
    done: list[str] = []

    async def scene():
        pool = WorkerPool(limits)
        stays = asyncio.Event().wait
        first = asyncio.create_task(pool.run(lambda cancellation: (go_on.wait(20), done.append("first")), stays))

        async def leaves() -> None:
            await asyncio.sleep(0.05)

        second = asyncio.create_task(pool.run(lambda cancellation: done.append("second"), leaves))
        await asyncio.sleep(0.3)
        go_on.set()
        await first
        with pytest.raises(Cancelled):
            await second
        pool.close()

    asyncio.run(scene())
    assert done == ["first"]


def test_who_leaves_while_computing_stops_it_at_its_next_step():
    async def scene():
        pool = WorkerPool(Limits(workers=1))
        started = threading.Event()

        def work(cancellation):
            started.set()
            for _ in range(2000):
                cancellation.check()
                threading.Event().wait(0.01)
            return "too late"

        async def leaves() -> None:
            while not started.is_set():
                await asyncio.sleep(0.01)

        with pytest.raises(Cancelled):
            await asyncio.wait_for(pool.run(work, leaves), 10)
        pool.close()

    asyncio.run(scene())


def test_places_are_given_back():
    async def scene():
        pool = WorkerPool(Limits(workers=1, waiting=0))
        for _ in range(3):
            async with pool.place():
                assert pool.taken == 1
                with pytest.raises(Busy):
                    async with pool.place():
                        pass
        assert pool.taken == 0
        pool.close()

    asyncio.run(scene())


@pytest.mark.ci
def test_client_that_hangs_up_costs_one_place_for_a_moment(estimator, photo):
    """Straight through ASGI: the body arrives, then the line is cut."""
    app = create_app(estimator, LIMITS)
    sent: list = []

    async def scene():
        messages = [{"type": "http.request", "body": photo}, {"type": "http.disconnect"}]

        async def receive():
            return messages.pop(0) if messages else {"type": "http.disconnect"}

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "method": "POST", "path": "/v1/estimate", "raw_path": b"/v1/estimate"}
        scope |= {"query_string": b"", "headers": [(b"host", b"localhost")], "http_version": "1.1"}
        await app(scope | {"scheme": "http", "server": ("localhost", 80), "client": None}, receive, send)

    asyncio.run(scene())
    assert sent[0]["status"] in (CLIENT_GONE, 200)  # 200 where the networks were quicker
    with TestClient(app) as client:
        assert client.get("/healthz").json()["taken"] == 0


@pytest.mark.ci
def test_export_is_a_zip_of_the_target_s_files(client, photo):
    exr = client.post("/v1/estimate?format=exr", content=photo).content
    for target in client.get("/v1/targets").json():
        answer = client.post(f"/v1/export/{target}", content=exr)
        assert answer.status_code == 200, answer.text
        names = zipfile.ZipFile(io.BytesIO(answer.content)).namelist()
        assert f"light_{target}.json" in names
    assert "three" in complaint(client.post("/v1/export/nowhere", content=exr), 422)
    complaint(client.post("/v1/export/three", content=photo), 422)
    complaint(client.post("/v1/export/three?exposure=nan", content=exr), 422)


def test_export_of_a_turned_light_says_so(client, tmp_path):
    turn = rotation_y(0.7)
    light = Light(radiance=made_map()).rotate(turn)
    for kind in ("exr", "hdr"):
        content = light.save(tmp_path / f"l.{kind}").read_bytes()
        answer = client.post("/v1/export/webxr", content=content)
        said = json.loads(zipfile.ZipFile(io.BytesIO(answer.content)).read("light_webxr.json"))
        np.testing.assert_allclose(said["world_from_camera"], turn, atol=1e-5)


def test_photo_of_any_format_becomes_an_upright_png(client, photo_rgba):
    image = Image.fromarray(photo_rgba[..., :3])
    exif = Image.Exif()
    exif[0x0112] = 6  # turned: the first row is the right side
    stream = io.BytesIO()
    image.save(stream, format="TIFF", exif=exif)
    answer = client.post("/v1/photo", content=stream.getvalue())
    picture = Image.open(io.BytesIO(answer.content))
    assert picture.size == (image.height, image.width)


def test_heic_photo_is_opened_for_browsers_that_cannot(client, photo_rgba):
    pillow_heif = pytest.importorskip("pillow_heif", reason="needs the heic extra")
    stream = io.BytesIO()
    pillow_heif.from_pillow(Image.fromarray(photo_rgba[..., :3])).save(stream, quality=95)
    answer = client.post("/v1/photo", content=stream.getvalue())
    assert answer.headers["content-type"] == "image/png"
    picture = np.asarray(Image.open(io.BytesIO(answer.content))).astype(int)
    assert np.abs(picture - photo_rgba[..., :3]).mean() < 4


@pytest.mark.ci
def test_no_answer_tells_a_path_of_the_machine(client, photo, monkeypatch, tmp_path):
    parts = {"photo": (str(tmp_path / "secret" / "sphere.png"), photo)}
    given = client.post("/v1/estimate", files=parts, params={"include": "stages,mask,radiance"}).json()
    assert given["photo"] == "sphere.png"
    assert (given["mask"]["source"], given["mask"]["media_type"]) == ("alpha", "image/png")
    assert str(tmp_path) not in json.dumps(given)

    class Fails:
        model_id = "fails"

        def from_crop(self, *arguments, **options):
            raise RuntimeError(f"cannot open {tmp_path}/secret")

    with TestClient(create_app(Fails(), LIMITS), raise_server_exceptions=False) as failing:
        answer = failing.post("/v1/estimate", content=photo)
    assert complaint(answer, 500) == "the server failed to process the request; see its log"


@pytest.mark.ci
def test_pages_of_other_origins_are_kept_out(client, estimator, photo):
    foreign = {"Origin": "https://elsewhere.example", "Sec-Fetch-Site": "cross-site"}
    complaint(client.post("/v1/estimate", content=photo, headers=foreign), 403)
    # over plain http to another machine a browser sends Origin alone
    for origin in ("http://elsewhere.example", "null"):
        complaint(client.post("/v1/estimate", content=photo, headers={"Origin": origin}), 403)
    assert client.post("/v1/estimate", content=photo, headers={"Origin": "http://testserver"}).status_code == 200
    answer = client.get("/healthz", headers={"Origin": "https://elsewhere.example"})
    assert "access-control-allow-origin" not in answer.headers
    with TestClient(create_app(estimator, LIMITS, origins=["https://elsewhere.example"])) as opened:
        answer = opened.post("/v1/estimate", content=photo, headers=foreign)
        assert answer.status_code == 200
        assert answer.headers["access-control-allow-origin"] == "https://elsewhere.example"
    with TestClient(create_app(estimator, LIMITS, origins=["https://elsewhere.example"], token="secret")) as shut:
        asking = {"Access-Control-Request-Method": "POST", "Access-Control-Request-Headers": "authorization"}
        asked = shut.options("/v1/estimate", headers={**foreign, **asking})  # as browsers do, without the token
        assert asked.status_code == 200
        assert "authorization" in asked.headers["access-control-allow-headers"].lower()
        told = {**foreign, "Authorization": "Bearer secret"}
        assert shut.post("/v1/estimate", content=photo, headers=told).status_code == 200
        complaint(shut.post("/v1/estimate", content=photo, headers=foreign), 401)


def test_foreign_names_for_this_machine_are_refused(estimator):
    with TestClient(create_app(estimator, hosts=["localhost"]), base_url="http://rebound.example") as client:
        assert client.get("/healthz").status_code == 400


def test_every_answer_lets_threads_run_and_nothing_be_embedded(client):
    for answer in (client.get("/healthz"), client.get("/nowhere"), client.post("/v1/estimate")):
        assert answer.headers["Cross-Origin-Opener-Policy"] == "same-origin"
        assert answer.headers["Cross-Origin-Embedder-Policy"] == "require-corp"
        assert answer.headers["X-Content-Type-Options"] == "nosniff"
        assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]


def test_openapi_describes_every_address(client):
    paths = client.get("/openapi.json").json()["paths"]
    assert set(paths) == {
        "/healthz",
        "/readyz",
        "/metrics",
        "/v1/estimate",
        "/v1/fuse",
        "/v1/mask",
        "/v1/photo",
        "/v1/export/{target}",
        "/v1/targets",
    }
    for address in ("/v1/estimate", "/v1/fuse"):
        assert {"200", "413", "422", "429"} <= set(paths[address]["post"]["responses"])
    fused = paths["/v1/fuse"]["post"]
    assert fused["requestBody"]["content"]["multipart/form-data"]["schema"]["required"] == ["photo", "poses"]


def test_faults_and_warnings_name_the_photo(client, photo):
    for name, data in (("broken.jpg", b"\xff\xd8\xff"), ("words.txt", b"hello")):
        answer = client.post("/v1/estimate", files={"photo": (name, data)})
        assert complaint(answer, 422).startswith(f"{name}: ")


def test_a_map_s_size_is_read_from_its_header(client):
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4000 +X 8000\n"
    complaint(client.post("/v1/export/three", content=header), 413)


@pytest.mark.parametrize("host", ["127.0.0.1", "127.0.0.2", "localhost", "::1", "[::1]"])
def test_a_loopback_is_known(host):
    assert is_loopback(host)
    assert not is_loopback({"127.0.0.1": "0.0.0.0", "::1": "::"}.get(host, "192.168.1.2"))

"""What a hostile client can do to the server: nothing that others notice for long."""

from __future__ import annotations

import asyncio
import contextlib
import io
import logging
import socket
import threading
import time

import numpy as np
import pytest
from fuzz.seeds import hidden_hdr, multipart_exr
from PIL import Image
from support.transforms import transforms

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("uvicorn", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

import uvicorn
from fastapi.testclient import TestClient

from anyprobe.cli.serve import _token
from anyprobe.errors import InputError
from anyprobe.estimate.runtime import DEFAULT_MODEL
from anyprobe.serve import tasks
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import create_app
from anyprobe.serve.door import DoorProtocol, FewLines
from anyprobe.serve.limits import Limits
from anyprobe.serve.page import Page
from anyprobe.serve.pool import Busy, WorkerPool
from anyprobe.serve.processes import Lane, TooMuchMemory, TooSlow
from anyprobe.serve.tasks import Upload


@pytest.fixture(scope="module")
def lane():
    lane = Lane(seconds=30.0, memory_mb=900)
    yield lane
    lane.close()


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


@contextlib.contextmanager
def served(app, **limits):
    """A port of this machine where the app is served by the protocol with other limits."""
    config = uvicorn.Config(app, http=type("Door", (DoorProtocol,), limits), log_level="critical", ws="none")
    server = uvicorn.Server(config)
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        while not server.started:
            time.sleep(0.01)
        try:
            yield listening.getsockname()[1]
        finally:
            server.should_exit = True
            thread.join()


async def hello(scope, receive, send):
    if scope["type"] == "lifespan":
        while True:
            message = await receive()
            await send({"type": f"{message['type']}.complete"})
            if message["type"] == "lifespan.shutdown":
                return
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"hi"})


def opened(port: int, text: bytes = b"") -> socket.socket:
    line = socket.create_connection(("127.0.0.1", port), timeout=20)
    line.sendall(text)
    return line


WHOLE = b"GET / HTTP/1.1\r\nHost: a\r\n\r\n"
HALF = WHOLE[:-2]


# Connections


@pytest.mark.ci
@pytest.mark.parametrize("first", [b"", HALF, WHOLE + HALF])
def test_a_head_that_does_not_come_closes_the_connection(first):
    with served(hello, head_s=0.2) as port, opened(port, first) as line:
        answer = b""
        while piece := line.recv(4096):
            answer += piece
        assert answer.count(b"200 OK") == (first.startswith(WHOLE))


def test_a_head_in_time_is_answered():
    with served(hello, head_s=20.0) as port, opened(port, HALF) as line:
        line.sendall(b"\r\n")
        assert b"200 OK" in line.recv(4096)


def test_one_too_many_takes_the_place_of_who_waits_longest():
    with served(hello, max_connections=5, head_s=60.0) as port:
        waiting = []
        for _ in range(5):
            waiting.append(opened(port, HALF))
            time.sleep(0.02)
        for _ in range(3):
            with opened(port, WHOLE) as line:
                assert b"200 OK" in line.recv(4096)
        assert waiting[0].recv(10) == b""
        waiting[4].sendall(b"\r\n")
        assert b"200 OK" in waiting[4].recv(4096)
        for line in waiting:
            line.close()


def test_a_client_that_does_not_read_is_let_go():
    gone = threading.Event()

    async def much(scope, receive, send):
        if scope["type"] == "lifespan":
            return await hello(scope, receive, send)
        await send({"type": "http.response.start", "status": 200, "headers": []})
        try:
            for _ in range(500):
                await send({"type": "http.response.body", "body": bytes(2**17), "more_body": True})
            while (await receive())["type"] != "http.disconnect":
                pass
        finally:
            gone.set()

    with served(much, read_s=0.3) as port, opened(port, WHOLE):
        assert gone.wait(20)


def test_a_log_has_an_end():
    few, record = FewLines(max_lines=3), logging.LogRecord("a", 30, "", 0, "line", (), None)
    assert [few.filter(record) for _ in range(5)] == [True, True, True, False, False]
    few._since -= 60
    assert few.filter(record)
    assert record.getMessage() == "(2 lines left out) line"


# Bodies


def drip(app, *, first: bytes = b"x", headers=()) -> int:
    """The status for a body whose first bytes come, and nothing after them."""
    sent = []

    async def scene():
        pieces = [{"type": "http.request", "body": first, "more_body": True}]

        async def receive():
            if pieces:
                return pieces.pop()
            await asyncio.sleep(60)

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "method": "POST", "path": "/v1/photo", "raw_path": b"/v1/photo"}
        scope |= {"query_string": b"", "headers": [(b"host", b"a"), *headers], "http_version": "1.1"}
        await app(scope | {"scheme": "http", "server": ("a", 1), "client": ("b", 2)}, receive, send)

    asyncio.run(asyncio.wait_for(scene(), 20))
    return sent[0]["status"]


def test_a_body_that_drips_is_refused_soon(estimator):
    assert drip(create_app(estimator, Limits(grace_s=0.1))) == 408


def test_slow_senders_give_their_places_to_others():
    limits = Limits(workers=1, waiting=1, grace_s=0.2, upload_s=30.0)

    async def scene():
        pool = WorkerPool(limits)
        ended = []

        async def slow(rate: int) -> None:
            try:
                async with pool.place(), pool.upload(lambda: rate):
                    await asyncio.sleep(20)
            except Exception as error:
                ended.append((rate, error.status_code))

        senders = [asyncio.create_task(slow(rate)) for rate in (10, 10_000_000)]
        await asyncio.sleep(0)
        with pytest.raises(Busy):  # they have only begun
            async with pool.place():
                pass
        await asyncio.sleep(0.2)
        async with pool.place():
            assert ended == [(10, 408)]
        for sender in senders:
            sender.cancel()
        pool.close()

    asyncio.run(scene())


# Decoding


def black(side: int) -> bytes:
    """A PNG of few bytes and many pixels."""
    stream = io.BytesIO()
    Image.new("RGB", (side, side)).save(stream, format="PNG")
    return stream.getvalue()


@pytest.mark.ci
def test_what_takes_too_long_is_ended_and_the_next_is_served(photo):
    lane = Lane(seconds=0.5, memory_mb=2000)
    with pytest.raises(TooSlow, match="seconds"):
        lane.call(tasks.upright, Upload(photo=black(7000)), 10**9)
    assert lane.call(tasks.mask, Upload(photo=photo), 10**9, True)["source"] == "alpha"
    lane.close()


@pytest.mark.ci
def test_what_takes_too_much_memory_is_refused_and_the_next_is_served(photo):
    lane = Lane(seconds=30.0, memory_mb=300)
    with pytest.raises(TooMuchMemory):
        lane.call(tasks.upright, Upload(photo=black(6000)), 10**9)
    assert lane.call(tasks.mask, Upload(photo=photo), 10**9, True)["source"] == "alpha"
    lane.close()


def test_errors_come_back_as_they_are(lane):
    with pytest.raises(InputError) as caught:
        lane.call(tasks.mask, Upload(photo=b"no picture", name="p.png"), 10**9, True)
    assert str(caught.value).startswith("p.png: expected an image")
    with pytest.raises(RuntimeError, match="decoding process"):
        lane.call(tasks.mask, None, 10**9, True)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("address", "body"),
    [("photo", multipart_exr(64, 9000)), ("export/cube", hidden_hdr(8192, 16384)), ("photo", hidden_hdr(8192, 16384))],
    ids=["exr", "map", "hdr"],
)
def test_bombs_are_refused_by_what_they_would_be_decoded_to(estimator, address, body):
    with TestClient(create_app(estimator)) as client:
        answer = client.post(f"/v1/{address}", content=body)
        assert (answer.status_code, "pixels" in answer.json()["detail"]) == (413, True)


@pytest.mark.ci
def test_a_plain_photo_does_not_wait_behind_slow_files(estimator, photo, monkeypatch):
    go_on, started, real = threading.Event(), threading.Event(), Lane.call

    def call(self, task):
        if task.args[0].photo.startswith(b"#?"):
            started.set()
            go_on.wait(60)
        return real(self, task)

    monkeypatch.setattr(Lane, "call", call)
    with TestClient(create_app(estimator, Limits(workers=2))) as client:
        slow = [threading.Thread(target=client.post, args=("/v1/photo",), kwargs={"content": b"#?x"}) for _ in "abcd"]
        for thread in slow:
            thread.start()
        assert started.wait(30)
        assert client.post("/v1/photo", content=photo).status_code == 200
        assert not go_on.is_set()
        go_on.set()
        for thread in slow:
            thread.join()


# Names, tokens, methods, parts


@pytest.mark.ci
def test_a_token_is_asked_for_by_all_but_the_health(estimator, photo):
    with TestClient(create_app(estimator, token="secret-secret"), base_url="https://testserver") as client:
        assert client.get("/healthz").status_code == 200
        for headers in ({}, {"Authorization": "Bearer other"}, {"Authorization": "secret-secret"}):
            answer = client.post("/v1/photo", content=photo, headers=headers)
            assert answer.status_code == 401
            assert "secret" not in answer.text
        good = {"Authorization": "Bearer secret-secret"}
        assert client.post("/v1/photo", content=photo, headers=good).status_code == 200
        assert client.get("/v1/targets").status_code == 401
        answer = client.get("/v1/targets?token=secret-secret", follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (303, "/v1/targets")
        assert {"HttpOnly", "SameSite=strict", "Secure"} <= set(answer.headers["set-cookie"].split("; "))
        assert client.get("/v1/targets").status_code == 200  # the cookie


def test_a_token_is_made_where_other_machines_come_in():
    assert _token(None, True) is None
    assert len(_token(None, False)) >= 16
    assert _token(None, False) != _token(None, False)
    assert _token("none", False) is None
    assert _token("long enough".replace(" ", "-"), True) == "long-enough"
    for bad in ("short", "with space in", "é" * 20, ""):
        with pytest.raises(InputError) as caught:
            _token(bad, True)
        assert caught.value.subject == ("token",)


@pytest.mark.parametrize(
    ("host", "status"),
    [("192.168.1.7:8000", 200), ("[fe80::1]:8000", 200), ("probe.lan", 200), ("PROBE.lan:1", 200), ("other.lan", 400)],
)
def test_beyond_the_loopback_addresses_and_own_names_are_let_in(estimator, host, status):
    with TestClient(create_app(estimator, hosts=["probe.lan"], addresses=True)) as client:
        assert client.get("/healthz", headers={"Host": host}).status_code == status


def test_head_is_answered_without_a_body(estimator):
    with TestClient(create_app(estimator, page=Page(estimator, DEFAULT_MODEL))) as client:
        for path in ("/", "/healthz", "/v1/targets"):
            head, get = client.head(path), client.get(path)
            assert (head.status_code, head.content) == (200, b"")
            assert head.headers["content-length"] == get.headers["content-length"]
        assert client.head("/v1/estimate").status_code == 405


@pytest.mark.parametrize(("address", "twice"), [("estimate", "photo"), ("estimate", "mask"), ("fuse", "poses")])
def test_a_part_that_counts_once_is_not_taken_twice(estimator, photo, address, twice):
    parts = [("photo", ("a.png", photo)), ("mask", ("m.png", photo))]
    parts += [("poses", ("p.json", transforms([np.eye(3)], ["p.png"]).encode()))] if address == "fuse" else []
    parts += [one for one in parts if one[0] == twice]
    with TestClient(create_app(estimator)) as client:
        answer = client.post(f"/v1/{address}", files=parts)
        assert answer.status_code == 422
        assert f"{twice}: expected one part of this name, got 2" in answer.json()["detail"]

"""A server in operation: readiness, metrics, a bounded log, an end in time, names and addresses of its own."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request

import pytest

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("uvicorn", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient

from anyprobe.files import cores
from anyprobe.serve import processes
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import create_app
from anyprobe.serve.door import bound_log
from anyprobe.serve.limits import LINES_PER_MINUTE, Limits
from anyprobe.serve.pool import Ending, WorkerPool


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


# Readiness


@pytest.mark.ci
def test_it_is_alive_from_the_start_and_ready_once_its_processes_are(estimator, monkeypatch):
    go_on, real = threading.Event(), processes._Worker._await_ready

    def later(self):
        go_on.wait(30)
        real(self)

    monkeypatch.setattr(processes._Worker, "_await_ready", later)
    app = create_app(estimator, token="secret-secret")
    with TestClient(app) as client:
        app.state.pool.warm()
        assert client.get("/healthz").status_code == 200
        answer = client.get("/readyz")
        assert (answer.status_code, "start" in answer.json()["detail"]) == (503, True)
        assert answer.headers["Retry-After"]
        go_on.set()
        end = time.monotonic() + 60
        while client.get("/readyz").status_code != 200 and time.monotonic() < end:
            time.sleep(0.1)
        assert client.get("/readyz").json() == {"status": "ready"}
        app.state.pool.taken = 10**6
        assert "taken" in client.get("/readyz").json()["detail"]
        assert client.get("/healthz").status_code == 200
        app.state.pool.taken = 0


@pytest.mark.ci
def test_what_cannot_start_is_not_ready_and_tries_again(estimator, monkeypatch):
    name = processes.__name__
    monkeypatch.setattr(processes, "__name__", "anyprobe.no_such_module")
    app = create_app(estimator)
    with TestClient(app) as client:
        app.state.pool.warm()
        end = time.monotonic() + 60
        while "log" not in (said := client.get("/readyz").json()).get("detail", "") and time.monotonic() < end:
            time.sleep(0.1)
        assert "cannot be started" in said["detail"]
        monkeypatch.setattr(processes, "__name__", name)
        while (status := client.get("/readyz").status_code) != 200 and time.monotonic() < end + 60:
            time.sleep(0.1)
        assert status == 200


# Metrics


@pytest.mark.ci
def test_metrics_count_requests_by_route_and_status_their_seconds_and_the_queue(estimator, photo):
    pytest.importorskip("prometheus_client", reason="needs the serve extra")
    from prometheus_client.parser import text_string_to_metric_families

    with TestClient(create_app(estimator, Limits(workers=1, waiting=6), token="secret-secret")) as client:
        assert client.get("/metrics").status_code == 401
        client.headers["Authorization"] = "Bearer secret-secret"
        for _ in range(2):
            assert client.post("/v1/mask", content=photo).status_code == 200
        client.post("/v1/export/three", content=b"no map")
        client.get("/a-word-of-the-clients")
        answer = client.get("/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    found = {
        (one.name, *(value for key, value in sorted(one.labels.items()) if key != "le")): one.value
        for family in text_string_to_metric_families(answer.text)
        for one in family.samples
    }
    assert found["anyprobe_requests_total", "/v1/mask", "200"] == 2
    assert found["anyprobe_requests_total", "/v1/export/{target}", "422"] == 1
    assert found["anyprobe_requests_total", "other", "401"] == 1
    assert found["anyprobe_request_seconds_count", "/v1/mask"] == 2
    assert found["anyprobe_request_seconds_sum", "/v1/mask"] > 0
    assert found["anyprobe_places",] == 7
    assert found["anyprobe_places_taken",] == 0
    assert "a-word-of" not in answer.text


@pytest.mark.ci
def test_without_the_library_all_else_works(estimator, photo, monkeypatch):
    monkeypatch.setitem(sys.modules, "prometheus_client", None)
    with TestClient(create_app(estimator)) as client:
        assert client.post("/v1/mask", content=photo).status_code == 200
        answer = client.get("/metrics")
        assert (answer.status_code, "prometheus-client" in answer.json()["detail"]) == (501, True)


# The log


def test_no_client_can_make_any_library_write_without_end(estimator, capsys, monkeypatch):
    before = list(logging.getLogger().handlers)
    bound_log()
    bound_log()
    try:
        with TestClient(create_app(estimator)) as client:
            headers = {"Content-Type": "multipart/form-data; boundary=a"}
            for _ in range(LINES_PER_MINUTE + 40):
                assert client.post("/v1/mask", content=b"--b\r\n\r\n", headers=headers).status_code in (400, 422)
        for name in ("PIL.Image", "h11", "trimesh", "asyncio", "uvicorn.error", "anyprobe.serve", "of.any.other"):
            for _ in range(LINES_PER_MINUTE):
                logging.getLogger(name).warning("a line of a library")
    finally:
        logging.getLogger().handlers[:] = before
    written = capsys.readouterr().err
    assert 0 < len(written.splitlines()) <= LINES_PER_MINUTE


# The end


def test_what_has_begun_is_answered_and_the_rest_is_told_in_time():
    async def scene():
        pool = WorkerPool(Limits(workers=1, waiting=5, drain_s=0.5))
        go_on = threading.Event()

        async def never():
            await asyncio.sleep(60)

        async def asked(work):
            async with pool.place():
                return await pool.run(work, never)

        quick = asyncio.ensure_future(asked(lambda _: time.sleep(0.1) or "answer"))
        slow = asyncio.ensure_future(asked(lambda _: go_on.wait(20)))
        waiting = asyncio.ensure_future(asked(lambda _: "never"))
        await asyncio.sleep(0.02)
        start = time.monotonic()
        pool.drain()
        with pytest.raises(Ending):
            async with pool.place():
                pass
        assert "shutting down" in pool.unready()
        assert await quick == "answer"
        for one in (slow, waiting):
            with pytest.raises(Ending):
                await one
        pool.close()
        assert time.monotonic() - start < 5
        go_on.set()

    asyncio.run(scene())


@pytest.mark.ci
@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
def test_sigterm_ends_a_busy_server_in_time_and_every_request_is_answered(tmp_path, photo, photo_rgba):
    """In a folder that holds modules of Python's names, and without a home."""
    for name in ("random", "queue", "types", "numpy", "PIL"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit\n")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    start = "import sys; sys.path = [one for one in sys.path if one]; from anyprobe_command import main; main()"
    order = [sys.executable, "-P", "-c", start, "serve", "--port", str(port), "--workers", "1", "--drain", "1"]
    environment = {name: value for name, value in os.environ.items() if name not in ("HOME", "ANYPROBE_TOKEN")}
    server = subprocess.Popen(order, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    base, statuses = f"http://127.0.0.1:{port}", []
    slow = as_png(photo_rgba[..., :3])  # its object is to be found: a second of the processor

    def ask(address: str, data: bytes | None = None) -> int:
        try:
            with urllib.request.urlopen(f"{base}{address}", data, timeout=60) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code

    try:
        end = time.monotonic() + 120
        while time.monotonic() < end:
            try:
                if ask("/readyz") == 200:
                    break
            except OSError:
                time.sleep(0.1)
        assert ask("/v1/estimate", photo) == 200
        threads = [threading.Thread(target=lambda: statuses.append(ask("/v1/estimate", slow))) for _ in range(12)]
        for thread in threads:
            thread.start()
        time.sleep(0.3)
        told = time.monotonic()
        server.send_signal(signal.SIGTERM)
        for thread in threads:
            thread.join(60)
        server.wait(60)
        took = time.monotonic() - told
    finally:
        server.kill()
        _, said = server.communicate()
    assert len(statuses) == 12
    assert set(statuses) <= {200, 503}
    assert 503 in statuses  # else there was no more to do than in that time
    assert took < 12
    assert "Traceback" not in said


# Names and addresses


@pytest.mark.parametrize(
    "host",
    [
        "127.0.0.1:80@evil.example",
        "user@127.0.0.1",
        "127.0.0.1@evil.example",
        "[::1]evil.example",
        "[::1]@evil.example",
        "localhost/evil",
        "localhost:80:80",
        "localhost:x",
        "localhost, evil.example",
        "localhost?x",
        "localhost#x",
        "localhost\\evil",
        "",
    ],
)
def test_a_host_that_is_more_than_a_name_and_a_port_is_refused(estimator, host):
    with TestClient(create_app(estimator, hosts=["localhost", "127.0.0.1", "[::1]"], addresses=True)) as client:
        assert client.get("/healthz", headers={"Host": host}).status_code == 400
        for good in ("localhost", "localhost:8000", "LOCALHOST:1", "[::1]:80", "127.0.0.1", "10.0.0.7:8000"):
            assert client.get("/healthz", headers={"Host": good}).status_code == 200


@pytest.mark.parametrize(
    "path", ["//evil.example/x", "///evil.example", "/\\evil.example", "//evil.example@a/", "/\t/evil"]
)
def test_the_token_leads_nowhere_else(estimator, path):
    app, sent = create_app(estimator, token="secret-secret"), []

    async def scene():
        async def receive():
            return {"type": "http.request", "body": b"", "more_body": False}

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "method": "GET", "path": path, "raw_path": path.encode(), "scheme": "http"}
        more = {
            "query_string": b"token=secret-secret",
            "headers": [(b"host", b"a.example")],
            "server": ("a.example", 80),
        }
        await app({**scope, **more, "root_path": "", "http_version": "1.1"}, receive, send)

    asyncio.run(scene())
    headers = dict(sent[0]["headers"])
    assert sent[0]["status"] == 303
    assert re.fullmatch(rb"/(?![/\\\t]).*", headers[b"location"]), headers[b"location"]


# Cores


@pytest.mark.parametrize(("said", "count"), [("max 100000", 8), ("150000 100000", 2), ("50000 100000", 1), ("", 8)])
def test_a_containers_share_of_the_cores_counts(tmp_path, monkeypatch, said, count):
    (tmp_path / "cpu.max").write_text(said)
    monkeypatch.setattr(cores, "QUOTA", tmp_path / "cpu.max")
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(8), raising=False)
    assert cores.usable_cores() == count

"""Decoding processes: what the working folder holds never runs in them, and one that ends is replaced."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

pytest.importorskip("fastapi", reason="needs the serve extra")
pytest.importorskip("python_multipart", reason="needs the serve extra")

from fastapi.testclient import TestClient
from support.lane_work import end_itself, out_of_memory, take

from anyprobe.masks import weights
from anyprobe.serve import processes, tasks
from anyprobe.serve.answers import png as as_png
from anyprobe.serve.api import create_app
from anyprobe.serve.processes import Lane, TooMuchMemory, WorkerLost
from anyprobe.serve.tasks import Upload

pytestmark = pytest.mark.ci  # a process takes a second to start


@pytest.fixture
def photo(photo_rgba) -> bytes:
    return as_png(photo_rgba)


@pytest.fixture
def lane():
    lane = Lane(seconds=30.0, memory_mb=900)
    yield lane
    lane.close()


def source(lane, photo) -> str:
    return lane.call(tasks.mask, Upload(photo=photo), 10**9, True)["source"]


def test_a_network_that_lacks_memory_is_told_as_any_other_work(lane):
    with pytest.raises(TooMuchMemory, match="fits in memory"):
        lane.call(out_of_memory)


MODULES = (
    "random queue types numpy PIL pickle signal threading logging onnxruntime anyprobe socket sitecustomize".split()
)


def test_a_module_in_the_working_folder_is_not_taken_for_pythons(lane, photo, work):
    for name in MODULES:
        (work / f"{name}.py").write_text(f"open({str(work / 'ran')!r}, 'w').close(); raise SystemExit\n")
    assert source(lane, photo) == "alpha"
    assert not (work / "ran").exists()


def test_nor_is_one_that_the_path_of_imports_leads_to(lane, photo, work, monkeypatch):
    (work / "queue.py").write_text("raise SystemExit\n")
    for given in ("", ".", work, work / ".." / work.name):
        monkeypatch.syspath_prepend(str(given))
    assert source(lane, photo) == "alpha"


def test_children_of_pools_take_no_modules_from_there_either(work):
    """spawn imports pickle and socket before it hears of the parent's path."""
    from anyprobe.files.cores import one_thread

    for name in ("pickle", "socket", "numpy"):
        (work / f"{name}.py").write_text("raise SystemExit(9)\n")
    order = [sys.executable, "-c", "import pickle, socket"]
    assert subprocess.run(order, check=False).returncode == 9
    with one_thread():
        assert subprocess.run(order, check=False).returncode == 0


def test_one_that_cannot_start_is_500_and_its_reason_is_logged(estimator, photo, monkeypatch, caplog):
    monkeypatch.setattr(processes, "__name__", "anyprobe.no_such_module")
    with TestClient(create_app(estimator)) as client, caplog.at_level(logging.ERROR):
        answer = client.post("/v1/estimate", content=photo)
    assert answer.status_code == 500
    assert "log" in answer.json()["detail"]
    assert "No module named 'anyprobe.no_such_module'" in caplog.text


def test_a_machine_without_room_for_another_process_is_500(estimator, photo, monkeypatch):
    def full(*_, **__):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr(processes.subprocess, "Popen", full)
    with TestClient(create_app(estimator)) as client:
        assert client.post("/v1/estimate", content=photo).status_code == 500


def test_one_that_was_ended_while_it_waited_is_replaced(lane, photo):
    assert source(lane, photo) == "alpha"
    (worker,) = lane._idle
    worker._process.kill()
    assert source(lane, photo) == "alpha"
    (worker,) = lane._idle
    worker._process.kill()
    worker._process.wait(5)
    assert source(lane, photo) == "alpha"


@pytest.mark.skipif(os.name == "nt", reason="needs POSIX signals")
@pytest.mark.parametrize(("number", "fault"), [("SIGKILL", WorkerLost), ("SIGSEGV", TooMuchMemory)])
def test_work_whose_process_ended_is_done_once_more(lane, tmp_path, number, fault):
    ended_by = getattr(signal, number)
    assert lane.call(end_itself, str(tmp_path / "flag"), ended_by, 1) == "done"
    with pytest.raises(fault):
        lane.call(end_itself, str(tmp_path / "other"), ended_by, 2)


@pytest.mark.parametrize(
    ("status", "fault"), [(-15, WorkerLost), (-2, WorkerLost), (-6, TooMuchMemory), (3, TooMuchMemory)]
)
def test_a_signal_that_files_do_not_cause_is_no_fault_of_the_file(lane, monkeypatch, status, fault):
    """SIGTERM and SIGINT; SIGABRT, and an exit, are what libraries do."""

    def ended(task):
        raise processes._Ended(status)

    monkeypatch.setattr(lane, "_do", ended)
    with pytest.raises(fault):
        lane.call(out_of_memory)


def test_a_worker_killed_at_work_costs_no_photo(estimator, photo, monkeypatch):
    """Every process is ended a moment after its first photo came; all are answered."""
    killed, call = [], processes._Worker.call

    def ended_meanwhile(self, message, seconds):
        if len(killed) < 3 and self not in killed and len(killed) % 2 == 0:
            killed.append(self)
            self._process.kill()
        elif len(killed) % 2:
            killed.append(None)
        return call(self, message, seconds)

    monkeypatch.setattr(processes._Worker, "call", ended_meanwhile)
    with TestClient(create_app(estimator)) as client:
        assert [client.post("/v1/mask", content=photo).status_code for _ in range(4)] == [200] * 4
    assert len([one for one in killed if one]) == 2


def test_one_that_works_as_far_as_others_let_it_is_waited_for_and_one_that_sleeps_is_not(monkeypatch):
    monkeypatch.setattr(processes, "START_S", 0.5)
    monkeypatch.setattr(processes, "STARVED_S", 0.01)
    lane = Lane(seconds=0.5, memory_mb=900)
    try:
        if os.path.exists("/proc/self/stat"):
            assert lane.call(take, 0.3, 0.2) == "done"
        start = time.monotonic()
        with pytest.raises(processes.TooSlow):
            lane.call(take, 0.1, 30)
        assert time.monotonic() - start < 25
    finally:
        lane.close()


@pytest.mark.skipif(weights.find_weights() is None, reason="needs U2-Net-p: anyprobe mask --fetch")
def test_one_that_found_an_object_is_kept(lane, photo_rgba):
    """The network's memory is given back: a start of a process costs more than a photo."""
    plain = as_png(photo_rgba[..., :3])
    for _ in range(2):
        assert source(lane, plain) == "network"
    (worker,) = lane._idle
    assert worker.is_alive()


def test_a_closed_lane_leaves_no_process(photo):
    lane = Lane(seconds=30.0, memory_mb=900)
    threads = [threading.Thread(target=source, args=(lane, photo)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    ended = [worker._process for worker in lane._idle]
    lane.close()
    time.sleep(0.1)
    assert all(process.poll() is not None for process in ended)

"""Short of memory, threads or a terminal; closed inputs; loops of links; faults that nobody foresaw: one line each."""

from __future__ import annotations

import errno
import json
import sys
import threading

import pytest
from support.two_phase import two_phase

from anyprobe.cli import app
from anyprobe.errors import MissingExtra
from anyprobe.estimate.estimator import Estimator
from anyprobe.estimate.result import Light
from anyprobe.estimate.sidecar import Origin


@pytest.fixture
def failing(monkeypatch, photo_path, networks_opened_once):
    """Makes an estimate raise this."""

    def fail(error: BaseException) -> None:
        def raises(*_, **__):
            raise error

        monkeypatch.setattr(Estimator, "from_extract", raises)

    return fail


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (MemoryError(), 2, "memory"),
        (OSError(errno.EMFILE, "Too many open files"), 2, "Too many open files"),
        (TypeError("open() got an\nunexpected keyword"), 1, "TypeError at session.py"),
        (RecursionError("maximum recursion depth exceeded"), 1, "RecursionError"),
        (AssertionError(), 1, "no message"),
    ],
)
def test_what_a_command_cannot_get_or_did_not_foresee_is_one_line(
    command, work, photo_path, failing, error, status, words
):
    failing(error)
    outcome = command("estimate", photo_path)
    assert outcome.status == status
    (line,) = outcome.err.splitlines()
    assert line.startswith("anyprobe: ")
    assert words in line
    assert outcome.out == ""


def test_an_error_in_the_loop_leaves_no_thread(work, photo_path, failing, monkeypatch):
    """Python 3.13.0 waits for it for ever."""
    error = ZeroDivisionError("kept, with its frames, as a traceback is")
    failing(error)
    before = set(threading.enumerate())
    monkeypatch.setenv(app.TRACEBACK, "1")
    monkeypatch.setattr(sys, "argv", ["anyprobe", "estimate", str(photo_path), str(photo_path.parent)])
    with pytest.raises(ZeroDivisionError) as kept:
        app.main()
    assert kept.value is error
    assert set(threading.enumerate()) <= before


def test_a_package_that_is_there_but_cannot_be_loaded_is_not_called_absent():
    text = "av.so: failed to map segment\nfrom shared object"
    assert "cannot be loaded (av.so: failed to map segment from" in str(
        MissingExtra("av", "video", "it", ImportError(text))
    )
    absent = str(MissingExtra("av", "video", "it", ModuleNotFoundError("No module named 'av'")))
    assert absent == str(MissingExtra("av", "video", "it"))


# Inputs


@pytest.mark.ci
@pytest.mark.parametrize("order", ["estimate -", "mask -", "relight - --insert sphere"])
def test_a_closed_input_is_one_line(command, order, work, monkeypatch):
    monkeypatch.setattr(sys, "stdin", None)  # which is what Python makes of it
    assert "closed standard input" in command(*order.split()).complaint


# Sidecars


@pytest.fixture
def saved(tmp_path):
    light = Light(radiance=two_phase(16), origin=Origin(photo="kept.jpg"))
    path = light.save(tmp_path / "light.exr")
    light.save(tmp_path / "light.json")
    return path


@pytest.mark.parametrize("said", [[1, 2], {"name": "of another program"}, "text", None])
def test_a_json_of_another_program_is_left_alone(saved, said):
    saved.with_suffix(".json").write_text(json.dumps(said), encoding="utf-8")
    assert "photo" not in Light.load(saved).info

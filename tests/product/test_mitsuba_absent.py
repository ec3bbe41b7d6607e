"""Where Mitsuba cannot run: found out once."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from support.refused import refused

from anyprobe.relight import path_traced
from anyprobe.relight.insert import uses_mitsuba


@pytest.fixture
def tries(monkeypatch):
    """The processes that were started to try Mitsuba, all in vain."""
    started = []

    def run(command, **_):
        started.append(command)
        return SimpleNamespace(returncode=1)

    cached = path_traced.open_mitsuba, path_traced.mitsuba_runs
    for one in cached:
        one.cache_clear()
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    monkeypatch.setattr(path_traced, "glob", lambda _: [])
    monkeypatch.setattr(path_traced.subprocess, "run", run)
    yield started
    for one in cached:
        one.cache_clear()


def test_mitsuba_that_is_absent_is_tried_once(tries):
    assert [uses_mitsuba("auto") for _ in range(3)] == [False] * 3
    for _ in range(2):
        with refused(code="unsupported", naming="mitsuba"):
            uses_mitsuba("mitsuba")
    assert len(tries) == 1


def test_an_llvm_that_is_too_old_is_not_tried(tries, monkeypatch):
    """A trial of one line passes with it; the first scene ends the process."""
    monkeypatch.setattr(path_traced, "glob", lambda _: ["/usr/lib/x86_64-linux-gnu/libLLVM-15.so"])
    assert not uses_mitsuba("auto")
    assert tries == []

"""Processes that decode what strangers send: bounded in memory and time, and replaced when they are used up.

A damaged or hostile file may take a process down, not the server. They bound what a file can take; they are no sandbox:
they run as the same user and may open what it may.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import traceback
import weakref
from collections.abc import Callable
from functools import partial
from typing import IO, Any, ParamSpec, TypeVar

from anyprobe.errors import AnyprobeError, InputError

Given = ParamSpec("Given")
Answer = TypeVar("Answer")

log = logging.getLogger("anyprobe.serve")

USED_UP_MB = 400
"""Memory that a process may hold between two pieces of work; above, it is replaced."""

WALL_FACTOR, START_S = 3.0, 10.0
"""Wall clock for a piece of work: times the processor's seconds, as others want the processor too, and for imports."""

SIGXCPU = getattr(signal, "SIGXCPU", -1)

MAX_CALLS = 500
"""Pieces of work after which it is replaced too: libraries leak."""


class TooSlow(InputError):
    """Decoding took longer than it may."""


class TooMuchMemory(InputError):
    """Decoding took more memory than it may, or ended the process."""


class Lane:
    """Processes of one kind, started when they are needed; each does one piece of work at a time."""

    def __init__(self, *, seconds: float, memory_mb: int, niceness: int = 0) -> None:
        """seconds: of the processor, for a piece of work; memory_mb: beyond what an idle process has."""
        self._seconds, self._memory_mb, self._niceness = seconds, memory_mb, niceness
        self._idle: list[_Worker] = []
        self._lock = threading.Lock()
        self._closed = False
        weakref.finalize(self, _end_all, self._idle)

    def call(self, work: Callable[Given, Answer], *given: Given.args, **named: Given.kwargs) -> Answer:
        """What a function of a module, as those of serve.tasks, returns there; blocks until then.

        Raises:
            AnyprobeError: as the function does. TooSlow, TooMuchMemory: it was ended.
        """
        with self._lock:
            worker = self._idle.pop() if self._idle else None
        worker = worker or _Worker(self._memory_mb, self._niceness)
        try:
            answer = worker.call((partial(work, *given, **named), self._seconds), self._seconds)
        except BaseException:
            worker.end()
            raise
        with self._lock:
            keep = not self._closed and answer.pop("keep")
            if keep:
                self._idle.append(worker)
        if not keep:
            worker.end()
        return _outcome(answer)

    def close(self) -> None:
        with self._lock:
            self._closed = True
            _end_all(self._idle)


def _end_all(workers: list[_Worker]) -> None:
    while workers:
        workers.pop().end()


class _Worker:
    """One process, and the pipes to it."""

    def __init__(self, memory_mb: int, niceness: int) -> None:
        path = os.pathsep.join(folder for folder in sys.path if folder)
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL")}
        self._process = subprocess.Popen(
            [sys.executable, "-c", f"from {__name__} import work; work({memory_mb}, {niceness})"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={**os.environ, **threads, "PYTHONPATH": path},
        )
        assert self._process.stdin is not None  # as PIPE asks
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin, self._process.stdout

    def call(self, message: Any, seconds: float) -> dict[str, Any]:
        late = threading.Event()

        def end() -> None:
            late.set()
            self._process.kill()

        timer = threading.Timer(WALL_FACTOR * seconds + START_S, end)
        timer.start()
        try:
            _send(self._questions, message)
            return pickle.load(self._answers)
        except (OSError, EOFError, pickle.UnpicklingError) as error:
            if late.is_set() or self._process.wait(5) == -SIGXCPU:
                raise TooSlow(
                    f"expected a file that is decoded within {seconds:g} seconds, got a slower one; "
                    "send it smaller, or as PNG or JPEG"
                ) from error
            raise TooMuchMemory(
                "expected a file that can be decoded here, got one that takes too much; "
                "send it smaller, or as PNG or JPEG"
            ) from error
        finally:
            timer.cancel()

    def end(self) -> None:
        self._process.kill()
        self._process.wait(5)
        for pipe in (self._questions, self._answers):
            with contextlib.suppress(OSError):
                pipe.close()


def _outcome(answer: dict[str, Any]) -> Any:
    """The result, or the error raised again."""
    if "result" in answer:
        return answer["result"]
    if "fault" in answer:
        raise RuntimeError(f"in a decoding process: {answer['fault']}")
    raise answer["error"]


def _send(pipe: IO[bytes], message: Any) -> None:
    pickle.dump(message, pipe, pickle.HIGHEST_PROTOCOL)
    pipe.flush()


# In the process itself


def work(memory_mb: int, niceness: int) -> None:
    """Do pieces of work until there are no more: the process's main function."""
    given, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nowhere = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1, 2):  # C libraries print
        os.dup2(nowhere, number)
    from anyprobe.serve import tasks

    with contextlib.suppress(AttributeError, OSError):
        os.nice(niceness)
    tasks.ready()
    _bound_memory(memory_mb)
    for count in range(1, MAX_CALLS + 1):
        try:
            task, seconds = pickle.load(given)
        except EOFError:
            return
        _bound_time(seconds)
        answer = _answer(task)
        del task
        _send(answers, answer | {"keep": count < MAX_CALLS and _held_mb() < USED_UP_MB})


def _answer(task: Callable[[], Any]) -> dict[str, Any]:
    try:
        return {"result": task()}
    except MemoryError:
        text = "expected a file that fits in memory when decoded, got a larger one; send it smaller"
        return {"error": TooMuchMemory(text)}
    except AnyprobeError as error:
        return {"error": TooMuchMemory(error) if isinstance(error.__cause__, MemoryError) else error}
    except Exception:
        return {"fault": traceback.format_exc(limit=8)}


def _bound_memory(memory_mb: int) -> None:
    """No more than it has now and so much besides; where the system has no such limit, time alone bounds it."""
    try:
        import resource

        with open("/proc/self/statm", encoding="ascii") as stream:
            now = int(stream.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (now + memory_mb * 2**20,) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        log.debug("no limit of memory")


def _bound_time(seconds: float) -> None:
    """The processor's time for one piece of work, should the wall clock's guard be gone."""
    try:
        import resource

        limit = int(time.process_time() + seconds) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.getrlimit(resource.RLIMIT_CPU)[1]))
    except (ImportError, OSError, ValueError):
        log.debug("no limit of time")


def _held_mb() -> float:
    try:
        import resource

        with open("/proc/self/statm", encoding="ascii") as stream:
            return int(stream.read().split()[1]) * resource.getpagesize() / 2**20
    except (ImportError, OSError):
        return 0.0

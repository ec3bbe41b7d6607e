"""Processes that decode untrusted files: limited in memory and time, and replaced when they are used up.

A damaged or hostile file may end a process, but not the server. The limits bound what a file can use; they are no
sandbox: the processes run as the same user and may open the same files.
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
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import IO, Any, ParamSpec, TypeVar

from anyprobe.errors import AnyprobeError, InputError
from anyprobe.files.cores import CHILD_ENVIRONMENT

Given = ParamSpec("Given")
Answer = TypeVar("Answer")

log = logging.getLogger("anyprobe.serve")

MAX_IDLE_MB = 400
"""Memory above which a process is replaced between two pieces of work [MiB]."""

WALL_FACTOR, START_S = 3.0, 10.0
"""Wall-clock limit of a piece of work: a factor on its processor seconds, as others want the processor too, and a
constant for imports [s]."""

STARVED_TIMES, STARVED_S = 20, 0.05
"""How often a starved process's time limit is extended, and the processor time that it must use in each extension
[s]."""

IMPORTS_S = 60.0
"""Wall-clock limit for the start of a process [s]; it takes about one second on an idle processor."""

SIGXCPU, SIGKILL = getattr(signal, "SIGXCPU", -1), getattr(signal, "SIGKILL", 9)
"""Numbers of the signals, also on systems that lack them."""

READY = "ready"
"""Message that a process sends once its imports are done."""

MAX_CALLS = 500
"""Pieces of work after which a process is replaced: libraries leak."""


class TooSlow(InputError):
    """Decoding exceeded its time limit."""


class TooMuchMemory(InputError):
    """Decoding exceeded its memory limit, or ended the process."""


class WorkerLost(AnyprobeError):
    """A process could not be started, or was ended from outside twice."""


class Lane:
    """Processes of one kind, started on demand, each doing one piece of work at a time."""

    def __init__(self, *, seconds: float, memory_mb: int, niceness: int = 0) -> None:
        """Set the limits: seconds of processor time for a piece of work, memory_mb beyond an idle process's own."""
        self._seconds, self._memory_mb, self._niceness = seconds, memory_mb, niceness
        self._idle: list[_Worker] = []
        self._busy: list[_Worker] = []
        self._lock = threading.Lock()
        self._closed = False
        weakref.finalize(self, _end_all, self._idle)

    def call(self, work: Callable[Given, Answer], *args: Given.args, **kwargs: Given.kwargs) -> Answer:
        """Run a module-level function, such as one of serve.tasks, in a process and return its result; blocks.

        A process that ends meanwhile may have been ended from outside: the work is then repeated once, in another
        process.

        Raises:
            AnyprobeError: as the function does. TooSlow, TooMuchMemory: it was ended. WorkerLost: the machine lacks
                something, or somebody ends processes.
        """
        task = partial(work, *args, **kwargs)
        try:
            return _outcome(self._do(task))
        except _Ended as first:
            log.warning("a decoding process ended (%s); its work is done once more", first)
        try:
            return _outcome(self._do(task))
        except _Ended as second:
            log.error("a decoding process ended twice at the same work (%s)", second)
            if second.from_outside:
                raise WorkerLost(
                    f"decoding processes were ended from outside ({second}); check the free memory"
                ) from second
            raise TooMuchMemory(
                "expected a file that can be decoded here, got one that needs too much memory; "
                "send it smaller, or as PNG or JPEG"
            ) from second

    def _do(self, task: Callable[[], Any]) -> dict[str, Any]:
        """Return a process's answer to a task."""
        worker = self._next()
        with self._lock:
            self._busy.append(worker)
            if self._closed:  # while it started
                worker.kill()
        try:
            answer = worker.call((task, self._seconds), self._seconds)
        except BaseException:
            worker.end()
            raise
        finally:
            with self._lock:
                self._busy.remove(worker)
        with self._lock:
            is_reusable = not self._closed and answer.pop("keep")
            if is_reusable:
                self._idle.append(worker)
        if not is_reusable:
            worker.end()
        return answer

    def _next(self) -> _Worker:
        """Return an idle process, or a new one."""
        while True:
            if self._closed:
                raise WorkerLost("the server is shutting down")
            with self._lock:
                worker = self._idle.pop() if self._idle else None
            if worker is None:
                return _Worker(self._memory_mb, self._niceness)
            if worker.is_alive():
                return worker
            worker.end()

    def close(self) -> None:
        """End all processes, busy ones too; callers waiting for those get WorkerLost."""
        with self._lock:
            self._closed = True
            for worker in self._busy:
                worker.kill()
            _end_all(self._idle)


def _end_all(workers: list[_Worker]) -> None:
    while workers:
        workers.pop().end()


class _Ended(Exception):
    """A process ended before it answered; from_outside: by a signal that files do not cause."""

    def __init__(self, status: int | None) -> None:
        super().__init__(f"signal {-status}" if status is not None and status < 0 else f"status {status}")
        self.from_outside = status is not None and -status in (signal.SIGTERM, signal.SIGINT, SIGKILL)


class _Worker:
    """One process, and the pipes to it."""

    def __init__(self, memory_mb: int, niceness: int) -> None:
        try:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", f"from {__name__} import work; work({memory_mb}, {niceness})"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env={**os.environ, **CHILD_ENVIRONMENT, "PYTHONPATH": os.pathsep.join(_import_path())},
            )
        except OSError as error:
            raise WorkerLost(f"no decoding process can be started ({error.strerror or error})") from error
        assert self._process.stdin is not None  # as PIPE asks
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin, self._process.stdout
        try:
            self._await_ready()
        except BaseException:
            self.end()
            raise

    def _await_ready(self) -> None:
        """Wait until the process has done its imports.

        Raises:
            WorkerLost: it ended, or took too long; with what it said.
        """
        stderr = self._process.stderr
        assert stderr is not None
        with _ended_after(self._process, IMPORTS_S) as timed_out:
            try:
                ready = pickle.load(self._answers) == READY
            except (OSError, EOFError, pickle.UnpicklingError):
                ready = False
        if ready:
            stderr.close()
            return
        self._process.kill()
        lines = stderr.read(-1).decode(errors="replace").strip().splitlines()[-8:]
        stderr.close()
        self._process.wait(5)
        fault = "took too long to start" if timed_out.is_set() else "ended at its start"
        raise WorkerLost(f"a decoding process {fault} (status {self._process.returncode}): {' | '.join(lines)}")

    def kill(self) -> None:
        self._process.kill()

    def is_alive(self) -> bool:
        return self._process.poll() is None

    def call(self, message: Any, seconds: float) -> dict[str, Any]:
        with _ended_after(self._process, WALL_FACTOR * seconds + START_S) as timed_out:
            try:
                _send(self._questions, message)
                return pickle.load(self._answers)
            except (OSError, EOFError, pickle.UnpicklingError) as error:
                status = self._status()
                if timed_out.is_set() or status == -SIGXCPU:
                    raise TooSlow(
                        f"expected a file that is decoded within {seconds:g} seconds, got a slower one; "
                        "send it smaller, or as PNG or JPEG"
                    ) from error
                raise _Ended(status) from error

    def _status(self) -> int | None:
        """Return the process's exit status; None if it still runs, though its pipe is closed."""
        try:
            return self._process.wait(5)
        except subprocess.TimeoutExpired:
            return None

    def end(self) -> None:
        self._process.kill()
        self._process.wait(5)
        for pipe in (self._questions, self._answers):
            with contextlib.suppress(OSError):
                pipe.close()


@contextlib.contextmanager
def _ended_after(process: subprocess.Popen, seconds: float) -> Iterator[threading.Event]:
    """Kill a process unless the block ends in time; the yielded event tells whether it was killed.

    A starved process, which uses the little processor time that it gets, may go on: the system ends it at its limit of
    processor time.
    """
    timed_out, finished = threading.Event(), threading.Event()

    def watch() -> None:
        used_s = _used_s(process.pid)
        for _ in range(STARVED_TIMES):
            if finished.wait(seconds):
                return
            used_before_s, used_s = used_s, _used_s(process.pid)
            if used_s - used_before_s < STARVED_S:
                break
        timed_out.set()
        process.kill()

    threading.Thread(target=watch, daemon=True).start()
    try:
        yield timed_out
    finally:
        finished.set()


def _used_s(pid: int) -> float:
    """Return the processor seconds that a process has used; 0 if the system does not say."""
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as stream:
            fields = stream.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError, AttributeError):
        return 0.0


def _import_path() -> list[str]:
    """Return the import path of processes: this one's without the working folder, unless this package is there.

    A random.py in it would be taken for Python's.
    """
    package_folder = os.path.realpath(Path(__file__).parents[2])
    working_folder = os.path.realpath(os.curdir)  # may be gone
    is_here = working_folder == package_folder
    return [entry for entry in sys.path if entry and (is_here or os.path.realpath(entry) != working_folder)]


def _outcome(answer: dict[str, Any]) -> Any:
    """Return an answer's result, or raise its error."""
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
    """Do pieces of work until there are no more; the main function of a process."""
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    null = os.open(os.devnull, os.O_RDWR)
    for number in (0, 1):  # C libraries print
        os.dup2(null, number)
    from anyprobe.serve import tasks

    os.dup2(null, 2)
    with contextlib.suppress(AttributeError, OSError):
        os.nice(niceness)
    tasks.ready()
    _bound_memory(memory_mb)
    _send(answers, READY)
    for count in range(1, MAX_CALLS + 1):
        try:
            task, seconds = pickle.load(questions)
        except EOFError:
            return
        _bound_time(seconds)
        answer = _answer(task)
        del task
        _send(answers, answer | {"keep": count < MAX_CALLS and _held_mb() < MAX_IDLE_MB})


def _answer(task: Callable[[], Any]) -> dict[str, Any]:
    try:
        return {"result": task()}
    except AnyprobeError as error:
        return {"error": TooMuchMemory(error) if isinstance(error.__cause__, MemoryError) else error}
    except Exception as error:
        if isinstance(error, MemoryError) or "bad_alloc" in str(error):
            text = "expected a file that fits in memory when decoded, got a larger one; send it smaller"
            return {"error": TooMuchMemory(text)}
        return {"fault": traceback.format_exc(limit=8)}


def _bound_memory(memory_mb: int) -> None:
    """Limit memory to what the process has now plus memory_mb, on systems that can."""
    try:
        import resource

        with open("/proc/self/statm", encoding="ascii") as stream:
            used = int(stream.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + memory_mb * 2**20,) * 2)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, OSError, ValueError):
        log.debug("no limit of memory")


def _bound_time(seconds: float) -> None:
    """Limit the processor time of one piece of work, in case the wall-clock watcher is gone."""
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

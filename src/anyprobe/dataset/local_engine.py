"""Tasks in processes of this machine: what a worker that died had in hand is done again by another."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from anyprobe.errors import AnyprobeError

ATTEMPTS = 3
"""How often a task is tried whose workers die."""

_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

Work = Callable[[Any, Callable[[int], None]], Any]
"""work(task, tell) does a task, calls tell(n) on the way, and returns its result; all of it can be pickled."""


class WorkerFailed(AnyprobeError):
    """A task could not be done by any worker."""


@dataclass(slots=True)
class _Worker:
    process: multiprocessing.process.BaseProcess
    pipe: Connection
    task: Any = None


def run_local(
    work: Work,
    tasks: Sequence[Any],
    watch: Callable[[Any, int], None],
    *,
    workers: int,
    say: Callable[[str], None],
) -> dict[Any, Any]:
    """Do every task in one of so many processes; result by task.

    watch(task, n) hears of progress in this process, say(line) of workers that died.

    Raises:
        AnyprobeError: what a task raised, at once; its other exceptions and three deaths as WorkerFailed.
    """
    waiting, results, deaths = deque(tasks), {}, Counter()
    crew: list[_Worker] = []
    try:
        while waiting or any(one.task is not None for one in crew):
            while waiting and len(crew) < min(workers, len(tasks)):
                crew.append(_hire(work))
            for one in crew:
                if one.task is None and waiting:
                    one.task = waiting.popleft()
                    _try_send(one.pipe, one.task)
            ready = wait([one.pipe for one in crew])
            for one in [one for one in crew if one.pipe in ready]:
                message = _receive(one.pipe)
                if message is None:
                    crew.remove(one)
                    _bury(one, waiting, deaths, watch, say)
                elif message[0] == "told":
                    watch(one.task, message[1])
                elif message[0] == "done":
                    results[one.task], one.task = message[1], None
                else:
                    raise message[1]
    finally:
        for one in crew:
            one.process.terminate()
        for one in crew:
            one.process.join()
            one.pipe.close()
    return results


def _bury(one: _Worker, waiting: deque, deaths: Counter, watch: Callable, say: Callable) -> None:
    """Give a dead worker's task back, unless it killed too many."""
    one.process.join()
    one.pipe.close()
    code = one.process.exitcode or 0
    cause = f"signal {-code}" if code < 0 else f"status {code}"
    if one.task is None:
        say(f"an idle worker died ({cause})")
        return
    deaths[one.task] += 1
    watch(one.task, 0)
    if deaths[one.task] >= ATTEMPTS:
        raise WorkerFailed(
            f"task {one.task}: expected a result, but its worker died {ATTEMPTS} times (last by {cause}); "
            "if memory is short, use fewer --workers"
        )
    say(f"a worker died ({cause}); task {one.task} is done again by another")
    waiting.appendleft(one.task)


def _hire(work: Work) -> _Worker:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(work, theirs), daemon=True)
    with one_thread(), _interrupts_held():
        process.start()
    theirs.close()
    return _Worker(process=process, pipe=ours)


@contextmanager
def one_thread() -> Iterator[None]:
    """Numeric libraries loaded by processes begun here use one thread each: as fast, and the same sums.

    NumPy's products of small matrices are on every path that makes pairs, and its second thread would spin
    between them on a core that another worker needs.
    """
    old = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in old.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Processes begun here never see Ctrl-C; this one sees it afterwards and ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # by itself it would unblock the signal when it begins
    old = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)


def _try_send(pipe: Connection, message: Any) -> None:
    try:
        pipe.send(message)
    except OSError:  # it died; the pipe says so when it is read
        pass


def _receive(pipe: Connection) -> Any:
    try:
        return pipe.recv()
    except (EOFError, OSError):
        return None


def _serve(work: Work, pipe: Connection) -> None:
    """A worker's life; a parent that is gone breaks the pipe and so ends it, at the next pair at the latest."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            task = pipe.recv()
            try:
                answer = ("done", work(task, lambda count: pipe.send(("told", count))))
            except AnyprobeError as error:
                answer = ("failed", _portable(error))
            except (BrokenPipeError, ConnectionError):
                return
            except Exception as error:
                traceback.print_exc()
                answer = ("failed", WorkerFailed(f"task {task}: expected a result, got {error!r}"))
            pipe.send(answer)
    except (EOFError, OSError):
        return


def _portable(error: AnyprobeError) -> AnyprobeError:
    """An error that can be pickled, whatever its constructor takes."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return AnyprobeError(str(error))
    return error

"""Pools that do tasks, on this machine or on a Ray cluster; tasks of a lost worker or node go to others."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import socket
import traceback
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any

from anyprobe.errors import AnyprobeError, InputError, MissingExtra

ATTEMPTS = 3
"""Largest number of attempts at a task whose workers die."""

_CHILD_ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS", "PYTHONSAFEPATH"), "1"
)
"""Environment of worker processes: one thread, and no modules from the working folder, whose random.py is not
Python's."""

Work = Callable[[Any, Callable[[int], None]], Any]
"""A function work(task, report) that does a task, calls report(n) on the way, and returns its result; all can be
pickled."""


class WorkerFailed(AnyprobeError):
    """No worker could do a task."""


@dataclass(slots=True)
class _Worker:
    process: multiprocessing.process.BaseProcess
    pipe: Connection
    task: Any = None


def run_local(
    work: Work, tasks: Sequence[Any], watch: Callable[[Any, int], None], *, workers: int, log: Callable[[str], None]
) -> dict[Any, Any]:
    """Do every task in worker processes on this machine; return the results by task.

    watch(task, n) hears of progress in this process, log(line) of workers that died.

    Raises:
        AnyprobeError: what a task raised, at once; its other exceptions and three deaths as WorkerFailed.
    """
    waiting, results = deque(tasks), {}
    deaths: Counter[Any] = Counter()
    pool: list[_Worker] = []
    try:
        while waiting or any(worker.task is not None for worker in pool):
            while waiting and len(pool) < min(workers, len(tasks)):
                pool.append(_start_worker(work))
            for worker in pool:
                if worker.task is None and waiting:
                    worker.task = waiting.popleft()
                    with suppress(OSError):  # it died; the pipe says so when it is read
                        worker.pipe.send(worker.task)
            ready = wait([worker.pipe for worker in pool])
            for worker in [worker for worker in pool if worker.pipe in ready]:
                try:
                    message = worker.pipe.recv()
                except (EOFError, OSError):
                    pool.remove(worker)
                    _requeue_task(worker, waiting, deaths, watch, log)
                    continue
                if message[0] == "progress":
                    watch(worker.task, message[1])
                elif message[0] == "done":
                    results[worker.task], worker.task = message[1], None
                else:
                    raise message[1]
    finally:
        for worker in pool:
            worker.process.terminate()
        for worker in pool:
            worker.process.join()
            worker.pipe.close()
    return results


def _requeue_task(worker: _Worker, waiting: deque, deaths: Counter, watch: Callable, log: Callable) -> None:
    """Requeue a dead worker's task; WorkerFailed if it has ended too many workers."""
    worker.process.join()
    worker.pipe.close()
    code = worker.process.exitcode or 0
    cause = f"signal {-code}" if code < 0 else f"status {code}"
    if worker.task is None:
        log(f"an idle worker died ({cause})")
        return
    deaths[worker.task] += 1
    watch(worker.task, 0)
    if deaths[worker.task] >= ATTEMPTS:
        raise WorkerFailed(
            f"expected a result, but its worker died {ATTEMPTS} times (last by {cause}); "
            "if memory is short, use fewer --workers",
            source=f"task {worker.task}",
        )
    log(f"a worker died ({cause}); task {worker.task} is repeated by another")
    waiting.appendleft(worker.task)


def _start_worker(work: Work) -> _Worker:
    context = multiprocessing.get_context("spawn")
    own_end, worker_end = context.Pipe()
    process = context.Process(target=_serve, args=(work, worker_end), daemon=True)
    with one_thread(), _interrupts_held():
        process.start()
    worker_end.close()
    return _Worker(process=process, pipe=own_end)


@contextmanager
def one_thread() -> Iterator[None]:
    """Make numeric libraries use one thread in processes started within the block: as fast, with the same sums.

    NumPy's products of small matrices are on every path that makes pairs, and its second thread would spin
    between them on a core that another worker needs.
    """
    old = {name: os.environ.get(name) for name in _CHILD_ENVIRONMENT}
    os.environ.update(_CHILD_ENVIRONMENT)
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
    """Shield processes started within the block from Ctrl-C; this process receives it afterwards and ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # by itself it would unblock the signal when it begins
    old = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)


def _serve(work: Work, pipe: Connection) -> None:
    """Do the tasks that come through a pipe; a lost parent breaks the pipe and ends the worker at the next pair."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            task = pipe.recv()
            try:
                answer = ("done", work(task, lambda count: pipe.send(("progress", count))))
            except AnyprobeError as error:
                answer = ("failed", _portable(error))
            except (BrokenPipeError, ConnectionError):
                return
            except Exception as error:
                traceback.print_exc()
                answer = ("failed", WorkerFailed(f"expected a result, got {error!r}", source=f"task {task}"))
            pipe.send(answer)
    except (EOFError, OSError):
        return


def _portable(error: AnyprobeError) -> AnyprobeError:
    """Return the error if it can be pickled, else an AnyprobeError with its text."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return AnyprobeError(str(error))
    return error


TASKS_PER_CPU = 2
"""Tasks handed to Ray per CPU; the rest wait here, which keeps a long job light."""

CONNECT_S = 10.0

_QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",  # else ray.init warns of a change of theirs
}


def run_ray(
    work: Work,
    tasks: Sequence[Any],
    watch: Callable[[Any, int], None],
    *,
    address: str | None = None,
    workers: int = 2,
    log: Callable[[str], None],
    finished: Callable[[Any], int] = lambda task: 1,
) -> dict[Any, Any]:
    """Do every task on a cluster, one CPU each; return the results by task.

    address: a cluster's, "auto" for the one this machine is a node of; None begins one here with so many workers, which
    ends with this call. watch(task, finished(task)) reports each task that is done. Tasks must not mind being done
    twice: a node that was given up may still be at work.

    Raises:
        AnyprobeError: what a task raised; its other exceptions, and a task whose
            workers were lost three times, as WorkerFailed.
    """
    ray = _connect(address, workers)
    try:
        remote = ray.remote(num_cpus=1, max_retries=ATTEMPTS - 1, scheduling_strategy="SPREAD")(_call)
        shared = ray.put(work)
        waiting, results = list(reversed(tasks)), {}
        running: dict[Any, Any] = {}
        nodes = _live_nodes(ray)
        while waiting or running:
            cpus = int(ray.cluster_resources().get("CPU", 1))
            while waiting and len(running) < TASKS_PER_CPU * max(1, cpus):
                task = waiting.pop()
                running[remote.remote(shared, task)] = task
            ready, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
            for reference in ready:
                task = running.pop(reference)
                results[task] = _result(ray, reference, task)
                watch(task, finished(task))
            live = _live_nodes(ray)
            for node in sorted(nodes - live):
                log(f"node {node} was lost; others repeat its tasks")
            nodes = live
        return results
    finally:
        ray.shutdown()


def _call(work: Work, task: Any) -> Any:
    return work(task, lambda count: None)


def _result(ray, reference: Any, task: Any) -> Any:
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, AnyprobeError):
            raise error.cause from None
        reason = f"{type(error.cause).__name__}: {_short(error.cause)}"
        raise WorkerFailed(f"expected a result, got {reason}", source=f"task {task}") from error
    except ray.exceptions.RayError as error:
        raise WorkerFailed(
            f"expected a result, but its workers were lost {ATTEMPTS} times ({_short(error)})", source=f"task {task}"
        ) from error


def _short(error: BaseException) -> str:
    return " ".join(str(error).split())[:160]


def _live_nodes(ray) -> set[str]:
    return {f"{node['NodeManagerAddress']} ({node['NodeID'][:8]})" for node in ray.nodes() if node["Alive"]}


def _connect(address: str | None, workers: int):
    for name, value in _QUIET.items():
        os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError as error:
        raise MissingExtra("ray", "ray", "--engine ray", error) from error
    if address is None:
        options: dict[str, Any] = {"num_cpus": workers, "include_dashboard": False}
    else:
        _check_answers(address)
        options = {"address": address}
    try:
        ray.init(**options, log_to_driver=False, logging_level="ERROR", configure_logging=False)
    except Exception as error:  # of many kinds, bare ones too
        ray.shutdown()
        raise InputError(
            f"expected a cluster {f'at {address}' if address else 'to start here'}, "
            f"got {type(error).__name__} ({_short(error)}); see `ray status`",
            subject="engine",
            source="ray",
        ) from error
    return ray


def _check_answers(address: str) -> None:
    """Check that a cluster's address answers: Ray itself tries for minutes and then ends the process."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host:  # "auto" and the like: found by files on this machine
        return
    try:
        socket.create_connection((host, int(port)), timeout=CONNECT_S).close()
    except (OSError, ValueError) as error:
        raise InputError(
            f"expected a Ray cluster, got no answer ({_short(error)}); see `ray status`",
            subject="address",
            source=address,
        ) from error
